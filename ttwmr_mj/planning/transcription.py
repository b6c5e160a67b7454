"""The robot's motion as a nonlinear programme: direct multiple shooting on the hybrid model.

States (9): x, y, θ1, θ2, θ̇2, u1, u2 and their rates u̇1, u̇2; input (2): ü1, ü2, linear between
knots. So wheel speeds are twice continuously differentiable, P three times, and the fourth
derivative of P is continuous. The trailer swings by Eq. 24 and 27-28,

    θ̈2 = (u1·u2·cos φ − u̇1·sin φ)/k − (k_t·φ + c_t·φ')/J,      φ = θ2 − θ1.

Classical Runge-Kutta from knot to knot: with knots 50 ms apart, to 1e-6.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ttwmr_mj.errors import RunError
from ttwmr_mj.references.shared.feasibility import FRONT_LABEL_M, REAR_LABEL_M
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

X, Y, THETA1, THETA2, RATE, U1, U2, A1, A2 = range(9)
STATES, INPUTS = 9, 2


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a plan may use, less than the robot can so that feedback keeps its share.

    Attributes:
        wheel_speed_rad_s, wheel_acceleration_rad_s2: of each wheel.
        lateral_acceleration_m_s2: |u1·u2|, against slip.
        trailer_rate_rad_s: |θ̇2|.
        hitch_angle_rad: |θ2 − θ1|; beyond, the trailer's bed meets the tractor's deck.
        speed_m_s: least and greatest u1.
        workspace_m: width and height of the rectangle about the origin that the robot stays in.
        ahead_m, behind_m: reach of the tractor ahead of P and of the trailer behind it.
    """

    wheel_speed_rad_s: float
    wheel_acceleration_rad_s2: float
    lateral_acceleration_m_s2: float = 2.0
    trailer_rate_rad_s: float = 3.0
    hitch_angle_rad: float = 2.0
    speed_m_s: tuple[float, float] = (0.0, 1.0)
    workspace_m: tuple[float, float] = (1.4, 1.0)
    ahead_m: float = FRONT_LABEL_M
    behind_m: float = REAR_LABEL_M


@dataclass(frozen=True)
class Plan:
    """A solution at its knots."""

    time_s: FloatArray  # (n,)
    state: FloatArray  # (n, 9)
    iterations: int  # of the solver


def rate_of(state: Any, jerk: Any, robot: RobotParameters) -> Any:
    """d/dt of the state, symbolic."""
    phi = state[THETA2] - state[THETA1]
    hitch = robot.hitch
    torque = hitch.damping_n_m_s_rad * (state[RATE] - state[U2])
    if hitch.stiffness_n_m_rad:  # else φ may turn round and round
        torque = torque + hitch.stiffness_n_m_rad * phi
    swing = state[U1] * state[U2] * ca.cos(phi) - state[A1] * ca.sin(phi)
    return ca.vertcat(
        state[U1] * ca.cos(state[THETA1]),
        state[U1] * ca.sin(state[THETA1]),
        state[U2],
        state[RATE],
        swing / robot.swing_length_m - torque / robot.swing_inertia_kg_m2,
        state[A1],
        state[A2],
        jerk[0],
        jerk[1],
    )


def knot_to_knot(robot: RobotParameters) -> Any:
    """CasADi function (state, jerk at the start, jerk at the end, time step) → next state."""
    state, first, last = ca.MX.sym("x", STATES), ca.MX.sym("j", INPUTS), ca.MX.sym("l", INPUTS)
    step_s = ca.MX.sym("h")
    middle = 0.5 * (first + last)
    k1 = rate_of(state, first, robot)
    k2 = rate_of(state + 0.5 * step_s * k1, middle, robot)
    k3 = rate_of(state + 0.5 * step_s * k2, middle, robot)
    k4 = rate_of(state + step_s * k3, last, robot)
    after = state + step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return ca.Function("knot_to_knot", [state, first, last, step_s], [after])


def solve(
    robot: RobotParameters,
    limits: Limits,
    time_s: FloatArray,
    guess: FloatArray,
    cost: Callable[[Any, Any], Any],
    ends: Callable[[Any, Any, Any], None],
) -> Plan:
    """Minimise a cost over all motions within the limits.

    Args:
        robot: geometry and hitch.
        limits: bounds.
        time_s: (n,) uniform knots.
        guess: (n, 9) first guess of the states.
        cost: of the state and jerk matrices (9, n) and (2, n).
        ends: adds the boundary conditions: (problem, states, jerks).

    Raises:
        RunError: the solver found no solution.
    """
    problem = ca.Opti()
    n = time_s.size
    states, jerks = problem.variable(STATES, n), problem.variable(INPUTS, n)
    step, step_s = knot_to_knot(robot).map(n - 1), float(time_s[1] - time_s[0])
    steps = ca.repmat(step_s, 1, n - 1)
    problem.subject_to(states[:, 1:] == step(states[:, :-1], jerks[:, :-1], jerks[:, 1:], steps))
    _bound(problem, states, robot, limits)
    ends(problem, states, jerks)
    problem.minimize(cost(states, jerks))
    problem.set_initial(states, guess.T)
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "max_iter": 2000, "tol": 1e-9}
    problem.solver("ipopt", {"print_time": False}, quiet)
    try:
        solution = problem.solve()
    except RuntimeError as error:
        raise RunError(f"the plan was not found: {problem.stats()['return_status']}") from error
    return Plan(time_s, np.array(solution.value(states)).T, int(solution.stats()["iter_count"]))


def _bound(problem: Any, states: Any, robot: RobotParameters, limits: Limits) -> None:
    half, radius = robot.half_track_m, robot.tractor.wheel_radius_m
    for side in (1.0, -1.0):
        speed = (states[U1, :] + side * half * states[U2, :]) / radius
        change = (states[A1, :] + side * half * states[A2, :]) / radius
        _within(problem, speed, limits.wheel_speed_rad_s)
        _within(problem, change, limits.wheel_acceleration_rad_s2)
    _within(problem, states[U1, :] * states[U2, :], limits.lateral_acceleration_m_s2)
    _within(problem, states[RATE, :], limits.trailer_rate_rad_s)
    _within(problem, states[THETA2, :] - states[THETA1, :], limits.hitch_angle_rad)
    problem.subject_to(problem.bounded(limits.speed_m_s[0], states[U1, :], limits.speed_m_s[1]))
    for angle, reach in ((THETA1, limits.ahead_m), (THETA2, -limits.behind_m), (X, 0.0)):
        _within(
            problem, states[X, :] + reach * ca.cos(states[angle, :]), 0.5 * limits.workspace_m[0]
        )
        _within(
            problem, states[Y, :] + reach * ca.sin(states[angle, :]), 0.5 * limits.workspace_m[1]
        )


def _within(problem: Any, value: Any, bound: float) -> None:
    problem.subject_to(problem.bounded(-bound, value, bound))
