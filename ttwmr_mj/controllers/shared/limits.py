"""A wish for wheel speeds, cut to what the servos can do, with the flags of a command."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.base import Command
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S, NEAR_STANDSTILL_M_S
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.sampled import SampledModel
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray


def possible_command(
    wish: FloatArray, setpoint: FloatArray, model: SampledModel, robot: RobotParameters
) -> Command:
    """The command closest to a wish (nsim, 2), from the servos' setpoints (nsim, 2) [rad/s].

    A wish at a limit counts as saturated: who optimises within the limits asks for no more.
    """
    wheels = model.within_limits(setpoint, wish)
    outward = wish + np.copysign(CUT_RAD_S, wish - setpoint)
    cut = np.abs(model.within_limits(setpoint, outward) - outward).max(axis=1) > 0.0
    speed = twist_from_wheels(wheels, robot)[:, 0]
    near_singular = np.asarray(np.abs(speed) < NEAR_STANDSTILL_M_S)
    return Command(wheels, saturated=np.asarray(cut), near_singular=near_singular)
