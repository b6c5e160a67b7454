"""Whether rows tell one motion: from where the robot starts, as their own rates carry it on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ttwmr_mj.dynamics.extended.parameters import driven_inertia
from ttwmr_mj.dynamics.kinetics import total_mass
from ttwmr_mj.errors import apart
from ttwmr_mj.results.trajectory import Trajectory, q_names
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import THETA1, BoolArray, FloatArray, RobotState, wrap

# How far the mean rate of a period may be from that of its ends: so many times what these differ
# by, and what a push or a crash does and undoes between them. These errors are as good as random.
# Of 140 runs (all shipped scenarios, many on both plants, in two worlds, pushed, thrown over,
# in periods of 1 ms to 1 s) none strayed by more than a fifth of what this allows.
UNSEEN = 8.0
UNSEEN_M_S2, UNSEEN_RAD_S2 = 2.0, 20.0
ALIKE = 0.02  # of the way, by errors that are alike in every period, as where rates ripple with it


def broken_motion(
    rows: Trajectory, scenario: Scenario, start: RobotState, tolerance: float
) -> Iterator[str]:
    """Where rows do not go together, in words: column, time, what it is and what is expected.

    Args:
        rows: (n, 1) that were reached, finite.
        scenario: that they are of.
        start: of one simulation.
        tolerance: of numbers that are the same [m, rad, and of both in a second].
    """
    q, rate, time_s = rows.q[:, 0], rows.q_rate[:, 0], rows.time_s
    names = q_names(q.shape[1])
    if began := told(names, time_s, q[:1], start.q, np.abs(q[:1] - start.q) > tolerance):
        yield f"{began} where its scenario starts"
    led, strayed = _as_rates_lead(q, rate, time_s, tolerance + _lagging(scenario, q.shape[1]))
    if went := told(names, time_s, q, led, strayed):
        yield f"{went} by its own rates"


def _lagging(scenario: Scenario, width: int) -> FloatArray:
    """(width,) way that the extended model's wheels lag behind at most [m, rad].

    Their rates jump with their setpoints' acceleration, in between two rows, too.
    """
    extended, robot = scenario.plant.analytic.extended, scenario.robot
    if scenario.plant.kind != "analytic" or extended is None:
        return np.zeros(width)
    radius_m, servo = extended.wheel_radius_m, robot.servo
    load = 1.0 + 0.5 * total_mass(robot) * radius_m**2 / driven_inertia(robot)
    turned = 2.0 * servo.speed_limit_rad_s * extended.servo_time_constant_s * load
    way_m = radius_m * turned
    return _each(way_m, 2.0 * way_m / extended.track_width_m, width)


def _as_rates_lead(
    q: FloatArray, rate: FloatArray, time_s: FloatArray, tolerance: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """(n, width) where rates lead from the first row on, and which q cannot be from there."""
    period_s = np.diff(time_s)[:, None]
    mean, change = 0.5 * (rate[1:] + rate[:-1]), np.diff(rate, axis=0)
    led = np.zeros_like(q)
    led[1:] = np.cumsum(period_s * mean, axis=0)
    step = np.diff(q, axis=0) - period_s * mean
    step[:, THETA1:] = wrap(step[:, THETA1:])  # what turns faster than can be seen
    unseen = UNSEEN * _speed(change) + period_s * _each(UNSEEN_M_S2, UNSEEN_RAD_S2, q.shape[1])
    most = np.sqrt(np.cumsum((period_s * unseen) ** 2, axis=0))
    most += ALIKE * np.cumsum(period_s * _speed(mean), axis=0)
    strayed = np.zeros(q.shape, dtype=bool)
    strayed[1:] = np.abs(np.cumsum(step, axis=0)) > most + tolerance
    return q[:1] + led, strayed


def _speed(rate: FloatArray) -> FloatArray:
    """(n, width) how fast P moves, twice, and how fast all angles turn, for each of them."""
    moved, turned = (np.linalg.norm(part, axis=1) for part in (rate[:, :THETA1], rate[:, THETA1:]))
    return _each(moved[:, None], turned[:, None], rate.shape[1])


def _each(of_p: FloatArray | float, of_angles: FloatArray | float, width: int) -> FloatArray:
    return np.where(np.arange(width) < THETA1, of_p, of_angles)


def told(
    names: Sequence[str], time_s: FloatArray, got: FloatArray, expected: FloatArray, off: BoolArray
) -> str:
    """The first number (n, columns) that is off, and what is expected; empty: none is."""
    if not off.any():
        return ""
    k, i = np.argwhere(off)[0]
    is_, should = apart(got[k, i], expected[k, i])
    return f"its column {names[i]} is {is_} at {time_s[k]:g} s, and {should}"
