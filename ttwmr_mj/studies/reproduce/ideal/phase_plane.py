"""Law (32) in the plane (e1, e2): where its solutions go, and that they end (Theorem 1).

One axis of Eq. 31 under law (32) is e1' = e2, e2' = −α2·e2 − (α1/α2)(e1 + e1²/e2). On rays,
u = e2/e1 obeys u' = −α2·u − (α1/α2)(1 + 1/u) − u². For Table II u' < 0 at every u > 0; for u < 0 it
is positive above one root and negative below. Below it a path crosses e1 = 0 into u > 0; so all but
that one ray reach u = 0, where e2 = 0 and e1 ≠ 0, in finite time. There e1²/e2 has no value, and on
both sides of it the term drives e2 back to zero: in Filippov's sense the solution slides along
e2 = 0, that is, the error stands still.
"""

import math
from typing import Any

import numpy as np

from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.studies.reproduce.ideal.loop import ends_where, pulled

PRINTED = LyapunovOptions(kind="lyapunov", singular_terms="published")
ALPHA1, ALPHA2 = PRINTED.alpha1, PRINTED.alpha2
STARTS = 24
HORIZON_S = 20.0
RADIUS_M = 0.5  # of the ring of starts: e1 in m, e2 in m/s


def rates(time_s: float, e: Any) -> tuple[float, float]:
    """(e1', e2') as printed."""
    del time_s
    e1, e2 = float(e[0]), float(e[1])
    return e2, -ALPHA2 * e2 - ALPHA1 / ALPHA2 * pulled(e1, e2, PRINTED)


def invariant_ray() -> float:
    """The only u = e2/e1 with u' = 0 [1/s], where e1 → 0 along a straight line."""
    ratio = ALPHA1 / ALPHA2
    roots = np.roots([1.0, ALPHA2, ratio, ratio])
    real = roots[np.abs(roots.imag) < 1e-9].real  # of the three, two are a complex pair
    return float(real.min())


def study() -> dict[str, Any]:
    """24 starts on a ring, each followed until e2 = 0 or 20 s.

    Returns:
        paths (list of e1, e2 lists), end times, what is left of e1, and of V.
    """
    from scipy.integrate import solve_ivp

    paths, ends, left, v_left = [], [], [], []
    for i in range(STARTS):
        angle = 2.0 * math.pi * (i + 0.5) / STARTS  # none of them on e2 = 0
        start = (RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle))
        solution = solve_ivp(
            rates,
            (0.0, HORIZON_S),
            start,
            method="DOP853",
            rtol=1e-10,
            atol=1e-13,
            events=ends_where(lambda _, e: float(e[1])),
            first_step=1e-7,
        )
        e1, e2 = solution.y
        paths.append([e1.tolist(), e2.tolist()])
        ends.append(float(solution.t[-1]))
        left.append(float(e1[-1]))
        before = ALPHA1 * start[0] ** 2 + ALPHA2 * start[1] ** 2
        v_left.append(float((ALPHA1 * e1[-1] ** 2 + ALPHA2 * e2[-1] ** 2) / before))
    return {
        "alpha1": ALPHA1,
        "alpha2": ALPHA2,
        "invariant_ray_1_s": invariant_ray(),
        "paths": paths,
        "end_time_s": ends,
        "left_e1_m": left,
        "left_v_share": v_left,
    }
