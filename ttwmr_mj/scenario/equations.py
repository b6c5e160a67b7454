"""From a scenario to a plant made of equations; what cannot be made of it, a check tells."""

from collections import defaultdict
from typing import Any

import numpy as np

from ttwmr_mj.config import rows_of
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.plants.side_by_side import SideBySide
from ttwmr_mj.scenario.schema import Scenario


def plant_of_equations(scenario: Scenario, nsim: int = 1) -> Plant:
    """The plant of a scenario whose plant is analytic, not yet reset.

    Args:
        scenario: the scenario, or those of as many simulations (`config.stacked`).
        nsim: simulations in the batch.

    Raises:
        InputError: it cannot be integrated in these steps.
    """
    if not scenario.control.torque_input and len(scenario.robot.trailers) == 1:
        return _equations(scenario, nsim)
    # how long the kinetic model's steps may be, its robot's numbers say: one plant for each robot;
    # nor do trains take the numbers of several
    rows = rows_of(scenario, nsim)
    who = defaultdict[tuple[Any, ...], list[int]](list)
    for i, row in enumerate(rows):
        who[row.robot, row.ground, row.plant.analytic].append(i)
    parts = [(_equations(rows[i[0]], len(i)), np.array(i)) for i in who.values()]
    return parts[0][0] if len(parts) == 1 else SideBySide(parts)


def _equations(scenario: Scenario, nsim: int) -> Plant:
    options, robot = scenario.plant, scenario.robot
    step_s = scenario.control.sampling_time_s / scenario.steps_per_period
    longest_s = options.analytic.max_step_s
    if scenario.control.torque_input:
        from ttwmr_mj.plants.kinetic import KineticPlant

        return KineticPlant(robot, nsim, step_s, longest_s, scenario.ground)
    if options.analytic.extended is not None:
        from ttwmr_mj.dynamics.extended.train import extended_model
        from ttwmr_mj.plants.extended import ExtendedPlant

        model = extended_model(robot).of(robot, options.analytic.extended, scenario.ground)
        return ExtendedPlant(model, nsim, step_s, longest_s)
    from ttwmr_mj.plants.analytic import AnalyticPlant

    return AnalyticPlant(
        robot,
        nsim,
        step_s,
        longest_s,
        ground=scenario.ground,
        published_spring=options.analytic.published_spring,
    )
