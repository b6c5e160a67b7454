"""From rest to rest: tractor and trailers at rest and aligned, at the start and at the end."""

from typing import Any

import casadi as ca
import numpy as np

from ttwmr_mj.planning.transcription import (
    A1,
    A2,
    THETA1,
    U1,
    U2,
    Limits,
    Plan,
    X,
    Y,
    solve,
    state_count,
    trailer_rows,
)
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

STEP_S = 0.05
JERK_SCALE = np.array([1.0, 5.0])  # m/s³, rad/s³

START_S, BRAKE_S = 1.0, 0.8  # in which P may be slower than the cruise

Pose = tuple[float, float, float]  # x [m], y [m], all angles [rad]


def plan_rest_to_rest(
    robot: RobotParameters,
    limits: Limits,
    start: Pose,
    goal: Pose,
    duration_s: float,
    cruise_m_s: float,
) -> Plan:
    """The smoothest way from pose to pose in a given time.

    Between start-up and braking P keeps at least `cruise_m_s`: a robot that hardly moves cannot
    correct its trailer, and errors of the way would be frozen into the end.
    """
    time_s = np.linspace(0.0, duration_s, round(duration_s / STEP_S) + 1)

    def cost(states: Any, jerks: Any) -> Any:
        del states
        return ca.sumsqr(jerks / JERK_SCALE)

    def ends(problem: Any, states: Any, jerks: Any) -> None:
        for column, (x, y, theta) in ((0, start), (-1, goal)):
            problem.subject_to(states[:3, column] == ca.DM([x, y, theta]))
            for angle, rate in trailer_rows(robot):
                problem.subject_to(states[[angle, rate], column] == ca.DM([theta, 0.0]))
            problem.subject_to(states[[U1, U2, A1, A2], column] == 0.0)
            problem.subject_to(jerks[:, column] == 0.0)
        starting, braking = round(START_S / STEP_S), round(BRAKE_S / STEP_S)
        problem.subject_to(states[U1, starting:-braking] >= cruise_m_s)

    return solve(robot, limits, time_s, _guess(time_s, robot, start, goal), cost, ends)


def _guess(time_s: FloatArray, robot: RobotParameters, start: Pose, goal: Pose) -> FloatArray:
    """(n, states) a cubic from pose to pose at a bell-shaped pace, all in line."""
    s = time_s / time_s[-1]
    pace = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    (x0, y0, theta0), (x1, y1, theta1) = start, goal
    size = np.hypot(x1 - x0, y1 - y0)
    h00, h10 = 2 * pace**3 - 3 * pace**2 + 1, pace**3 - 2 * pace**2 + pace
    h01, h11 = 1 - h00, pace**3 - pace**2
    x = h00 * x0 + h10 * size * np.cos(theta0) + h01 * x1 + h11 * size * np.cos(theta1)
    y = h00 * y0 + h10 * size * np.sin(theta0) + h01 * y1 + h11 * size * np.sin(theta1)
    theta = theta0 + (theta1 - theta0) * pace
    guess = np.zeros((time_s.size, state_count(robot)))
    guess[:, X], guess[:, Y], guess[:, THETA1] = x, y, theta
    guess[:, U1] = np.hypot(np.gradient(x, time_s), np.gradient(y, time_s))
    guess[:, U2] = np.gradient(theta, time_s)
    for angle, rate in trailer_rows(robot):
        guess[:, angle], guess[:, rate] = theta, guess[:, U2]
    return guess
