"""Is what the published laws do an artefact of sampling? Steps from 33 ms to 10 µs.

The laws run on Eq. 31 with the simulated circle (Eq. 37) and Table II's start at rest, evaluated
every step and held in between. As printed, and with |v1|, |v2| cut to what tyres can hold: a limit
that every real robot has, and that makes the laws' limit for small steps visible.
"""

import math
from typing import Any

import numpy as np

from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.studies.reproduce.ideal.continuous import CONSTANT, EXACT
from ttwmr_mj.studies.reproduce.ideal.loop import IdealLoop, Solution, sampled

STEPS_S = (33e-3, 10e-3, 3.3e-3, 1e-3, 330e-6, 100e-6, 33e-6, 10e-6)
DURATION_S = 4.0
GRIP_M_S2 = 9.0  # about 0.9·g: friction of tyres on the floor
SHOWN = 240  # rows of each curve

PRINTED = LyapunovOptions(kind="lyapunov", singular_terms="published")
LAWS: dict[str, tuple[LyapunovOptions, float]] = {
    "law (32), singular terms omitted": (LyapunovOptions(kind="lyapunov"), math.inf),
    "law (32) as printed": (PRINTED, math.inf),
    "law (32) as printed, limited": (PRINTED, GRIP_M_S2),
    "law (47), γ exact, limited": (EXACT, GRIP_M_S2),
    "law (70), constant ρ": (CONSTANT, math.inf),
    "law (70), constant ρ, limited": (CONSTANT, GRIP_M_S2),
}


def study(name: str) -> dict[str, Any]:
    """One law at every step size: distance of P from its reference and V over time."""
    options, limit = LAWS[name]
    loop = IdealLoop(options, radius_m=1.0, rate_rad_s=0.5, limit_m_s2=limit)
    start = loop.at_rest(0.6, -0.3)
    runs = [_row(loop, sampled(loop, start, DURATION_S, step, SHOWN), step) for step in STEPS_S]
    return {"law": name, "limit_m_s2": None if math.isinf(limit) else limit, "runs": runs}


def _row(loop: IdealLoop, path: Solution, step_s: float) -> dict[str, Any]:
    distance = loop.distances(path)
    finite = np.isfinite(distance)
    return {
        "step_s": step_s,
        "end": path.end,
        "time_s": path.time_s[finite].tolist(),
        "error_m": distance[finite].tolist(),
        "final_error_m": float(distance[-1]) if finite[-1] and path.end == "time" else None,
    }
