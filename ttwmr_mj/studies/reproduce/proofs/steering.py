"""Why no γ that cancels in V' can steer the trailer (docs/theory/limits.md)."""

import sympy as sp

from ttwmr_mj.studies.reproduce.proofs.proof import Proof, vanish


def no_gamma() -> Proof:
    """What γ drops out of: V', the size of the velocity errors, the trailer's η; and what is left.

    With g = (α2·e2, α4·e4), w = (e2, e4), t = (cos θ2, sin θ2), n = (−sin θ2, cos θ2) and the
    reference's acceleration a: c ⟂ g is γ·(α4·e4, −α2·e2), and η = k·θ̇2 − n·w obeys
    η' = n·a + θ̇2·(t·w), without γ. At e = 0 that is the free trailer, which keeps areas of (θ2, θ̇2)
    and, on a circle, an energy.
    """
    time = sp.Symbol("t")
    a1, a2, a3, a4, k = sp.symbols("alpha_1 alpha_2 alpha_3 alpha_4 k", positive=True)
    gamma, ax, ay = (sp.Function(name)(time) for name in ("gamma", "a_x", "a_y"))
    e1, e2, e3, e4, th2 = (
        sp.Function(f"{name}")(time) for name in "e_1 e_2 e_3 e_4 theta_2".split()
    )
    push = (a4 * e4 * gamma, -a2 * e2 * gamma)
    c1, c2 = sp.symbols("c_1 c_2")
    across = sp.solve(a2 * e2 * c1 + a4 * e4 * c2, c1)[0]  # every (c1, c2) that cancels in V'
    all_of_them = vanish(across - push[0].subs(gamma, -c2 / (a2 * e2)))

    rates = {
        e1.diff(time): e2,
        e2.diff(time): -a2 * e2 - a1 / a2 * e1 + push[0],
        e3.diff(time): e4,
        e4.diff(time): -a4 * e4 - a3 / a4 * e3 + push[1],
    }
    v = (a1 * e1**2 + a2 * e2**2 + a3 * e3**2 + a4 * e4**2) / 2
    size = (a2 * e2**2 + a4 * e4**2) / 2
    v_rate, size_rate = (sp.expand(part.diff(time).subs(rates)) for part in (v, size))

    sin, cos = sp.sin(th2), sp.cos(th2)
    v1, v2 = ax + e2.diff(time), ay + e4.diff(time)  # P's acceleration, whatever made it
    eta = k * th2.diff(time) - (-sin * e2 + cos * e4)
    swing = {th2.diff(time, 2): (-v1 * sin + v2 * cos) / k}
    eta_rate = eta.diff(time).subs(swing)
    expected = -sin * ax + cos * ay + th2.diff(time) * (cos * e2 + sin * e4)

    radius, rate, phi, swing_rate = sp.symbols("R omega phi phidot", real=True)
    free = radius * rate**2 * sp.sin(phi) / k  # proof "circle": φ = θ2 − ωt
    energy = k * swing_rate**2 / 2 + radius * rate**2 * sp.cos(phi)
    energy_rate = energy.diff(phi) * swing_rate + energy.diff(swing_rate) * free
    return Proof(
        all_of_them
        and vanish(v_rate + (a2 * e2) ** 2 + (a4 * e4) ** 2, eta_rate - expected, energy_rate)
        and not size_rate.has(gamma)
        and not vanish(free.subs(phi, sp.pi / 2)),
        [
            ("V' under law (32) without e²/ė, with any γ", sp.factor(v_rate)),
            ("rate of (α2·e2² + α4·e4²)/2, with any γ", size_rate),
            ("rate of η = k·θ̇2 − n·w, with any γ", expected),
            ("what a free trailer on a circle keeps", energy),
        ],
    )
