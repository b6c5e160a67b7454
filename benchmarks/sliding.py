"""Filippov's solutions of laws (32) and (47), seen by ever smaller steps: docs/theory/limits.md.

    python benchmarks/sliding.py

Eq. 31 on the circle of Eq. 37 from Table II's start. Law (32) as printed, cut to what tyres hold:
where P stands after 4 s. Law (47) with |γ| ≤ 10: the share of the time on D = 0 (D changes its
sign at both neighbouring samples), and how much of the push on the trailer that γ is made for is
delivered there and elsewhere.
"""

from __future__ import annotations

import math

import numpy as np

from ttwmr_mj.controllers.lyapunov_pid import LyapunovPidOptions
from ttwmr_mj.studies.reproduce.ideal.loop import IdealLoop, State, sampled
from ttwmr_mj.studies.reproduce.ideal.step_size import GRIP_M_S2, PRINTED

STEPS_S = (1e-3, 1e-4, 1e-5)
CIRCLE = {"radius_m": 1.0, "rate_rad_s": 0.5}
START_M = (0.6, -0.3)
LAW_47 = LyapunovPidOptions(kind="lyapunov_pid", gamma="exact", gamma_limit=10.0)
UNCORRECTED = IdealLoop(LyapunovPidOptions(kind="lyapunov_pid", rho=1e-300), **CIRCLE)


def frozen_m(step_s: float, limit_m_s2: float) -> float:
    """Where law (32) leaves P after 4 s."""
    loop = IdealLoop(PRINTED, **CIRCLE, limit_m_s2=limit_m_s2)
    return float(loop.distances(sampled(loop, loop.at_rest(*START_M), 4.0, step_s))[-1])


def pushes(time_s: float, z: State) -> tuple[float, float, float]:
    """D, the push across the trailer that γ is made for, and the one it gets, of law (47)."""
    answer, plain = IdealLoop(LAW_47, **CIRCLE).command(time_s, z), UNCORRECTED.command(time_s, z)
    sin, cos = math.sin(z[4]), math.cos(z[4])
    free = plain.v2 * cos - plain.v1 * sin
    pid = -LAW_47.k_d * (z[5] - CIRCLE["rate_rad_s"]) - LAW_47.k_p * answer.e5 - LAW_47.k_i * z[6]
    wanted = UNCORRECTED.swing_length_m * pid - free
    return answer.d, wanted, answer.v2 * cos - answer.v1 * sin - free


def sliding(step_s: float) -> tuple[float, float, float]:
    """Share of 1 s on D = 0, and the delivered share of the push there and elsewhere."""
    loop = IdealLoop(LAW_47, **CIRCLE)
    path = sampled(loop, loop.at_rest(*START_M), 1.0, step_s, samples=round(1.0 / step_s))
    rows = np.array([pushes(t, tuple(z)) for t, z in zip(path.time_s, path.z, strict=True)])
    d, wanted, given = rows.T
    turned = np.sign(d[1:]) != np.sign(d[:-1])
    on = np.concatenate([[False], turned[:-1] & turned[1:], [False]])
    there, elsewhere = (float(given[part].sum() / wanted[part].sum()) for part in (on, ~on))
    return float(on.mean()), there, elsewhere


def main() -> None:
    """Print the table."""
    head = ("step", "law (32), cut to 9 m/s²", "not cut", "law (47) on D = 0", "push there")
    print(f"| {' | '.join(head)} | elsewhere |")
    print("|---|---|---|---|---|---|")
    for step_s in STEPS_S:
        cut, free = (1e3 * frozen_m(step_s, limit) for limit in (GRIP_M_S2, math.inf))
        share, there, elsewhere = sliding(step_s)
        print(
            f"| {1e3 * step_s:g} ms | {cut:.1f} mm | {free:.0f} mm | {share:.0%} of the time "
            f"| {there:.0%} | {elsewhere:.0%} |"
        )


if __name__ == "__main__":
    main()
