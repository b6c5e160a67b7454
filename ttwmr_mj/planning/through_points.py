"""From points to a motion of tractor and trailers: P passes through all of them, in order.

From rest to rest, aligned at both ends, or round and round. Between the points the way is free, and
so is how the time is shared among the legs; what is minimised is the jerk, in units that grow with
the pace, so that the way does not depend on it. Limits give way at a price (`elastic`): a plan
always comes out, and if it exceeds a limit it is refused, with the limit and where.

A free trailer takes the same way at any pace. Where no duration is asked for, more time than the
mean pace takes has a price too, far below that of a limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline

from ttwmr_mj.errors import InputError, RunError
from ttwmr_mj.planning.elastic import Elastic, Exceeded
from ttwmr_mj.planning.knots import driven
from ttwmr_mj.planning.limits import DURATIONS_S, HITCH_ANGLES_DEG
from ttwmr_mj.planning.request import Request
from ttwmr_mj.planning.solver import solved
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
    knot_to_knot,
    state_count,
    trailer_rows,
    upper_limits,
    wheels_between,
    with_rows_between,
)
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

CRUISE = 0.6  # of the wheels' speed: a mean pace that leaves room for bends
LEAST_SPEED = 0.25  # of the mean; a robot that hardly moves cannot correct its trailer
LEG_SHARE = (0.4, 2.5)  # of a leg's time, to what its length takes at the mean pace
ENDS = 1.6  # the same of the first and last leg of a way from rest to rest
JERK_SCALE = np.array([1.0, 5.0])  # m/s³, rad/s³, at PACE_M_S
PACE_M_S = 0.1
MOST_TIME, TIME_PRICE = 4.0, 30.0  # of the time at the mean pace; of as much again
ROOM = 1.1  # of advice: nearer to a limit the same price buys less
# of a plan in each step of its problem: a spline through knots alone exceeds what its wheels keep
# by 2 %, and one through two rows asks a train's hitches for torques
ROWS, ROWS_OF_A_TRAIN = 2, 3
BETWEEN = 0.01  # of a limit, that a plan may exceed it by between knots, where it is told
MOST_ITERATIONS, MOST_S = 400, 120.0
# how a duration answers for a limit: speeds fall with it, accelerations with its square
BY_TIME = {
    "wheel speed": 1.0,
    "trailer's turn rate": 1.0,
    "wheel acceleration": 0.5,
    "lateral acceleration": 0.5,
}
UNITS = {
    "wheel speed": "rad/s",
    "wheel acceleration": "rad/s²",
    "lateral acceleration": "m/s²",
    "trailer's turn rate": "rad/s",
    "hitch angle": "rad",
    "workspace": "m from its centre",
    "least speed": "m/s",
}


@dataclass(frozen=True, slots=True)
class Found:
    """A plan that keeps its limits."""

    plan: Plan
    knots_s: FloatArray  # (n,) of the problem that was solved; the plan has more rows
    points_s: FloatArray  # (m,) when P is at each point
    used: dict[str, float]  # group of limits → the largest share that driving it uses


def plan_through(
    request: Request,
    robot: RobotParameters,
    limits: Limits,
    progress: Callable[[int], None] | None = None,
    most_s: float = MOST_S,
) -> Found:
    """Plan.

    Args:
        request: the way.
        robot: that drives it.
        limits: that the plan keeps.
        progress: is called with the number of iterations made.
        most_s: CPU time of the solver's iterations, after which it gives up.

    Raises:
        InputError: there is no way through these points.
        RunError: no plan was found; says which limit stands in the way, where, and what would do.
    """
    if faults := request.faults(robot, limits):
        raise InputError(*faults)
    pace = CRUISE * limits.wheel_speed_rad_s * robot.tractor.wheel_radius_m
    duration = request.duration_s or float(request.legs_m.sum()) / pace
    guess = _guess(request, robot, duration)
    found, exceeded = _solve(request, robot, limits, guess, progress, most_s)
    if exceeded:
        raise RunError(_refusal(exceeded, found, request))
    return found


@dataclass(frozen=True, slots=True)
class _Guess:
    """Where a search begins."""

    knots: tuple[int, ...]  # of each leg
    legs_s: FloatArray  # (legs,) times
    state: FloatArray  # (n, states)

    @property
    def duration_s(self) -> float:
        return float(self.legs_s.sum())

    @property
    def time_s(self) -> FloatArray:
        """(n,)."""
        steps = np.repeat(self.legs_s / self.knots, self.knots)
        return np.concatenate([[0.0], np.cumsum(steps)])


def _guess(request: Request, robot: RobotParameters, duration_s: float) -> _Guess:
    """A spline through the points, with the trailer outside of every bend."""
    knots, weight = request.knots(robot), request.legs_m
    if not request.closed:
        weight[[0, -1]] *= ENDS
    times = duration_s * weight / weight.sum()
    blank = _Guess(knots, times, np.zeros((sum(knots) + 1, state_count(robot))))
    time_s = blank.time_s
    at = np.concatenate([[0.0], np.cumsum(times)])
    ends = "periodic" if request.closed else ((1, np.zeros(2)), (1, np.zeros(2)))
    spline = CubicSpline(at, request.corners_m, bc_type=ends)
    (vx, vy), state = spline(time_s, 1).T, blank.state
    theta1 = np.unwrap(np.arctan2(vy, vx))
    if not request.closed:  # at rest there is no direction
        theta1[0], theta1[-1] = theta1[1], theta1[-2]
    turn = np.gradient(theta1, time_s)
    state[:, [X, Y]], state[:, THETA1] = spline(time_s), theta1
    outside = theta1 + 0.5 * np.pi * np.tanh(turn / (turn.std() + 1e-9))
    for angle, rate in trailer_rows(robot):
        state[:, angle], state[:, rate] = outside, np.gradient(outside, time_s)
    state[:, U1], state[:, U2] = np.hypot(vx, vy), turn
    return blank


def _solve(
    request: Request,
    robot: RobotParameters,
    limits: Limits,
    guess: _Guess,
    progress: Callable[[int], None] | None,
    most_s: float,
) -> tuple[Found, list[Exceeded]]:
    """What is found, and which limits gave way."""
    problem, n = ca.Opti(), sum(guess.knots) + 1
    states, jerks = problem.variable(state_count(robot), n), problem.variable(2, n)
    legs_s = problem.variable(1, len(guess.knots))
    steps = ca.horzcat(
        *(ca.repmat(legs_s[0, i] / count, 1, count) for i, count in enumerate(guess.knots))
    )
    step = knot_to_knot(robot, _rows(robot)).map(n - 1)
    after, _ = step(states[:, :-1], jerks[:, :-1], jerks[:, 1:], steps)
    problem.subject_to(states[:, 1:] == after)
    # a number of its own: the cost, which holds it, would else tie every leg to every knot, and
    # sixty points would take half a minute before the search begins
    longer = problem.variable()
    problem.subject_to(ca.sum2(legs_s) == longer * guess.duration_s)
    if request.duration_s is None:
        problem.subject_to(problem.bounded(1.0, longer, MOST_TIME))
    else:
        problem.subject_to(longer == 1.0)
    nominal = guess.legs_s[None]
    problem.subject_to(LEG_SHARE[0] * longer * nominal <= legs_s)
    problem.subject_to(legs_s <= LEG_SHARE[1] * longer * nominal)
    at = np.concatenate([[0], np.cumsum(guess.knots)])[: len(request.points_m)]
    for knot, point in zip(at, request.points_m, strict=True):
        problem.subject_to(states[:2, int(knot)] == point)
    if request.closed:
        _close(problem, states, jerks, guess, robot)
    else:
        _rest(problem, states, jerks, robot)
    elastic = Elastic(problem)
    mean = float(request.legs_m.sum()) / guess.duration_s
    for group, value, most in (
        *upper_limits(states, robot, limits),
        *wheels_between(states, jerks, steps, robot, limits),
    ):
        elastic.within(group, value, most)
    elastic.at_least("least speed", states[U1, _moving(request, guess)], LEAST_SPEED * mean)
    scale = JERK_SCALE * (mean / PACE_M_S) ** 3
    rough = 100.0 / n * ca.sumsqr(jerks / scale) * longer**6
    problem.minimize(rough + TIME_PRICE * (longer - 1.0) + elastic.cost)
    problem.set_initial(states, guess.state.T)
    problem.set_initial(legs_s, nominal)
    problem.set_initial(longer, 1.0)
    solution = _searched(problem, progress, most_s)
    value_of = solution.value
    took = np.atleast_1d(np.asarray(value_of(legs_s), dtype=np.float64))
    time_s = replace(guess, legs_s=took).time_s
    knots = Plan(time_s, np.array(value_of(states)).T, int(solution.stats()["iter_count"]))
    plan = with_rows_between(robot, knots, np.array(value_of(jerks)).T, _rows(robot))
    uses = _uses(plan, time_s, robot, limits)
    found = Found(plan, time_s, time_s[at], {one.group: 1.0 + one.share for one in uses})
    over = [one for one in uses if one.share > BETWEEN]
    return found, elastic.exceeded(value_of) or over


def _searched(problem: Any, progress: Callable[[int], None] | None, most_s: float) -> Any:
    """The solution."""
    if progress is not None:
        problem.callback(progress)
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "tol": 1e-7}
    quiet |= {"max_iter": MOST_ITERATIONS, "max_cpu_time": most_s}
    problem.solver("ipopt", {"print_time": False}, quiet)
    try:
        return solved(problem)
    except RuntimeError as error:
        raise RunError(_none_found(problem.stats()["return_status"], most_s)) from error


def _uses(
    plan: Plan, knots_s: FloatArray, robot: RobotParameters, limits: Limits
) -> list[Exceeded]:
    """By how much driving the plan exceeds each limit, the most first; what is left is below 0."""
    fine, uses = driven(plan, robot), dict[str, Exceeded]()
    for group, value, most in upper_limits(ca.DM(fine.state.T), robot, limits):
        shares = np.abs(np.array(value)).ravel() / most - 1.0
        worst = int(shares.argmax())
        knot = int(np.searchsorted(knots_s, fine.time_s[worst]))
        if group not in uses or shares[worst] > uses[group].share:
            uses[group] = Exceeded(group, float(shares[worst]), most, knot)
    return sorted(uses.values(), key=lambda one: -one.share)


def _rows(robot: RobotParameters) -> int:
    """Of the plan, from knot to knot."""
    return ROWS_OF_A_TRAIN if len(robot.trailers) > 1 else ROWS


def _close(problem: Any, states: Any, jerks: Any, guess: _Guess, robot: RobotParameters) -> None:
    """It ends as it began, but for whole turns."""
    turns = round(float(guess.state[-1, THETA1] - guess.state[0, THETA1]) / (2.0 * np.pi))
    round_trip = np.zeros(state_count(robot))
    round_trip[[THETA1, *(angle for angle, _ in trailer_rows(robot))]] = 2.0 * np.pi * turns
    problem.subject_to(states[:, -1] == states[:, 0] + round_trip)
    problem.subject_to(jerks[:, -1] == jerks[:, 0])


def _rest(problem: Any, states: Any, jerks: Any, robot: RobotParameters) -> None:
    """At rest at both ends, the trailers in line behind the tractor."""
    for column in (0, -1):
        for angle, rate in trailer_rows(robot):
            problem.subject_to(states[angle, column] == states[THETA1, column])
            problem.subject_to(states[rate, column] == 0.0)
        problem.subject_to(states[[U1, U2, A1, A2], column] == 0.0)
        problem.subject_to(jerks[:, column] == 0.0)


def _moving(request: Request, guess: _Guess) -> slice:
    """The knots at which P keeps a least speed."""
    if request.closed:
        return slice(None)
    first, last = guess.knots[0], guess.knots[-1]
    return slice(first // 2, sum(guess.knots) + 1 - last // 2)


def _none_found(status: str, most_s: float) -> str:
    """What the solver says when it gives up, and what would help."""
    if status == "Maximum_CpuTime_Exceeded":
        return (
            f"no plan was found within {most_s:.4g} s of computing; try fewer points, a shorter "
            "way, gentler turns or a larger --hitch-angle"
        )
    return (
        f"no plan was found ({status}); try points that are further apart, gentler turns or "
        "more time (--duration)"
    )


def _refusal(exceeded: list[Exceeded], found: Found, request: Request) -> str:
    """Which limits stand in the way, where, and what would do."""
    lines = ["no plan keeps all limits:"]
    for one in exceeded:
        time_s = float(found.knots_s[min(one.knot, len(found.knots_s) - 1)])
        after = int(np.searchsorted(found.points_s, time_s, side="right"))
        following = after % len(request.points_m) + 1
        what = "less than" if one.group == "least speed" else "more than"
        share = (1.0 - one.share) if one.group == "least speed" else (1.0 + one.share)
        lines.append(
            f"  {one.group}: {share * one.limit:.3g} {UNITS[one.group]}, {what} the "
            f"{one.limit:.3g} of the limit, between points {after} and {following}; "
            f"{_remedy(one, float(found.plan.time_s[-1]))}"
        )
    return "\n".join(lines)


def _remedy(one: Exceeded, duration_s: float) -> str:
    if one.group in BY_TIME:
        longer = ROOM * duration_s * (1.0 + one.share) ** BY_TIME[one.group]
        time = f", --duration {longer:.3g}" if longer <= DURATIONS_S[1] else ""
        return f"give it more time{time}, or a servo that does more"
    if one.group == "hitch angle":
        angle = np.ceil(np.degrees((1.0 + one.share) * one.limit))
        allow = (
            f"allow --hitch-angle {angle:.0f} degrees, or " if angle <= HITCH_ANGLES_DEG[1] else ""
        )
        return f"{allow}make the turn there gentler"
    if one.group == "workspace":
        return "allow a larger --workspace, or move the points in"
    return "move the points there apart, so that the robot need not nearly stop"
