"""The robot's motion as a nonlinear programme: direct multiple shooting on the hybrid model.

States (9): x, y, θ1, θ2, θ̇2, u1, u2 and their rates u̇1, u̇2, then the angle and rate of every
trailer behind the first; input (2): ü1, ü2, linear between knots. So wheel speeds are twice
continuously differentiable, P three times, and the fourth derivative of P is continuous. Trailers
swing as in `dynamics.train`, which for one is Eq. 24 with 27-28,

    θ̈2 = (u1·u2·cos φ − u̇1·sin φ)/k − (k_t·φ + c_t·φ')/J,      φ = θ2 − θ1.

Classical Runge-Kutta from knot to knot: with knots 50 ms apart, to 1e-6.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from ttwmr_mj.dynamics.train import constants
from ttwmr_mj.errors import RunError
from ttwmr_mj.planning.solver import solved
from ttwmr_mj.references.shared.feasibility import labels_reach_m
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

X, Y, THETA1, THETA2, RATE, U1, U2, A1, A2 = range(9)
FIRST, INPUTS = 9, 2  # states of a tractor with one trailer, inputs


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a plan may use, less than the robot can so that feedback keeps its share.

    Attributes:
        wheel_speed_rad_s, wheel_acceleration_rad_s2: of each wheel.
        lateral_acceleration_m_s2: |u1·u2|, against slip.
        trailer_rate_rad_s: |θ̇2|, of every trailer.
        hitch_angle_rad: |θ2 − θ1|, of every hitch; beyond, the bed meets the deck before it.
        speed_m_s: least and greatest u1.
        workspace_m: width and height of the rectangle about the origin that the robot stays in.
    """

    wheel_speed_rad_s: float
    wheel_acceleration_rad_s2: float
    lateral_acceleration_m_s2: float = 2.0
    trailer_rate_rad_s: float = 3.0
    hitch_angle_rad: float = 2.0
    speed_m_s: tuple[float, float] = (0.0, 1.0)
    workspace_m: tuple[float, float] = (1.4, 1.0)


@dataclass(frozen=True)
class Plan:
    """A solution at its knots."""

    time_s: FloatArray  # (n,)
    state: FloatArray  # (n, states)
    iterations: int  # of the solver


def trailer_rows(robot: RobotParameters) -> list[tuple[int, int]]:
    """Of each trailer, front to back: where its angle and its rate are in a state."""
    behind = range(FIRST, FIRST + 2 * (len(robot.trailers) - 1), 2)
    return [(THETA2, RATE), *((row, row + 1) for row in behind)]


def state_count(robot: RobotParameters) -> int:
    """Numbers of a state."""
    return FIRST + 2 * (len(robot.trailers) - 1)


def hitch_angles(states: Any, robot: RobotParameters) -> list[Any]:
    """θ2 − θ1, θ3 − θ2, … of states (states, n), symbolic or not."""
    rows = [THETA1, *(angle for angle, _ in trailer_rows(robot))]
    return [states[row, :] - states[before, :] for before, row in pairwise(rows)]


def reaches(states: Any, robot: RobotParameters) -> list[tuple[Any, Any]]:
    """(x, y) of what must stay in the workspace: P, the tractor's front, every trailer's rear."""
    ahead_m, behind_m = labels_reach_m(robot)
    x, y = states[X, :], states[Y, :]
    front = states[THETA1, :]
    points = [(x, y), (x + ahead_m * ca.cos(front), y + ahead_m * ca.sin(front))]
    for (row, _), trailer in zip(trailer_rows(robot), robot.trailers, strict=True):
        cos, sin = ca.cos(states[row, :]), ca.sin(states[row, :])
        points.append((x - behind_m * cos, y - behind_m * sin))
        reach = trailer.next_hitch_offset_m or 0.0
        x, y = x - reach * cos, y - reach * sin
    return points


def last_centre(states: Any, robot: RobotParameters) -> Any:
    """(2, n) the last trailer's centre of oscillation, symbolic."""
    x, y = states[X, :], states[Y, :]
    reach = [trailer.next_hitch_offset_m or 0.0 for trailer in robot.trailers[:-1]]
    lengths = [*reach, robot.trailers[-1].swing_length_m]
    for (row, _), length in zip(trailer_rows(robot), lengths, strict=True):
        x, y = x - length * ca.cos(states[row, :]), y - length * ca.sin(states[row, :])
    return ca.vertcat(x, y)


def rate_of(state: Any, jerk: Any, robot: RobotParameters) -> Any:
    """d/dt of the state, symbolic."""
    cos, sin = ca.cos(state[THETA1]), ca.sin(state[THETA1])
    swings = _swings(state, robot)
    return ca.vertcat(
        state[U1] * cos,
        state[U1] * sin,
        state[U2],
        state[RATE],
        swings[0],
        state[A1],
        state[A2],
        jerk[0],
        jerk[1],
        *(
            part
            for (_, rate), swing in zip(trailer_rows(robot)[1:], swings[1:], strict=True)
            for part in (state[rate], swing)
        ),
    )


def _swings(state: Any, robot: RobotParameters) -> list[Any]:
    """θ̈ of every trailer, symbolic: `dynamics.train`, in the tractor's frame."""
    train, rows = constants(robot), trailer_rows(robot)
    n = len(rows)
    torques = [*_hitch_torques(state, robot), 0.0]
    matrix, load = ca.SX(n, n), ca.SX(n, 1)
    for i, (angle, _) in enumerate(rows):
        phi = state[angle] - state[THETA1] - float(train.lean_rad[i])
        push = state[U1] * state[U2] * ca.cos(phi) - state[A1] * ca.sin(phi)
        load[i] = float(train.moment_kg_m[i]) * push + torques[i] - torques[i + 1]
        for j, (other, rate) in enumerate(rows):
            apart = state[angle] - state[other] + float(train.turned_rad[i, j])
            matrix[i, j] = float(train.size_kg_m2[i, j]) * ca.cos(apart)
            if i != j:
                load[i] -= float(train.size_kg_m2[i, j]) * ca.sin(apart) * state[rate] ** 2
    return ca.vertsplit(ca.inv_minor(matrix) @ load)


def _hitch_torques(state: Any, robot: RobotParameters) -> list[Any]:
    """Of every hitch on the trailer behind it."""
    rows, torques = [(THETA1, U2), *trailer_rows(robot)], []
    for hitch, before, behind in zip(robot.hitches, rows[:-1], rows[1:], strict=True):
        torque = -hitch.damping_n_m_s_rad * (state[behind[1]] - state[before[1]])
        if hitch.stiffness_n_m_rad:  # else the angle may turn round and round
            torque -= hitch.stiffness_n_m_rad * (state[behind[0]] - state[before[0]])
        torques.append(torque)
    return torques


def upper_limits(
    states: Any, robot: RobotParameters, limits: Limits
) -> Iterator[tuple[str, Any, float]]:
    """What has a largest size.

    Args:
        states: (states, n), symbolic or numbers of CasADi.
        robot: that moves so.
        limits: of the sizes.

    Yields:
        (group of limits, n values, their largest size).
    """
    for speed in _wheels(states[[U1, U2], :], robot):
        yield "wheel speed", speed, limits.wheel_speed_rad_s
    for change in _wheels(states[[A1, A2], :], robot):
        yield "wheel acceleration", change, limits.wheel_acceleration_rad_s2
    yield "lateral acceleration", states[U1, :] * states[U2, :], limits.lateral_acceleration_m_s2
    for _, rate in trailer_rows(robot):
        yield "trailer's turn rate", states[rate, :], limits.trailer_rate_rad_s
    for angle in hitch_angles(states, robot):
        yield "hitch angle", angle, limits.hitch_angle_rad
    for x, y in reaches(states, robot):
        yield "workspace", x, 0.5 * limits.workspace_m[0]
        yield "workspace", y, 0.5 * limits.workspace_m[1]


def wheels_between(
    states: Any, jerks: Any, steps_s: Any, robot: RobotParameters, limits: Limits
) -> Iterator[tuple[str, Any, float]]:
    """What keeps the wheels within their `upper_limits` from knot to knot, not only there.

    Kept at knots alone, accelerations, which are quadratic in a step, bulge by up to a tenth of
    their limit. A cubic stays among its Bézier points: its ends, and where its slopes there point.

    Args:
        states: (states, n) at knots, symbolic.
        jerks: (2, n) there.
        steps_s: (1, n − 1) from knot to knot.
        robot: that moves so.
        limits: of its wheels.

    Yields:
        (group of limits, n − 1 values, their largest size).
    """
    third = ca.repmat(steps_s, 2, 1) / 3.0
    speed, change = states[[U1, U2], :], states[[A1, A2], :]
    for group, twist, slope, most in (
        ("wheel speed", speed, change, limits.wheel_speed_rad_s),
        ("wheel acceleration", change, jerks, limits.wheel_acceleration_rad_s2),
    ):
        after = twist[:, :-1] + third * slope[:, :-1]
        before = twist[:, 1:] - third * slope[:, 1:]
        for value in (*_wheels(after, robot), *_wheels(before, robot)):
            yield group, value, most


def _wheels(twist: Any, robot: RobotParameters) -> list[Any]:
    """Of u1 and u2, or their rates (2, n): those of both wheels."""
    half, radius = robot.half_track_m, robot.tractor.wheel_radius_m
    return [(twist[0, :] + side * half * twist[1, :]) / radius for side in (1.0, -1.0)]


def knot_to_knot(robot: RobotParameters, rows: int = 1) -> Any:
    """CasADi function (state, jerk at the start, jerk at the end, time step) → next states.

    Returns:
        (next state, (states, rows) at equal steps on the way there, which it is the last of).
    """
    state, first = ca.SX.sym("x", state_count(robot)), ca.SX.sym("j", INPUTS)
    last, step_s = ca.SX.sym("l", INPUTS), ca.SX.sym("h")
    after, part_s = [state], step_s / rows
    for row in range(rows):
        at = after[-1]
        start, middle, end = (
            first + share / rows * (last - first) for share in (row, row + 0.5, row + 1)
        )
        k1 = rate_of(at, start, robot)
        k2 = rate_of(at + 0.5 * part_s * k1, middle, robot)
        k3 = rate_of(at + 0.5 * part_s * k2, middle, robot)
        k4 = rate_of(at + part_s * k3, end, robot)
        after.append(at + part_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
    found = [after[-1], ca.horzcat(*after[1:])]
    return ca.Function("knot_to_knot", [state, first, last, step_s], found)


def with_rows_between(robot: RobotParameters, plan: Plan, jerks: FloatArray, rows: int) -> Plan:
    """The plan with rows between its n knots, where a spline through them would only be near it.

    Args:
        robot: that it is for.
        plan: at knots, which `knot_to_knot` with as many rows leads through.
        jerks: (n, 2) inputs there.
        rows: of each step from knot to knot.
    """
    steps = np.diff(plan.time_s)
    way = knot_to_knot(robot, rows).map(steps.size)
    _, between = way(plan.state[:-1].T, jerks[:-1].T, jerks[1:].T, steps[None])
    time_s = plan.time_s[:-1, None] + steps[:, None] * np.arange(1, rows + 1) / rows
    return Plan(
        np.append(plan.time_s[0], time_s),
        np.vstack([plan.state[:1], np.array(between).T]),
        plan.iterations,
    )


def solve(
    robot: RobotParameters,
    limits: Limits,
    time_s: FloatArray,
    guess: FloatArray,
    cost: Callable[[Any, Any], Any],
    ends: Callable[[Any, Any, Any], None],
) -> Plan:
    """Minimise a cost over all motions within the limits, which are kept at the knots.

    Between knots 50 ms apart the shipped plans exceed them by up to 2.4 %; with `wheels_between`
    the search would end at other motions than those that are shipped.

    Args:
        robot: geometry and hitch.
        limits: bounds.
        time_s: (n,) uniform knots.
        guess: (n, states) first guess of the states.
        cost: of the state and jerk matrices (states, n) and (2, n).
        ends: adds the boundary conditions: (problem, states, jerks).

    Raises:
        RunError: the solver found no solution.
    """
    problem = ca.Opti()
    n = time_s.size
    states, jerks = problem.variable(state_count(robot), n), problem.variable(INPUTS, n)
    step, step_s = knot_to_knot(robot).map(n - 1), float(time_s[1] - time_s[0])
    steps = ca.repmat(step_s, 1, n - 1)
    after, _ = step(states[:, :-1], jerks[:, :-1], jerks[:, 1:], steps)
    problem.subject_to(states[:, 1:] == after)
    for _, value, most in upper_limits(states, robot, limits):
        problem.subject_to(problem.bounded(-most, value, most))
    problem.subject_to(problem.bounded(limits.speed_m_s[0], states[U1, :], limits.speed_m_s[1]))
    ends(problem, states, jerks)
    problem.minimize(cost(states, jerks))
    problem.set_initial(states, guess.T)
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "max_iter": 2000, "tol": 1e-9}
    problem.solver("ipopt", {"print_time": False, "expand": True}, quiet)
    try:
        solution = solved(problem)
    except RuntimeError as error:
        raise RunError(f"the plan was not found: {problem.stats()['return_status']}") from error
    return Plan(time_s, np.array(solution.value(states)).T, int(solution.stats()["iter_count"]))
