"""Laws (32), (47) and (70) on Eq. 31 as differential equations, without any sampling (Theorem 3).

With γ exact, put ψ for the direction of (α2·e2, α4·e4) and c = cos(ψ − θ2), so that D of Eq. 48 is
that vector's length times c. Near c = 0 the correction turns ψ at a rate ∝ −(A − k·w)/c: whatever
the sign of A − k·w, one side of c = 0 runs into it like a square root of time, and no solution of
the printed law goes on.
"""

import math
from typing import Any

import numpy as np

from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.controllers.lyapunov_pid import LyapunovPidOptions
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.reproduce.ideal.loop import IdealLoop, State, solve

CIRCLES = {"lab circle (Eq. 72-73)": (0.43, 0.125, 0.35), "circle (Eq. 37)": (1.0, 0.5, 0.0)}
THETA2 = {"aligned": 0.5 * math.pi, "outward": math.pi}
START_M = (0.6, -0.3)
DURATION_S = 20.0
DECADES = 6

EXACT = LyapunovPidOptions(kind="lyapunov_pid", gamma="exact")
CONSTANT = LyapunovPidOptions(kind="lyapunov_pid")


def study() -> dict[str, Any]:
    """Both circles, both θ2 references, both forms of γ; and law (32)'s decay by decades."""
    cases = []
    for circle, numbers in CIRCLES.items():
        for theta2, offset in THETA2.items():
            for law, options in (("exact", EXACT), ("constant", CONSTANT)):
                loop = IdealLoop(options, *numbers, theta2_offset_rad=offset)
                cases.append({"circle": circle, "theta2": theta2, "gamma": law} | _case(loop))
    return {"cases": cases, "decade_times_s": decade_times()}


def _case(loop: IdealLoop) -> dict[str, Any]:
    exact = loop.options == EXACT

    def singular(time_s: float, z: State) -> float:
        return loop.command(time_s, z).d

    path = solve(loop, loop.at_rest(*START_M), DURATION_S, singular if exact else None)
    rows = [(t, tuple(z)) for t, z in zip(path.time_s, path.z, strict=True)]
    v = np.array([loop.lyapunov(*row) for row in rows])
    commands = [loop.command(*row) for row in rows]
    return {
        "end": path.end,
        "end_time_s": float(path.time_s[-1]),
        "time_s": path.time_s.tolist(),
        "error_m": loop.distances(path).tolist(),
        "v_share": (v / v[0]).tolist(),
        "e5_rad": [command.e5 for command in commands],
        "rho_d": [CONSTANT.rho * command.d for command in commands],
    }


def decade_times() -> list[float]:
    """When law (32) without singular terms has brought |e| to 10⁻¹, 10⁻², ... of its start [s]."""
    loop = IdealLoop(LyapunovOptions(kind="lyapunov"), *CIRCLES["lab circle (Eq. 72-73)"])
    path = solve(loop, loop.at_rest(*START_M), 70.0, samples=7001)
    return decades(path.time_s, loop.distances(path))


def decades(time_s: FloatArray, distance_m: FloatArray) -> list[float]:
    """When a distance (n,) is below 10⁻¹, 10⁻², ... of its start for the first time [s].

    Six at most; those that are not reached are left out.
    """
    share = distance_m / distance_m[0]
    reached = (share < 10.0**-n for n in range(1, DECADES + 1))
    return [float(time_s[np.argmax(below)]) for below in reached if below.any()]


def largest_ratio(decade_times_s: list[float]) -> float:
    """A decade's time over that of the one before, at most; infinite unless all are reached."""
    lasted = np.diff(decade_times_s)
    if len(decade_times_s) < DECADES:
        return math.inf
    return float((lasted[1:] / lasted[:-1]).max())
