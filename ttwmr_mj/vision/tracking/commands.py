"""The commanded wheel speeds, as the tracker stores them: a piecewise linear speed over time."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.kinematics import rolling, wheel_geometry
from ttwmr_mj.dynamics.servo import arrival_s, limit_speed, ramp
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

MEMORY_S = 5.0  # much longer than a frame or its successor may be on its way


class TwistRamp(NamedTuple):
    """A time in which the commanded twist (u1 [m/s], u2 [rad/s]) changes linearly."""

    duration_s: float
    u1_start: float
    u2_start: float
    u1_end: float
    u2_end: float


class CommandHistory:
    """The twist (u1, u2) that the servos' ramps aim at, over the last seconds.

    Before the first and after the last command it is constant.
    """

    def __init__(self, robot: RobotParameters, time_s: float = 0.0) -> None:
        """Start at rest."""
        self._robot, self._wheels = robot, wheel_geometry(robot)
        self._setpoint: FloatArray = np.zeros((1, 2))
        self._times = [time_s]
        self._twists: list[tuple[float, float]] = [(0.0, 0.0)]

    def roll(self, wheel_speed_rad_s: FloatArray) -> None:
        """Say that the wheels (right, left) are turning already; for a start in motion."""
        self._setpoint = np.array(wheel_speed_rad_s, dtype=np.float64).reshape(1, 2)
        self._twists[-1] = self._twist(self._setpoint)

    def tell(self, time_s: float, wheel_command_rad_s: FloatArray, duration_s: float) -> None:
        """Add a command (right, left) that holds from a time, the end of the last one, on."""
        if time_s > self._times[-1]:
            self._add(time_s, self._setpoint)
        servo = self._robot.servo
        command = np.asarray(wheel_command_rad_s, dtype=np.float64).reshape(1, 2)
        arrival = arrival_s(limit_speed(command, servo) - self._setpoint, servo)[0].tolist()
        # each wheel's ramp ends in a kink; between kinks the speeds are linear
        after = sorted({*(kink for kink in arrival if 0.0 < kink < duration_s), duration_s})
        speeds = ramp(self._setpoint, command, servo, np.array(after))
        for delay, speed in zip(after, speeds[0], strict=True):
            self._add(time_s + delay, speed)
        self._setpoint = speeds[:, -1]
        forgotten = max(bisect_right(self._times, time_s - MEMORY_S) - 1, 0)
        del self._times[:forgotten], self._twists[:forgotten]

    def twist(self, time_s: float) -> tuple[float, float]:
        """(u1 [m/s], u2 [rad/s]) at a time."""
        times, twists = self._times, self._twists
        i = bisect_right(times, time_s)
        if i == 0 or i == len(times):
            return twists[min(i, len(times) - 1)]
        share = (time_s - times[i - 1]) / (times[i] - times[i - 1])
        (a1, a2), (b1, b2) = twists[i - 1], twists[i]
        return a1 + share * (b1 - a1), a2 + share * (b2 - a2)

    def ramps(self, start_s: float, end_s: float) -> Iterator[TwistRamp]:
        """The commanded twist between two times, in order; nothing where end is not later."""
        inner = self._times[bisect_right(self._times, start_s) : bisect_left(self._times, end_s)]
        knots = [(time, self.twist(time)) for time in (start_s, *inner, end_s)]
        for (begin, first), (end, last) in pairwise(knots):
            if end > begin:
                yield TwistRamp(end - begin, *first, *last)

    def _add(self, time_s: float, speed: FloatArray) -> None:
        self._times.append(time_s)
        self._twists.append(self._twist(speed))

    def _twist(self, speed: FloatArray) -> tuple[float, float]:
        u1, u2 = rolling(np.asarray(speed).reshape(2), *self._wheels)
        return float(u1), float(u2)
