"""Open-loop rollouts of the hybrid model (Eq. 24-29) at full precision, many at once.

The wheel speeds are known in advance, piecewise linear in time. Then only the hitch angle
φ = θ2 − θ1 is unknown,

    φ̈ = (u1·u2·cos φ − u̇1·sin φ)/k − u̇2 − (k_t·φ + c_t·φ̇)/(J2 + m2·l²)     (Eq. 17, 24, 27-28)

and a batch finds it stretch by stretch as a Taylor series (`taylor`). A single simulation, where
every call into numpy costs more than its numbers, finds it over a whole window of time at once: on
every stretch of it φ̈ is a polynomial through Gauss nodes, and Picard's iteration φ ← φ0 + ∬ φ̈(φ) is
repeated until nothing changes. It converges for any window, the faster the shorter.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.dynamics.hitch import spring_damper_acceleration
from ttwmr_mj.dynamics.kinematics import q_rate as q_rate_of
from ttwmr_mj.dynamics.kinematics import twist_from_wheels, workspace_rate
from ttwmr_mj.dynamics.servo import limit_speed
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.quadrature import Rule, integrals, rule_for
from ttwmr_mj.plants.taylor import TOO_VIOLENT, Ramp, Room, Series
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.state import FloatArray, RobotState

TOLERANCE_RAD = 2e-10  # change of φ at which the iteration ends; what is left is much less
MAX_ITERATIONS = 60
SMALL_RAD = 0.25  # below it a series of five terms is exact to 3e-13
# Of Picard's windows: the length in units of the swing's time scale, and the most nodes.
LONGEST_WINDOW = 8.0
WINDOW_NODES = 96
BLOCK_NUMBERS = 16_000  # knots times simulations that are worked on at once, to stay in the cache


class WheelHistory(NamedTuple):
    """Wheel speeds, linear in time between knots; every simulation may have its own times.

    Attributes:
        time_s: (n, nsim) or (n, 1) never decreasing; at equal times speeds are equal too.
        wheel_speed_rad_s: (n, nsim, 2) right, left.
    """

    time_s: FloatArray
    wheel_speed_rad_s: FloatArray


class _Stretches(NamedTuple):
    """Successive stretches with constant wheel accelerations, each (stretch, nsim)."""

    duration_s: FloatArray
    u1: FloatArray  # speed at the start [m/s]
    u2: FloatArray  # turn rate at the start [rad/s]
    u1_rate: FloatArray
    u2_rate: FloatArray


def servo_history(
    start_rad_s: FloatArray, command_rad_s: FloatArray, duration_s: FloatArray, servo: Servo
) -> WheelHistory:
    """What ideal servos make of commands that hold for a while each.

    Args:
        start_rad_s: (nsim, 2) wheel speeds at time zero.
        command_rad_s: (n, nsim, 2) one command after the other (right, left).
        duration_s: (n,) how long each holds.
        servo: its speed and acceleration limits.

    Returns:
        A knot at time zero, then three per command: when either wheel has arrived, and the end.
    """
    limit = servo.acceleration_limit_rad_s2
    now, begin = start_rad_s, 0.0
    times, speeds = [np.zeros((1, len(now)))], [now[None]]
    for goal, duration in zip(limit_speed(command_rad_s, servo), duration_s, strict=True):
        arrival = np.sort(np.minimum(np.abs(goal - now) / limit, duration), axis=1)
        after = np.column_stack([arrival, np.full(len(now), duration)]).T
        reach = limit * after[:, :, None]
        speed = now + np.minimum(np.maximum(goal - now, -reach), reach)
        times.append(begin + after)
        speeds.append(speed)
        begin, now = begin + float(duration), speed[-1]
    return WheelHistory(np.concatenate(times), np.concatenate(speeds))


def roll_out(
    robot: RobotParameters, initial: RobotState, history: WheelHistory, every: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Drive the hybrid model through known wheel speeds.

    The error is below 1e-8 [m, rad], whatever the knots. A sideways velocity of P
    and wheel speeds in `initial` that differ from the history's are dropped (Eq. 3).

    Args:
        robot: Table I and the hitch; dry friction is not supported.
        initial: nsim states.
        history: n knots.
        every: give the states at every so many knots, from the first on.

    Returns:
        q and q_rate at these knots, (ceil(n/every), nsim, 4) each.

    Raises:
        InputError: the hitch has dry friction, or the motion is too violent to converge.
    """
    if robot.hitch.coulomb_friction_n_m:
        raise InputError(
            "robot.hitch.coulomb_friction_n_m: got "
            f"{robot.hitch.coulomb_friction_n_m:g}, but rollouts at full precision need a smooth "
            "hitch: set it to 0, or use the analytic plant"
        )
    swing = _Swing(robot)
    knots, nsim = history.wheel_speed_rad_s.shape[:2]
    kept = -(-knots // every)
    q, q_rate = np.empty((kept, nsim, 4)), np.empty((kept, nsim, 4))
    now = _State.of(initial, twist_from_wheels(history.wheel_speed_rad_s[0], robot))
    block = knots if nsim == 1 else every * max(1, BLOCK_NUMBERS // (nsim * every))
    for first in range(0, max(knots - 1, 1), block):
        last = min(first + block, knots - 1)
        twist = twist_from_wheels(history.wheel_speed_rad_s[first : last + 1], robot)
        path = _drive(now, history.time_s[first : last + 1], twist, swing)
        now = _State(*(values[-1] for values in path))
        x, y, theta1, hitch, hitch_rate = (values[::every] for values in path)
        rows = slice(first // every, first // every + len(x))
        q[rows] = np.stack([x, y, theta1, theta1 + hitch], axis=-1)
        u = twist[::every]
        xi = np.concatenate([u, (u[..., 1] + hitch_rate)[..., None]], axis=-1)
        q_rate[rows] = q_rate_of(q[rows], xi)
    return q, q_rate


class _State(NamedTuple):
    """What is known of the robots between blocks of time, each (nsim,) or (n, nsim)."""

    x: FloatArray
    y: FloatArray
    theta1: FloatArray
    hitch: FloatArray
    hitch_rate: FloatArray

    @classmethod
    def of(cls, initial: RobotState, twist: FloatArray) -> _State:
        """The start, at the twist (nsim, 2) of the history's first knot."""
        theta2_rate = workspace_rate(initial.q, initial.q_rate)[:, 2]
        x, y, theta1 = initial.q[:, :3].T
        return cls(x, y, theta1, initial.hitch_angle_rad, theta2_rate - twist[:, 1])


def _drive(start: _State, time_s: FloatArray, twist: FloatArray, swing: _Swing) -> _State:
    """The states at knots with twists (n, nsim, 2), from the state at the first."""
    # Taylor series notice a spinning trailer by themselves, polynomials through nodes do not
    swing.spin_rad_s = float(np.abs(start.hitch_rate[0])) if start.hitch_rate.size == 1 else 0.0
    stretches, knots, rule = _cut(time_s, twist, swing)
    path = (
        *_roll(stretches, rule, start),
        *swing.integrate(stretches, rule, start.hitch, start.hitch_rate),
    )
    return _State(*(values[knots] for values in path))


def _cut(
    time_s: FloatArray, twist: FloatArray, swing: _Swing
) -> tuple[_Stretches, NDArray[np.intp], Rule]:
    """Stretches short enough for a polynomial, and the index of every knot among their ends."""
    duration = np.broadcast_to(time_s[1:] - time_s[:-1], twist[:-1, :, 0].shape)
    slope = (twist[1:] - twist[:-1]) / np.where(duration > 0.0, duration, np.inf)[..., None]
    whole = _Stretches(duration, twist[:-1, :, 0], twist[:-1, :, 1], slope[..., 0], slope[..., 1])
    extent = swing.extent(whole)
    rule = rule_for(float(extent.max(initial=0.0)), alone=twist.shape[1] == 1)
    pieces = np.maximum(1, np.ceil(extent / rule.longest)).astype(np.intp)
    knots = np.concatenate([[0], np.cumsum(pieces)])
    if knots[-1] == len(pieces):
        return whole, knots, rule
    index = np.repeat(np.arange(len(pieces)), pieces)
    fraction = ((np.arange(knots[-1]) - knots[index]) / pieces[index])[:, None]
    part = _Stretches(*(column[index] for column in whole))
    offset = fraction * part.duration_s
    cut = part._replace(
        duration_s=part.duration_s / pieces[index][:, None],
        u1=part.u1 + offset * part.u1_rate,
        u2=part.u2 + offset * part.u2_rate,
    )
    return cut, knots, rule


def _roll(
    motion: _Stretches, rule: Rule, start: _State
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, y, θ1 (stretch + 1, nsim) at the stretches' ends (Eq. 10)."""
    duration = motion.duration_s
    turn = duration * (motion.u2 + 0.5 * motion.u2_rate * duration)
    theta1 = _running(start.theta1, turn)
    time = rule.nodes[:, None] * duration[:, None]
    turned = time * (motion.u2[:, None] + 0.5 * motion.u2_rate[:, None] * time)
    turned -= 0.5 * turn[:, None]
    travel = duration[:, None] * (motion.u1[:, None] + motion.u1_rate[:, None] * time)
    cos, sin = _cos_sin(turned)
    ahead, aside = rule.weights @ (travel * cos), rule.weights @ (travel * sin)
    middle = theta1[:-1] + 0.5 * turn
    cos, sin = np.cos(middle), np.sin(middle)
    x = _running(start.x, cos * ahead - sin * aside)
    y = _running(start.y, sin * ahead + cos * aside)
    return x, y, theta1


def _cos_sin(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine; of small angles by their series, which takes a third of the time."""
    if not np.abs(angle).max(initial=0.0) < SMALL_RAD:
        return np.cos(angle), np.sin(angle)
    square = angle * angle
    waves = []
    for first in (1, 2):  # 1 − a²/2!·(1 − …) and a·(1 − a²/3!·(1 − …))
        series = square * (-1.0 / ((first + 7) * (first + 6)))
        for term in (first + 5, first + 3, first + 1):
            series += 1.0
            series *= square
            series *= -1.0 / (term * (term - 1))
        series += 1.0
        waves.append(series)
    waves[1] *= angle
    return waves[0], waves[1]


class _Swing:
    """The hitch's equation of motion, window by window."""

    def __init__(self, robot: RobotParameters) -> None:
        one, zero = np.ones(()), np.zeros(())
        self._length_m = robot.swing_length_m
        self.spin_rad_s = 0.0  # how fast the hitch turns to begin with
        self._stiffness = -float(spring_damper_acceleration(one, zero, robot))  # [1/s²]
        self._damping = -float(spring_damper_acceleration(zero, one, robot))  # [1/s]

    def extent(self, motion: _Stretches) -> FloatArray:
        """(stretch,) duration over the swing's time scale, the longest of the batch."""
        speed = np.abs(motion.u1) + motion.duration_s * np.abs(motion.u1_rate)
        turn = np.abs(motion.u2) + motion.duration_s * np.abs(motion.u2_rate)
        field = (speed * turn + np.abs(motion.u1_rate)) / self._length_m + self._stiffness
        # a trailer that does not turn with the tractor sees the field turn
        pace = np.maximum(np.maximum(np.sqrt(field), turn), self.spin_rad_s) + self._damping
        return np.asarray((motion.duration_s * pace).max(axis=1))

    def integrate(
        self, motion: _Stretches, rule: Rule, angle: FloatArray, rate: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """φ and φ̇ (stretch + 1, nsim) at the stretches' ends, from those at the start (nsim,)."""
        count, nsim = motion.u1.shape
        angles, rates = np.empty((count + 1, nsim)), np.empty((count + 1, nsim))
        angles[0], rates[0] = angle, rate
        if nsim > 1:
            room = Room.of(nsim)
            for k, series in enumerate(self._series(motion)):
                angles[k + 1], rates[k + 1] = series.end(angles[k], rates[k], room)
            return angles, rates
        for first, last in self._windows(self.extent(motion), rule):
            part = _Stretches(*(column[first:last] for column in motion))
            ends = slice(first + 1, last + 1)
            angles[ends], rates[ends] = self._window(part, rule, angles[first], rates[first])
        return angles, rates

    def _series(self, motion: _Stretches) -> Iterator[Series]:
        """The equation of every stretch with its duration as the unit of time."""
        time = motion.duration_s
        u1, u2 = motion.u1 * (time / self._length_m), motion.u2 * time
        u1_rate = motion.u1_rate * (time**2 / self._length_m)
        u2_rate = motion.u2_rate * time**2
        ramps = Ramp(u1 * u2_rate + u1_rate * u2, u1_rate * u2_rate, -u1_rate, u2_rate)
        moving = np.logical_or(u1_rate.any(axis=1), u2_rate.any(axis=1))
        constant, stiffness, damping = u1 * u2, self._stiffness * time**2, self._damping * time
        for k, ramp in enumerate(moving.tolist()):
            yield Series(
                time[k],
                constant[k],
                Ramp(*(part[k] for part in ramps)) if ramp else None,
                stiffness[k] if self._stiffness else None,
                damping[k] if self._damping else None,
            )

    @staticmethod
    def _windows(extent: FloatArray, rule: Rule) -> Iterator[tuple[int, int]]:
        """First and last stretch of every window."""
        most = WINDOW_NODES // len(rule.nodes)
        edges, length = [0], 0.0
        for i, size in enumerate(extent.tolist()):
            length += size
            if i > edges[-1] and (length > LONGEST_WINDOW or i - edges[-1] == most):
                edges.append(i)
                length = size
        return itertools.pairwise([*edges, len(extent)])

    def _window(
        self, motion: _Stretches, rule: Rule, angle: FloatArray, rate: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Picard's iteration for one simulation; φ and φ̇ (stretch, 1) at the stretches' ends."""
        count = len(rule.nodes)
        integral = integrals(rule, tuple(motion.duration_s[:, 0].tolist()))
        own = np.outer(motion.duration_s, rule.nodes).ravel()
        u1, u2, u1_rate, u2_rate = (part[:, 0].repeat(count) for part in motion[1:])
        u2 = u2 + own * u2_rate
        across = (u1 + own * u1_rate) * u2 / self._length_m
        along = u1_rate / -self._length_m
        size, lead = across, np.zeros(())
        if along.any():  # across·cos φ + along·sin φ = size·cos(φ − lead)
            size, lead = np.sqrt(across**2 + along**2), np.arctan2(along, across)
        # φ and φ̇ under −u̇2 alone; Gauss integrates what is linear in time exactly
        turned = u2 - motion.u2[0]
        coast = angle + rate * integral.time - integral.once @ turned - lead
        # what spring and damper do against a force, and to that motion; both are linear
        elastic = bool(self._stiffness or self._damping)
        against, both = np.zeros(()), integral.twice
        if elastic:
            back = self._damping * integral.once
            if self._stiffness:
                back += self._stiffness * integral.twice
            both = np.concatenate([integral.twice, back])
            against = self._stiffness * (coast + lead) + self._damping * (rate - turned)
        phi, hold = coast, against
        for _ in range(MAX_ITERATIONS):
            force = size * np.cos(phi) - hold
            response = both @ force
            before, phi = phi, coast + response[: coast.size]
            if elastic:
                hold = against + response[coast.size :]
            if np.abs(phi - before).max() < TOLERANCE_RAD:
                break
        else:
            raise InputError(TOO_VIOLENT)
        force -= u2_rate
        ends = (
            angle + rate * integral.end + integral.twice_to_end @ force,
            rate + integral.once_to_end @ force,
        )
        return ends[0][:, None], ends[1][:, None]


def _running(start: FloatArray, parts: FloatArray) -> FloatArray:
    """(n + 1, nsim) start (nsim,), then start plus the sum of the first 1, 2, ... n parts."""
    total = np.empty((len(parts) + 1, parts.shape[1]))
    total[0], total[1:] = start, parts
    return np.cumsum(total, axis=0, out=total)
