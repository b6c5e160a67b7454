"""What would make the trailer follow? Dry friction in the hitch, from free to locked.

Behind a tractor on a circle at constant speed, the trailer stands still in the tractor's frame
where the hitch's torque balances the load m2·l·R·ω²·cos φ of Eq. 17 (φ the hitch angle). A free
hitch has none: φ = π/2, radially outward. Dry friction T holds the trailer wherever |cos φ| ≤
T/(m2·l·R·ω²), and above m2·l·R·ω² it holds it straight behind the tractor. A viscous damper has no
torque at rest, so it never does.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ttwmr_mj.references.circle import Circle
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.runs import RUNS, matching

VISCOUS = "friction-viscous"
SWEEP = matching(["friction-[0-9]*-unm", VISCOUS], RUNS)  # aligned on the circle at the start
FROM_START = matching(["friction-start-*"], RUNS)  # Table II's start, beside the circle
BY_CAMERA = matching(["lab-pid-without*"], RUNS)  # the same, by camera
STANDS_RAD = 1e-3  # peak to peak of the hitch angle over the last quarter


@dataclass(frozen=True, slots=True)
class Balance:
    """Where the trailer ends at one friction, and the torques there."""

    run: str  # name of the run
    friction_n_m: float  # the hitch's dry friction
    hitch_angle_rad: float  # mean over the last quarter
    swing_rad: float  # peak to peak over the last quarter
    load_n_m: float  # m2·l·R·ω²·cos φ at that angle: what friction must hold
    trailer_error_m: float  # steady rms error of the COM against straight behind the tractor

    @property
    def stands(self) -> bool:
        """Whether the hitch has come to rest."""
        return self.swing_rad <= STANDS_RAD

    @property
    def balanced(self) -> bool:
        """Whether friction can hold the load; the 2 % are for the end of the swing's ringing."""
        return abs(self.load_n_m) <= 1.02 * self.friction_n_m


def largest_load_n_m(evidence: Evidence) -> float:
    """m2·l·R·ω² of the lab circle: the load straight behind the tractor [N·m]."""
    scenario = evidence.scenario(SWEEP[0])
    circle, trailer = scenario.reference, scenario.robot.trailer
    if not isinstance(circle, Circle):
        raise TypeError(f"{SWEEP[0]} does not drive a circle")
    pull = circle.radius_m * circle.angular_rate_rad_s**2
    return trailer.mass_kg * trailer.com_offset_m * pull


def balances(evidence: Evidence) -> list[Balance]:
    """One row per friction, the viscous hitch last."""
    return [_balance(evidence, run) for run in SWEEP]


def _balance(evidence: Evidence, run: str) -> Balance:
    angle = evidence.hitch_angle(run)
    last = angle[3 * angle.size // 4 :]
    mean = float(last.mean())
    return Balance(
        run=run,
        friction_n_m=evidence.robot(run).hitch.coulomb_friction_n_m,
        hitch_angle_rad=mean,
        swing_rad=float(np.ptp(last)),
        load_n_m=largest_load_n_m(evidence) * float(np.cos(mean)),
        trailer_error_m=evidence.value(run, "steady_trailer_rmse_m"),
    )


def least_n_m(evidence: Evidence, runs: Iterable[str]) -> tuple[float, float]:
    """The friction that brings the trailer within its limit and does so with any more.

    Returns:
        The largest friction of the runs that does not, and the next one; the latter infinite where
        none does.
    """
    friction = {run: evidence.robot(run).hitch.coulomb_friction_n_m for run in runs}
    rising = sorted(friction, key=friction.__getitem__)
    limit = LIMITS["TRAILER_FOLLOWS_M"]
    off = [run for run in rising if evidence.value(run, "steady_trailer_rmse_m") > limit]
    count = rising.index(off[-1]) + 1 if off else 0
    below = friction[rising[count - 1]] if count else 0.0
    return below, friction[rising[count]] if count < len(rising) else math.inf


def numbers(evidence: Evidence) -> dict[str, float]:
    """The sweeps in numbers."""
    *dry, viscous = balances(evidence)
    standing = [row for row in dry if row.stands]
    bands = {
        "": least_n_m(evidence, SWEEP[:-1]),
        "start_": least_n_m(evidence, FROM_START),
        "camera_": least_n_m(evidence, BY_CAMERA),
    }
    return {
        "largest_load_mn_m": 1e3 * largest_load_n_m(evidence),
        "runs_that_stand": len(standing),
        "runs_that_balance": sum(row.balanced for row in standing),
        "viscous_hitch_angle_rad": viscous.hitch_angle_rad,
        **{f"{case}too_little_mn_m": 1e3 * low for case, (low, _) in bands.items()},
        **{f"{case}enough_mn_m": 1e3 * high for case, (_, high) in bands.items()},
    }
