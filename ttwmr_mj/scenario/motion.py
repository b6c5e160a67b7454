"""The motion that a scenario asks for, sampled at its control periods, and where it starts."""

import numpy as np

from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.influence import DRY, influence_of
from ttwmr_mj.errors import InputError
from ttwmr_mj.references.shared.carried import carried
from ttwmr_mj.references.shared.hitched import has_spring
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import reference_faults, sampled
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.schema import AtRest, Scenario
from ttwmr_mj.state import RobotState


def sample_reference(scenario: Scenario) -> ReferencePath | None:
    """The reference at every control sample of the run and a little beyond; None without one.

    It is what the run is judged by: that of the robot that is driven, on the floor there is. A plan
    is for the robot that it was made for.

    Raises:
        InputError: the robot cannot have this reference.
    """
    strange = bool(reference_faults(scenario.reference, scenario.robot))
    robot = scenario.believed_robot if strange else scenario.robot
    return _sampled(scenario, robot, scenario.ground)


def believed_reference(scenario: Scenario) -> ReferencePath | None:
    """The same as the controller is told it: of the robot and the floor that are believed in.

    Raises:
        InputError: that robot cannot have this reference.
    """
    return _sampled(scenario, scenario.believed_robot, scenario.believed_ground)


def initial_state(scenario: Scenario, reference: ReferencePath | None, nsim: int = 1) -> RobotState:
    """Where every simulation starts."""
    start = scenario.initial
    more = len(scenario.robot.trailers) - 1
    if isinstance(start, AtRest):
        behind = start.more_trailers_rad or (start.theta2_rad,) * more
        theta = start.theta2_rad, *behind
        return RobotState.at_rest(start.x_m, start.y_m, start.theta1_rad, theta, nsim)
    if reference is None:
        raise AssertionError("the loader refuses on_reference without a reference")
    q, rate = reference.q[0, 0].copy(), reference.q_rate[0, 0].copy()
    if np.isnan(q[3]):
        q[3:], rate[3:] = q[2], rate[2]
    q[:4] += [start.x_offset_m, start.y_offset_m, start.theta1_offset_rad, start.theta2_offset_rad]
    q[4:] += start.more_trailers_offset_rad or 0.0
    # P moves along the heading that the tractor has: wheels do not start sliding sideways
    c, s = np.cos(start.theta1_offset_rad), np.sin(start.theta1_offset_rad)
    rate[:2] = c * rate[0] - s * rate[1], s * rate[0] + c * rate[1]
    return RobotState(q=np.tile(q, (nsim, 1)), q_rate=np.tile(rate, (nsim, 1)))


def _sampled(scenario: Scenario, robot: RobotParameters, ground: Ground) -> ReferencePath | None:
    faults = reference_faults(scenario.reference, robot)
    if faults:
        raise InputError(*(fault.within("reference") for fault in faults))
    times = scenario.control.sampling_time_s * np.arange(scenario.samples, dtype=np.float64)
    path = sampled(scenario.reference, times, robot)
    influence = influence_of(robot, ground)
    # of dry friction in the hitch nothing is made, nor of what acts on several trailers
    acts = bool(influence[:DRY].any()) or has_spring(robot)
    if path is None or not acts or len(robot.trailers) > 1:
        return path
    return carried(path, robot, influence)
