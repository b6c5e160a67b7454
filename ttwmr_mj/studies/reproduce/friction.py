"""What would make the trailer follow? Dry friction in the hitch, from free to locked.

Behind a tractor on a circle at constant speed, the trailer stands still in the tractor's frame
where the hitch's torque balances the load m2·l·R·ω²·cos φ of Eq. 17 (φ the hitch angle). A free
hitch has none: φ = π/2, radially outward. Dry friction T holds the trailer wherever |cos φ| ≤
T/(m2·l·R·ω²), and above m2·l·R·ω² it holds it straight behind the tractor. A viscous damper has no
torque at rest, so it never does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.references.circle import Circle
from ttwmr_mj.studies.reproduce.claims.judging import TRAILER_FOLLOWS_M, mm
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.runs import SWEEP_FRICTION_N_M, friction_run

VISCOUS = "friction-viscous"
SWEEP = (*(friction_run(friction) for friction in SWEEP_FRICTION_N_M), VISCOUS)
STANDS_RAD = 1e-3  # peak to peak of the hitch angle over the last quarter


@dataclass(frozen=True, slots=True)
class Balance:
    """Where the trailer ends at one friction, and the torques there.

    Attributes:
        run: name of the run.
        friction_n_m: the hitch's dry friction.
        hitch_angle_rad: mean over the last quarter.
        swing_rad: peak to peak over the last quarter.
        load_n_m: m2·l·R·ω²·cos φ at that angle: what friction must hold.
        trailer_error_m: steady rms error of the COM against straight behind the tractor.
    """

    run: str
    friction_n_m: float
    hitch_angle_rad: float
    swing_rad: float
    load_n_m: float
    trailer_error_m: float

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


def found(evidence: Evidence) -> str:
    """The sweep in words."""
    rows = balances(evidence)
    load = largest_load_n_m(evidence)
    dry = [row for row in rows if row.run != VISCOUS]
    follows = min(r.friction_n_m for r in dry if r.trailer_error_m <= TRAILER_FOLLOWS_M)
    viscous = rows[-1]
    standing = [row for row in dry if row.stands]
    kept = sum(row.balanced for row in standing)
    return (
        f"The load of a trailer straight behind the tractor is m2·l·R·ω² = {1e3 * load:.3f} mN·m. "
        f"From {1e3 * follows:.2f} mN·m on, friction holds it there, to {mm(TRAILER_FOLLOWS_M)} "
        f"and better; below, the trailer turns outward and stops where |cos φ| ≤ T/(m2·l·R·ω²): "
        f"so in {kept} of {len(standing)} runs that came to rest. Viscous friction of 1e-3 N·m·s "
        f"alone leaves it at {viscous.hitch_angle_rad:.2f} rad. Friction of a third of a "
        "milli-newton-metre is little for a real hinge, so it can explain a laboratory trailer "
        "that follows, without any control of θ2. It cannot explain the simulations, nor a tractor "
        "that follows under law (70); whether it is what happened, only the hitch could tell."
    )
