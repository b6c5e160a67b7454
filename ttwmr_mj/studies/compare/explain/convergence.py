"""Does contact physics converge to the ideal model as its parameters do, and how fast?

At level j the step, the contacts' time constant, the balls' mass and the inverse of the servo's
gain are those of the scenario divided by 2^j. Hitch and wheel shape stay, and so does the servo
where the analytic model is driven by the wheels' actual speeds, as it has no part in the deviation
then. The order p says how the deviation falls, as (step)^p; what is left at a level is about
(deviation of the level before)/2^p.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.explain.deviations import deviation_under
from ttwmr_mj.studies.compare.explain.effects import IDEAL_STALL_TORQUE_N_M
from ttwmr_mj.studies.compare.variants import Progress, changed, in_threads

LEVELS = 4  # 1, 1/2, 1/4, 1/8: the finest takes half of the time


@dataclass(frozen=True, slots=True)
class Convergence:
    """A convergence study, of P and of every angle.

    An order is p of a least-squares line through the logarithms; None if a deviation is zero or
    undefined.
    """

    timestep_s: FloatArray  # (levels,) the coarsest first
    deviations: dict[str, FloatArray]  # (levels,)
    orders: dict[str, float | None]

    def as_json(self) -> dict[str, Any]:
        """Plain data with the unit in the keys."""
        columns = {
            name: [value if math.isfinite(value) else None for value in values.tolist()]
            for name, values in self.deviations.items()
        }
        return {"timestep_s": self.timestep_s.tolist(), **columns, "order": self.orders}


def refined(scenario: Scenario, level: int, *, servo: bool = True) -> Scenario:
    """The scenario 2^level times closer to the ideal; at level 0 its servo just cannot saturate.

    Without `servo` the servo stays as it is, and level 0 is the scenario itself.
    """
    factor = 2.0**level
    contact, robot = scenario.plant.contact, scenario.robot
    values: dict[str, Any] = {
        "plant.contact.timestep_s": contact.timestep_s / factor,
        "plant.contact.contact_time_constant_s": contact.contact_time_constant_s / factor,
        "robot.casters.mass_kg": robot.casters.mass_kg / factor,
    }
    ideal_servo = {
        "robot.servo.velocity_gain_n_m_s_rad": robot.servo.velocity_gain_n_m_s_rad * factor,
        "robot.servo.stall_torque_n_m": IDEAL_STALL_TORQUE_N_M,
        "robot.servo.motor": None,
    }
    return changed(scenario, values | ideal_servo if servo else values)


def converge(
    scenario: Scenario,
    commands: FloatArray,
    progress: Progress | None = None,
    levels: int = LEVELS,
    *,
    real_wheels: bool = False,
) -> Convergence:
    """Run every level, two at least, from the scenario on under one command history.

    Args:
        scenario: the coarsest level.
        commands: wheel speeds (n, 2) (right, left), one per control period [rad/s].
        progress: called with the share of the work done.
        levels: how many.
        real_wheels: drive the analytic model with each level's actual wheel speeds.
    """
    variants = [refined(scenario, level, servo=not real_wheels) for level in range(levels)]
    deviation = deviation_under(commands, real_wheels=real_wheels)
    found = [apart.numbers() for apart in in_threads(deviation, variants, progress)]
    steps = np.array([variant.plant.contact.timestep_s for variant in variants])
    angles = (f"theta{i + 1}_deviation_max_rad" for i in range(len(scenario.robot.trailers) + 1))
    measures = ("position_deviation_max_m", "position_deviation_per_path", *angles)
    deviations = {name: np.array([row[name] for row in found], np.float64) for name in measures}
    orders = {name: _order(steps, values) for name, values in deviations.items()}
    return Convergence(steps, deviations, orders)


def _order(steps: FloatArray, values: FloatArray) -> float | None:
    """Slope of log(value) over log(step)."""
    if not (values > 0.0).all():  # nor where one is undefined
        return None
    return float(np.polyfit(np.log(steps), np.log(values), 1)[0])
