"""The wheel servo's speed governor: how a commanded speed becomes a ramp the motor can follow."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.robot import Servo
from ttwmr_mj.state import FloatArray


def limit_speed(command_rad_s: FloatArray, servo: Servo) -> FloatArray:
    """The command clipped to the servo's speed range, any shape [rad/s]."""
    limit = servo.speed_limit_rad_s
    return np.minimum(np.maximum(command_rad_s, -limit), limit)


def ramp(
    start_rad_s: FloatArray, command_rad_s: FloatArray, servo: Servo, time_s: FloatArray
) -> FloatArray:
    """The speed setpoint at times after a new command, moving at the acceleration limit.

    Args:
        start_rad_s: (nsim, 2) setpoint when the command arrives.
        command_rad_s: (nsim, 2) commanded speed; clipped to the servo's range.
        servo: limits.
        time_s: (n,) times since the command.

    Returns:
        (nsim, n, 2) setpoints [rad/s].
    """
    change = (limit_speed(command_rad_s, servo) - start_rad_s)[:, None, :]
    reach = (servo.acceleration_limit_rad_s2 * time_s)[:, None]
    return start_rad_s[:, None, :] + np.minimum(np.maximum(change, -reach), reach)
