"""A made-up run for the tests of figures."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.references.circle import Circle
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()


def circle_run() -> Trajectory:
    """A run that comes to a circle from 20 mm and 0.1 rad beside it."""
    time_s = 0.033 * np.arange(300)
    circle = Circle(radius_m=0.43, angular_rate_rad_s=0.125, theta2="outward").sample(time_s)
    rows = Trajectory.empty(time_s, 1)
    rows.ref_q[:] = circle.q
    rows.q[:] = circle.q + np.exp(-time_s)[:, None, None] * [0.02, 0.0, -0.1, -1.0]
    rows.est_q[:] = rows.q
    rows.wheel_command_rad_s[:] = 2.35, 1.78
    rows.wheel_speed_rad_s[:] = rows.wheel_command_rad_s * (1 - np.exp(-5 * time_s))[:, None, None]
    return rows
