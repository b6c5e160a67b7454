"""Proofs about the laws: Eq. 32-36, 48-61, 64-68."""

from typing import Any

import sympy as sp

from ttwmr_mj.studies.reproduce.proofs.proof import Proof, vanish


def _trailer() -> dict[str, Any]:
    names = "v_1 v_2 theta_2 k alpha_2 alpha_4 e_2 e_4 gamma w"
    return dict(zip(names.split(), sp.symbols(names, real=True), strict=True))


def eq_32() -> Proof:
    """Slope of u = e2/e1 under law (32), its one root for α1 = 25, α2 = 10, and time to u = 0."""
    t = sp.Symbol("t")
    a1, a2 = sp.symbols("alpha_1 alpha_2", positive=True)
    u = sp.Symbol("u", real=True)
    e1, e2 = sp.Function("e_1")(t), sp.Function("e_2")(t)
    law = -a2 * e2 - a1 / a2 * (e1 + e1**2 / e2)
    slope = (e2 / e1).diff(t).subs({e2.diff(t): law, e1.diff(t): e2}).subs(e2, u * e1)
    expected = -a2 * u - a1 / a2 * (1 + 1 / u) - u**2
    table = expected.subs({a1: 25, a2: 10})
    cubic = sp.Poly(sp.expand(-table * u), u)
    below_zero = sp.Poly(cubic.as_expr().subs(u, -u), u)
    one_root = cubic.count_roots(0, sp.oo) == 0 and below_zero.count_roots(0, sp.oo) == 1
    # dt = du/u' ≈ −(α2/α1)·u·du near u = 0: an integrable singularity
    near = sp.limit(u * expected, u, 0)
    return Proof(
        vanish(slope - expected, near + a1 / a2) and bool(one_root),
        [
            ("slope of u = e2/e1", expected),
            ("for Table II", table),
            ("u·u' where u → 0, so u reaches 0 in finite time", near),
            ("its only root, for Table II", sp.Float(min(sp.real_roots(cubic)).n(6), 6)),
        ],
    )


def eq_36() -> Proof:
    """V' of law (32): as printed, without and with regularised singular terms."""
    a1, a2, eps = sp.symbols("alpha_1 alpha_2 epsilon", positive=True)
    e1, e2 = sp.symbols("e_1 e_2", real=True)

    def rate(term: Any) -> Any:
        return a1 * e1 * e2 + a2 * e2 * (-a2 * e2 - a1 / a2 * (e1 + term))

    printed, omitted = rate(e1**2 / e2), rate(0)
    regular = rate(e1**2 * e2 / (e2**2 + eps**2))
    claimed = -a1 * e1**2 - (a2 * e2) ** 2
    extra = a1 * e1**2 * e2**2 / (e2**2 + eps**2)  # never negative
    return Proof(
        vanish(printed - claimed, omitted + (a2 * e2) ** 2, regular + (a2 * e2) ** 2 + extra),
        [
            ("one axis of V', as printed, where e2 ≠ 0", sp.expand(sp.simplify(printed))),
            ("without the singular term", sp.simplify(omitted)),
            ("with it regularised", -((a2 * e2) ** 2) - extra),
        ],
    )


def eq_48() -> Proof:
    """With γ = N/D the correction drives D² at a rate that does not vanish at D = 0."""
    n = _trailer()
    excess, d_symbol = sp.symbols("N D", real=True)
    sin, cos = sp.sin(n["theta_2"]), sp.cos(n["theta_2"])
    gamma = excess / d_symbol
    d_rate = n["alpha_4"] * sin * (-n["alpha_2"] * n["e_2"] * gamma) + n["alpha_2"] * cos * (
        n["alpha_4"] * n["e_4"] * gamma
    )
    across = n["e_4"] * cos - n["e_2"] * sin
    expected = 2 * n["alpha_2"] * n["alpha_4"] * excess * across
    return Proof(
        vanish(2 * d_symbol * d_rate - expected),
        [("what the correction adds to d(D²)/dt", expected)],
    )


def eq_53() -> Proof:
    """The corrective terms (Eq. 50-54) cancel in V', and only turn (e2, e4)."""
    n = _trailer()
    push = (n["alpha_4"] * n["e_4"] * n["gamma"], -n["alpha_2"] * n["e_2"] * n["gamma"])
    power = n["alpha_2"] * n["e_2"] * push[0] + n["alpha_4"] * n["e_4"] * push[1]
    length = n["e_2"] * push[0] + n["e_4"] * push[1]
    alpha = sp.Symbol("alpha", positive=True)
    equal = {n["alpha_2"]: alpha, n["alpha_4"]: alpha}
    return Proof(
        vanish(power, length.subs(equal), push[0].subs(n["e_4"], 0), push[1].subs(n["e_2"], 0)),
        [("what γ does to the velocity error, for α2 = α4", sp.Matrix(push).subs(equal))],
    )


def eq_58() -> Proof:
    """The sign of the γ term, and that Eq. 61 with the corrected sign gives θ̈2 = w."""
    n = _trailer()
    sin, cos = sp.sin(n["theta_2"]), sp.cos(n["theta_2"])
    v1 = n["v_1"] + n["alpha_4"] * n["e_4"] * n["gamma"]
    v2 = n["v_2"] - n["alpha_2"] * n["e_2"] * n["gamma"]
    acc = (-v1 * sin + v2 * cos) / n["k"]
    d = n["alpha_4"] * n["e_4"] * sin + n["alpha_2"] * n["e_2"] * cos
    sideways = -n["v_1"] * sin + n["v_2"] * cos
    mended, printed = (sideways - d * n["gamma"]) / n["k"], (sideways + d * n["gamma"]) / n["k"]
    exact = (sideways - n["k"] * n["w"]) / d
    return Proof(
        vanish(acc - mended, mended.subs(n["gamma"], exact) - n["w"]) and not vanish(acc - printed),
        [("coefficient of γ in k·θ̈2, from Eq. 57", sp.expand(acc * n["k"]).coeff(n["gamma"]))],
    )


def eq_65() -> Proof:
    """Table II's PID gains put all poles of Eq. 64-67 at −4."""
    s = sp.Symbol("s")
    return Proof(
        vanish(sp.expand((s + 4) ** 3) - (s**3 + 12 * s**2 + 48 * s + 64)),
        [("characteristic polynomial", sp.factor(s**3 + 12 * s**2 + 48 * s + 64))],
    )


def eq_68() -> Proof:
    """D holds θ2, not e5: the two differ unless θ2d = 0."""
    n = _trailer()
    th2d = sp.Symbol("theta_2d", real=True)
    with_theta = n["alpha_4"] * n["e_4"] * sp.sin(n["theta_2"])
    with_e5 = n["alpha_4"] * n["e_4"] * sp.sin(n["theta_2"] - th2d)
    return Proof(
        not vanish(with_theta - with_e5) and vanish((with_theta - with_e5).subs(th2d, 0)),
        [("difference in the first term", with_theta - with_e5)],
    )
