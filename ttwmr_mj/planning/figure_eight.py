"""A figure eight of the last trailer's centre of oscillation, driven round after round.

F shall run along A·sin τ, B·sin 2τ at a steady pace, as nearly as the limits and a bounded jerk
allow. Where an eight changes its bend F'' would vanish and, at a steady pace, θ2 turn by half a
turn in no time; the plan lets F'' pass zero along a trailer that keeps its direction, or swings the
trailer over while F'' is small, whichever is cheaper.
"""

from typing import Any

import casadi as ca
import numpy as np

from ttwmr_mj.planning.transcription import (
    THETA1,
    U1,
    U2,
    Limits,
    Plan,
    X,
    Y,
    last_centre,
    solve,
    state_count,
    trailer_rows,
)
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

HALF_WIDTH_M, HALF_HEIGHT_M = 0.42, 0.24
STEP_S = 0.05
SHAPE_SCALE_M = 0.02  # deviation from the lemniscate that costs as much as the jerk's scale
JERK_SCALE = np.array([1.0, 5.0])  # m/s³, rad/s³


def plan_figure_eight(robot: RobotParameters, limits: Limits, period_s: float) -> Plan:
    """One round, from knot to knot, ending as it began."""
    time_s = np.linspace(0.0, period_s, round(period_s / STEP_S) + 1)
    aim, guess = _lemniscate(time_s, robot)

    def cost(states: Any, jerks: Any) -> Any:
        miss = (last_centre(states, robot) - aim.T) / SHAPE_SCALE_M
        effort = jerks / JERK_SCALE
        return ca.sumsqr(miss[:, :-1]) + ca.sumsqr(effort[:, :-1])

    def ends(problem: Any, states: Any, jerks: Any) -> None:
        problem.subject_to(states[:, -1] == states[:, 0])
        problem.subject_to(jerks[:, -1] == jerks[:, 0])

    return solve(robot, limits, time_s, guess, cost, ends)


def _lemniscate(time_s: FloatArray, robot: RobotParameters) -> tuple[FloatArray, FloatArray]:
    """The wished path of F (n, 2), and a first guess of the states (n, states)."""
    rate = 2.0 * np.pi / time_s[-1]
    tau = rate * time_s
    aim = np.stack([HALF_WIDTH_M * np.sin(tau), HALF_HEIGHT_M * np.sin(2.0 * tau)], axis=-1)
    vx, vy = HALF_WIDTH_M * rate * np.cos(tau), 2.0 * HALF_HEIGHT_M * rate * np.cos(2.0 * tau)
    theta1 = np.unwrap(np.arctan2(vy, vx))
    turn = np.gradient(theta1, time_s)
    guess = np.zeros((time_s.size, state_count(robot)))
    guess[:, [X, Y]] = aim
    guess[:, THETA1] = theta1
    outside = theta1 + 0.5 * np.pi * np.tanh(turn / turn.std())
    for angle, rate in trailer_rows(robot):
        guess[:, angle], guess[:, rate] = outside, np.gradient(outside, time_s)
    guess[:, U1], guess[:, U2] = np.hypot(vx, vy), turn
    return aim, guess
