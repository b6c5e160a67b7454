"""The wheel servo's speed governor: how a commanded speed becomes a ramp the motor can follow.

Under a command the setpoint of a wheel changes at the acceleration limit until it arrives, and
holds: it is linear in time but for one kink.

Commands and speeds are (..., nsim, 2); the servo may be those of every simulation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ttwmr_mj.config import column
from ttwmr_mj.robot import Servo
from ttwmr_mj.state import BoolArray, FloatArray


def limit_speed(command_rad_s: FloatArray, servo: Servo) -> FloatArray:
    """The command clipped to the servo's speed range [rad/s]."""
    limit = column(servo.speed_limit_rad_s)
    return np.minimum(np.maximum(command_rad_s, -limit), limit)


def arrival_s(change_rad_s: FloatArray, servo: Servo) -> FloatArray:
    """How long a setpoint ramps to change by so much [s]."""
    return np.asarray(np.abs(change_rad_s) / column(servo.acceleration_limit_rad_s2))


def ramp(
    start_rad_s: FloatArray, command_rad_s: FloatArray, servo: Servo, time_s: FloatArray
) -> FloatArray:
    """The speed setpoint (nsim, n, 2) at times (n,) after a new command, as of `Ramp`."""
    return Ramp(servo, time_s)(start_rad_s, command_rad_s)


class Ramp:
    """The speed setpoint at the same times after every new command.

    Attributes:
        time_s: (n,) times since the command.
    """

    def __init__(self, servo: Servo, time_s: FloatArray) -> None:
        """Take the limits and the times."""
        self.time_s = time_s
        self._high = np.asarray(column(servo.speed_limit_rad_s))
        self._reach = column(column(servo.acceleration_limit_rad_s2)) * time_s[:, None]
        self._low, self._back = -self._high, -self._reach

    def __call__(self, start_rad_s: FloatArray, command_rad_s: FloatArray) -> FloatArray:
        """The setpoints (nsim, n, 2) [rad/s].

        Args:
            start_rad_s: (nsim, 2) setpoint when the command arrives.
            command_rad_s: (nsim, 2) commanded speed; clipped to the servo's range.
        """
        change = np.minimum(np.maximum(command_rad_s, self._low), self._high) - start_rad_s
        moved = np.minimum(np.maximum(change[:, None, :], self._back), self._reach)
        return np.asarray(start_rad_s[:, None, :] + moved)


def ramp_and_angle(
    change_rad_s: FloatArray, servo: Servo, time_s: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """By how much a setpoint that is to change has changed after times, and its integral.

    [rad/s] and [rad].
    """
    ramping = np.minimum(arrival_s(change_rad_s, servo), time_s)
    # sign·(½·A·τ² + |change|·(time − τ)), with A·τ = the change so far
    moved = np.copysign(column(servo.acceleration_limit_rad_s2) * ramping, change_rad_s)
    return moved, moved * (time_s - 0.5 * ramping)


class Stretches(NamedTuple):
    """Successive stretches of time in which no wheel changes its acceleration.

    Every simulation has its own durations; nothing changes in a stretch of zero duration.
    """

    duration_s: FloatArray  # (stretch, nsim)
    speed_rad_s: FloatArray  # (stretch, nsim, 2) of the wheels (right, left) at the start
    rate_rad_s2: FloatArray  # (stretch, nsim, 2)
    lead_s: FloatArray  # (stretch, nsim, 2) how far the wheels are ahead of their setpoints

    def where(self, kept: BoolArray | int) -> Stretches:
        """Some of the stretches, or one."""
        return Stretches(*(part[kept] for part in self))

    @property
    def lasting(self) -> Stretches:
        """Those that last in any simulation."""
        return self.where(np.asarray(self.duration_s.any(axis=1)))


def cut(
    start_rad_s: FloatArray,
    command_rad_s: FloatArray,
    servo: Servo,
    duration_s: float,
    longest_s: float,
    physics_step_s: float = 0.0,
) -> Stretches:
    """One command, cut where a setpoint arrives and into stretches of a length at most.

    With a physics step, every step is driven at the setpoint of its end, as MuJoCo does it: the
    wheels lead a ramp by half a step, and what is left of it in the last one by half of that.

    Args:
        start_rad_s: (nsim, 2) setpoint when the command arrives.
        command_rad_s: (nsim, 2) commanded speed; clipped to the servo's range.
        servo: limits.
        duration_s: how long the command holds.
        longest_s: of a stretch.
        physics_step_s: zero: the wheels are at their setpoints at any time.
    """
    change = limit_speed(command_rad_s, servo) - start_rad_s
    arrival = np.minimum(arrival_s(change, servo), duration_s)
    # The slack keeps 0.033/0.011 from rounding up to four.
    count = max(1, math.ceil(duration_s / longest_s - 1e-9))
    grid = duration_s * (np.arange(count + 1) / count)
    edges = [np.broadcast_to(grid[:, None], (count + 1, len(change))), arrival.T]
    if physics_step_s:
        # the step that a setpoint arrives in begins; the slack is for arrivals at a step's end
        last = physics_step_s * np.floor(arrival / physics_step_s * (1.0 + 1e-12))
        edges.append(last.T)
    edge = np.sort(np.concatenate(edges), axis=0)
    begin = edge[:-1, :, None]
    lead = np.zeros((1, 1, 1))
    if physics_step_s:
        lead = 0.5 * np.where(begin < last, physics_step_s, arrival - last)
    # From the kink on exactly zero; differences over short stretches would not be.
    limit = column(servo.acceleration_limit_rad_s2)
    rate = np.where(begin < arrival, np.copysign(limit, change), 0.0)
    speed = start_rad_s + _within(change, limit * begin)
    return Stretches(edge[1:] - edge[:-1], speed, rate, np.broadcast_to(lead, rate.shape))


def _within(change_rad_s: FloatArray, reach_rad_s: FloatArray) -> FloatArray:
    """As much of a change as is within reach."""
    return np.minimum(np.maximum(change_rad_s, -reach_rad_s), reach_rad_s)
