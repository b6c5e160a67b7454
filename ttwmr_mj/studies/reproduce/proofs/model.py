"""Proofs about the model: Eq. 11-29, 38-43, and where a free trailer is in equilibrium."""

import sympy as sp

from ttwmr_mj.studies.reproduce.proofs.proof import Proof, vanish


def eq_23() -> Proof:
    """Lagrange (Eq. 11) on the energy of Eq. 13, reduced, against the printed bias of Eq. 23."""
    t = sp.Symbol("t")
    m1, m2, j1, j2, a1, length = sp.symbols("m_1 m_2 J_1 J_2 a_1 l", positive=True)
    x, y, th1, th2 = (sp.Function(name)(t) for name in ("x", "y", "theta_1", "theta_2"))
    q = [x, y, th1, th2]
    nose = sp.Matrix([x + a1 * sp.cos(th1), y + a1 * sp.sin(th1)]).diff(t)
    tail = sp.Matrix([x - length * sp.cos(th2), y - length * sp.sin(th2)]).diff(t)
    energy = (m1 * nose.dot(nose) + m2 * tail.dot(tail)) / 2
    energy += (j1 * th1.diff(t) ** 2 + j2 * th2.diff(t) ** 2) / 2
    left = sp.Matrix([energy.diff(c.diff(t)).diff(t) - energy.diff(c) for c in q])
    acc = [c.diff(t, 2) for c in q]
    mass = left.jacobian(acc)
    bias = left - mass * sp.Matrix(acc)
    s, w1, w2 = sp.symbols("sdot thetadot_1 thetadot_2")
    spread = sp.Matrix([[sp.cos(th1), 0, 0], [sp.sin(th1), 0, 0], [0, 1, 0], [0, 0, 1]])
    xi = sp.Matrix([s, w1, w2])
    motion = dict(zip([c.diff(t) for c in q], spread * xi, strict=True))
    # spread.diff holds θ̇1 as a derivative: replaced with the motion
    derived = (spread.T * (mass * spread.diff(t) * xi + bias)).subs(motion)
    h = sp.Symbol("phi")  # θ2 − θ1
    expected = sp.Matrix(
        [
            -m1 * a1 * w1**2 + m2 * length * sp.cos(th2 - th1) * w2**2,
            m1 * a1 * s * w1,
            -m2 * length * sp.cos(th2 - th1) * s * w1,
        ]
    )
    pairs = zip(derived, expected, strict=True)
    proved = vanish(*(sp.expand_trig(sp.expand(a)) - sp.expand_trig(b) for a, b in pairs))
    shown = expected.subs(th2, th1 + h)
    return Proof(
        proved,
        [
            ("bias that follows from Eq. 13", shown),
            ("derived minus printed", shown - shown.subs(s, 1)),
        ],
    )


def eq_11() -> Proof:
    """The constraint force has one sign in Eq. 11, the other in Eq. 14-15; S removes it."""
    lam, th1 = sp.symbols("lambda_1 theta_1", real=True)
    row = sp.Matrix([[sp.sin(th1), -sp.cos(th1), 0, 0]])  # A of Eq. 4
    by_eq_11 = -lam * row.T
    printed = sp.Matrix([lam * sp.sin(th1), -lam * sp.cos(th1), 0, 0])  # Eq. 14-17
    spread = sp.Matrix([[sp.cos(th1), 0, 0], [sp.sin(th1), 0, 0], [0, 1, 0], [0, 0, 1]])
    removed = (*(spread.T * by_eq_11), *(spread.T * printed))
    return Proof(
        vanish(*(by_eq_11 + printed), *removed) and not vanish(*(by_eq_11 - printed)),
        [("by Eq. 11", by_eq_11), ("as printed", printed)],
    )


def eq_21() -> Proof:
    """The right side of Eq. 21 is q̈, and not q̇, of Eq. 5."""
    t = sp.Symbol("t")
    th1, u1, u2, w2 = (sp.Function(name)(t) for name in ("theta_1", "u_1", "u_2", "thetadot_2"))
    spread = sp.Matrix([[sp.cos(th1), 0, 0], [sp.sin(th1), 0, 0], [0, 1, 0], [0, 0, 1]])
    motion = sp.Matrix([u1, u2, w2])
    q_rate = spread * motion
    right = spread.diff(t) * motion + spread * motion.diff(t)
    standing = {th1: 0, u2: 0, w2: 0, u1: 1}  # drives ahead at constant speed: q̇ ≠ 0, q̈ = 0
    differs = [side.subs(standing).doit() for side in (q_rate, right)]
    return Proof(
        vanish(*(q_rate.diff(t) - right)) and differs[0] != differs[1],
        [("Ṡ·ξ̇ + S·ξ̈", right), ("q̇", q_rate)],
    )


def eq_24() -> Proof:
    """The fifth row of Eq. 24 is Eq. 17 with k; its fourth row as printed adds another equation."""
    m2, j2, length = sp.symbols("m_2 J_2 l", positive=True)
    ax, ay, th2, acc, rate = sp.symbols("xddot yddot theta_2 thetaddot_2 thetadot_2", real=True)
    k = j2 / (m2 * length) + length
    eq_17 = m2 * length * (ax * sp.sin(th2) - ay * sp.cos(th2)) + (j2 + m2 * length**2) * acc
    fifth = ax * sp.sin(th2) - ay * sp.cos(th2) + k * acc
    forced = fifth.subs(acc, rate)  # with θ̇2 = θ̈2 it fixes θ̇2, for a system of second order
    return Proof(
        vanish(eq_17 - m2 * length * fifth) and not vanish(forced.diff(rate)),
        [("Eq. 17 over m2·l", fifth), ("with θ̇2 = θ̈2 it would say that this is zero", forced)],
    )


def eq_26() -> Proof:
    """ẍ and ÿ of Eq. 26 are Eq. 27-28."""
    t = sp.Symbol("t")
    u1, th1 = sp.Function("u_1")(t), sp.Function("theta_1")(t)
    a, b = (u1 * sp.cos(th1)).diff(t), (u1 * sp.sin(th1)).diff(t)
    u2 = th1.diff(t)
    v1 = u1.diff(t) * sp.cos(th1) - u1 * u2 * sp.sin(th1)
    v2 = u1.diff(t) * sp.sin(th1) + u1 * u2 * sp.cos(th1)
    return Proof(vanish(a - v1, b - v2), [("second derivative of x", a), ("of y", b)])


def eq_41() -> Proof:
    """Lagrange with dissipation (Eq. 38-40): what a torque between the bodies does to θ̈2."""
    m2, j2, length = sp.symbols("m_2 J_2 l", positive=True)
    kt, ct, th1, th2, w1, w2, ax, ay, acc = sp.symbols(
        "k_t c_t theta_1 theta_2 thetadot_1 thetadot_2 xddot yddot thetaddot_2", real=True
    )
    potential = kt * (th1 - th2) ** 2 / 2
    dissipation = ct * (w1 - w2) ** 2 / 2
    balance = m2 * length * (ax * sp.sin(th2) - ay * sp.cos(th2)) + (j2 + m2 * length**2) * acc
    derived = sp.solve(balance + potential.diff(th2) + dissipation.diff(w2), acc)[0]
    k = j2 / (m2 * length) + length
    torque = kt * (th1 - th2) + ct * (w1 - w2)
    free = (-ax * sp.sin(th2) + ay * sp.cos(th2)) / k
    printed = free + torque / k
    share = (derived - free) / (printed - free)
    return Proof(
        vanish(derived - free - torque / (j2 + m2 * length**2), share - 1 / (m2 * length)),
        [
            ("what the torque adds", torque / (j2 + m2 * length**2)),
            ("as printed it adds, with k = l + J2/(m2·l)", torque / sp.Symbol("k")),
            ("derived over printed", sp.simplify(share)),
        ],
    )


def circle_equilibrium() -> Proof:
    """A free trailer on a circle points outward; aligned is no equilibrium."""
    radius, rate, k = sp.symbols("R omega k", positive=True)
    t, phi = sp.symbols("t phi", real=True)
    ax, ay = (-radius * rate**2 * sp.cos(rate * t), -radius * rate**2 * sp.sin(rate * t))
    theta2 = phi + rate * t
    acc = (-ax * sp.sin(theta2) + ay * sp.cos(theta2)) / k
    expected = radius * rate**2 * sp.sin(phi) / k
    slope = expected.diff(phi)
    stable = slope.subs(phi, sp.pi).is_negative and slope.subs(phi, 0).is_positive
    aligned = expected.subs(phi, sp.pi / 2)
    return Proof(
        vanish(sp.expand_trig(acc) - sp.expand_trig(expected)) and bool(stable) and aligned != 0,
        [("acceleration of φ = θ2 − ωt", expected), ("aligned, φ = π/2, it is not zero", aligned)],
    )
