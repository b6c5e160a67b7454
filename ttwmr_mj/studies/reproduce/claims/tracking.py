"""Claims about what follows what: Figs. 3-8, convergence, effort, gains."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.references.shared.reference import sampled_path
from ttwmr_mj.studies.reproduce.claims.judging import (
    DECADE_SHRINKS,
    EFFORT_RATIO,
    STILL_RAD,
    SWINGS_RAD,
    TRACTOR_ERROR,
    TRAILER_ERROR,
    Judgement,
    claim,
    robot_follows,
    tractor_follows,
    verdict_of,
)
from ttwmr_mj.studies.reproduce.evidence import Evidence, second_half
from ttwmr_mj.studies.reproduce.runs import (
    OMITTED,
    PUBLISHED,
    SPRUNG_OMITTED,
    SPRUNG_PUBLISHED,
    choices,
    on_both,
)

PID = tuple(
    run
    for variant in ("printed-aligned", "constant-aligned", "constant-outward", "exact-aligned")
    for run in on_both(f"pid-{variant}")
)
WITHOUT = on_both("pid-without")
CHOICES = choices()


@claim("fig-3", (*PUBLISHED, *OMITTED))
def _fig_3(evidence: Evidence) -> Judgement:
    return tractor_follows(evidence, PUBLISHED, OMITTED)


@claim("fig-4", (*PUBLISHED, *OMITTED))
def _fig_4(evidence: Evidence) -> Judgement:
    printed = min(evidence.hitch_swing(run) for run in PUBLISHED)
    changed = min(evidence.hitch_swing(run) for run in OMITTED)
    centre = np.mean([np.mean(second_half(evidence.hitch_angle(run))) for run in OMITTED])
    return Judgement(
        verdict_of(printed >= SWINGS_RAD, changed >= SWINGS_RAD),
        {
            "published_hitch_swing_rad": printed,
            "omitted_hitch_swing_rad": changed,
            "omitted_mean_hitch_angle_rad": float(centre),
        },
    )


@claim("fig-6", (*SPRUNG_PUBLISHED, *SPRUNG_OMITTED, "spring-divided-contact"))
def _fig_6(evidence: Evidence) -> Judgement:
    printed = max(evidence.hitch_swing(run) for run in SPRUNG_PUBLISHED)
    changed = max(evidence.hitch_swing(run) for run in (*SPRUNG_OMITTED, "spring-divided-contact"))
    trailer = evidence.worst(SPRUNG_OMITTED, TRAILER_ERROR)
    return Judgement(
        verdict_of(printed <= STILL_RAD, changed <= STILL_RAD),
        {
            "published_hitch_swing_rad": printed,
            "omitted_hitch_swing_rad": changed,
            "omitted_steady_trailer_rmse_m": trailer,
        },
    )


@claim("figs-7-8", (*PID, *CHOICES, *WITHOUT))
def _figs_7_8(evidence: Evidence) -> Judgement:
    printed = [robot_follows(evidence, run) for run in PID]
    changed = [robot_follows(evidence, run) for run in CHOICES]
    best_tractor = min(evidence.value(run, TRACTOR_ERROR) for run in PID)
    best_trailer = min(evidence.value(run, TRAILER_ERROR) for run in CHOICES)
    without = evidence.worst(WITHOUT, TRACTOR_ERROR)
    return Judgement(
        verdict_of(all(printed), any(changed)),
        {
            "published_best_steady_tractor_rmse_m": best_tractor,
            "choices_tried": float(len(CHOICES)),
            "choices_that_work": float(sum(changed)),
            "choices_best_steady_trailer_rmse_m": best_trailer,
            "without_correction_steady_tractor_rmse_m": without,
        },
    )


@claim("finite-time", (), ("continuous",))
def _finite_time(evidence: Evidence) -> Judgement:
    reached = np.array(evidence.study("continuous")["decade_times_s"])
    per_decade = np.diff(reached)
    shrinks = bool((per_decade[1:] <= DECADE_SHRINKS * per_decade[:-1]).all())
    return Judgement(
        verdict_of(False, shrinks),
        {
            "first_decade_s": float(reached[0]),
            "shortest_decade_s": float(per_decade.min()),
            "longest_decade_s": float(per_decade.max()),
        },
    )


@claim("low-effort", ("lab-pid", "lab-pid-without"))
def _low_effort(evidence: Evidence) -> Judgement:
    printed, changed = _effort(evidence, "lab-pid"), _effort(evidence, "lab-pid-without")
    cut = float(second_half(evidence.trajectory("lab-pid").saturated[:, 0]).mean())
    return Judgement(
        verdict_of(printed <= EFFORT_RATIO, changed <= EFFORT_RATIO),
        {
            "published_effort_ratio": printed,
            "published_saturated_share": cut,
            "without_correction_effort_ratio": changed,
        },
    )


def _effort(evidence: Evidence, run: str) -> float:
    """Mean square of the wheels' commands in the second half over that of the reference."""
    scenario, trajectory = evidence.scenario(run), evidence.trajectory(run)
    path = sampled_path(scenario.reference, trajectory.time_s, scenario.robot)
    speed = np.hypot(path.velocity_m_s[:, 0, 0], path.velocity_m_s[:, 0, 1])
    needed = wheels_from_twist(np.stack([speed, path.theta_rate[:, 0, 0]], -1), scenario.robot)
    given = trajectory.wheel_command_rad_s[:, 0]
    return float(np.mean(second_half(given) ** 2) / np.mean(second_half(needed) ** 2))


@claim("higher-gains", ("gains-half", "pid-without-analytic", "gains-double"))
def _gains(evidence: Evidence) -> Judgement:
    base = "pid-without-analytic"
    half, one, double = (
        evidence.value(run, TRACTOR_ERROR) for run in ("gains-half", base, "gains-double")
    )
    return Judgement(
        verdict_of(double < one < half, False),
        {
            "half_steady_tractor_rmse_m": half,
            "table_2_steady_tractor_rmse_m": one,
            "double_steady_tractor_rmse_m": double,
        },
    )


TRACKING_CLAIMS = (_fig_3, _fig_4, _fig_6, _figs_7_8, _finite_time, _low_effort, _gains)
