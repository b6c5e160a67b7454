"""The hybrid model (Eq. 24-29) as a plant: wheels obey their servo exactly, the trailer swings.

The tractor never slips and its wheel speeds follow `plants.servo`, so under one command they are
piecewise linear in time, with a kink where a wheel reaches its commanded speed. Between kinks the
heading is an exact quadratic, P an integral of known functions (three-point Gauss), and only the
hitch angle a differential equation (`plants.swing`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.kinematics import (
    q_rate,
    twist_from_wheels,
    wheels_from_twist,
    workspace_rate,
)
from ttwmr_mj.dynamics.servo import limit_speed, ramp
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.bodiless import BodilessPlant
from ttwmr_mj.plants.swing import Forcing, HitchSwing
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
# On [0, 1], shaped to broadcast over (node, interval, simulation).
GAUSS_NODES = (0.5 + 0.5 * _NODES)[:, None, None]
GAUSS_WEIGHTS = (0.5 * _WEIGHTS)[:, None, None]


class _Intervals(NamedTuple):
    """Successive stretches of time with constant wheel accelerations, each (interval, nsim).

    Every simulation has its own durations; a duration may be zero and then changes nothing.
    """

    duration_s: FloatArray
    u1: FloatArray  # speed at the start [m/s]
    u2: FloatArray  # turn rate at the start [rad/s]
    u1_rate: FloatArray
    u2_rate: FloatArray


class AnalyticPlant(BodilessPlant):
    """A batch of robots that follow the hybrid model, each under its own command.

    A simulation's numbers do not depend on the batch it runs in, and mirrored commands give
    exactly mirrored motion. The step's error is of fourth order, of second at every stick or slip
    of a dry hitch.

    The hitch angle is the stored coordinate: θ2 = θ1 + φ, so a locked hitch turns rigidly.

    Attributes:
        nsim: simulations in the batch.
        time_step_s: the step in which commands are held.
    """

    def __init__(
        self,
        robot: RobotParameters,
        nsim: int,
        time_step_s: float,
        max_integration_step_s: float,
        *,
        published_spring: bool = False,
    ) -> None:
        """Build the plant, at rest at the origin.

        Args:
            robot: Table I, hitch and servo limits.
            nsim: simulations in the batch.
            time_step_s: duration of one step of `advance`.
            max_integration_step_s: upper bound of the Runge-Kutta step.
            published_spring: divide spring and damper torque by k, as printed in Eq. 41, and
                not by J2 + m2·l².

        Raises:
            InputError: the integration would be unstable for this hitch.
        """
        self.nsim = nsim
        self.time_step_s = time_step_s
        self._robot = robot
        self._max_step_s = max_integration_step_s
        self._swing_length_m = robot.swing_length_m
        self._hitch_swing = HitchSwing(robot, published_spring=published_spring)
        self._reject_unstable_step()
        self.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0, nsim))

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; a sideways velocity of P is dropped (Eq. 3)."""
        self._x, self._y, self._theta1 = initial.q[:, :3].T.copy()
        self._hitch = initial.hitch_angle_rad.copy()
        rate = workspace_rate(initial.q, initial.q_rate)
        self._hitch_rate = rate[:, 2] - rate[:, 1]
        self._wheels = wheels_from_twist(rate[:, :2], self._robot)

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        twist = twist_from_wheels(self._wheels, self._robot)
        q = np.stack([self._x, self._y, self._theta1, self._theta1 + self._hitch], axis=-1)
        theta2_rate = twist[:, 1] + self._hitch_rate
        return RobotState(q=q, q_rate=q_rate(q, np.column_stack([twist, theta2_rate])))

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) wheel speeds (right, left), equal to the servos' setpoints."""
        return self._wheels.copy()

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        sums = self._x + self._y + self._theta1 + self._hitch + self._hitch_rate
        return np.asarray(~np.isfinite(sums + self._wheels.sum(axis=-1)))

    def advance(self, wheel_command_rad_s: FloatArray, steps: int) -> None:
        """Hold commanded wheel speeds for a time.

        Args:
            wheel_command_rad_s: (nsim, 2) right, left; the servo's limits apply.
            steps: number of `time_step_s`, at least one.
        """
        duration_s = steps * self.time_step_s
        intervals = self._intervals(wheel_command_rad_s, duration_s)
        self._roll(intervals)
        self._swing(intervals)
        end = np.array([duration_s])
        self._wheels = ramp(self._wheels, wheel_command_rad_s, self._robot.servo, end)[:, 0]

    def _intervals(self, command_rad_s: FloatArray, duration_s: float) -> _Intervals:
        """Cut the time at a uniform grid and at the two kinks of each simulation."""
        servo = self._robot.servo
        limit = servo.acceleration_limit_rad_s2
        change = limit_speed(command_rad_s, servo) - self._wheels
        kinks = np.minimum(np.abs(change) / limit, duration_s)
        # The slack keeps 0.033/0.011 from rounding up to four.
        count = max(1, math.ceil(duration_s / self._max_step_s - 1e-9))
        edges = np.empty((count + 3, self.nsim))
        edges[: count + 1] = duration_s * (np.arange(count + 1) / count)[:, None]
        edges[count + 1 :] = kinks.T
        edges.sort(axis=0)
        durations = edges[1:] - edges[:-1]
        used = durations.any(axis=1)
        start = edges[:-1][used][:, :, None]
        reach = limit * start
        wheels = self._wheels + np.minimum(np.maximum(change, -reach), reach)
        # From the kink on exactly zero; differences over short intervals would not be.
        wheel_rates = np.where(start < kinks, np.copysign(limit, change), 0.0)
        twist = twist_from_wheels(wheels, self._robot)
        twist_rate = twist_from_wheels(wheel_rates, self._robot)
        return _Intervals(
            durations[used], twist[..., 0], twist[..., 1], twist_rate[..., 0], twist_rate[..., 1]
        )

    def _roll(self, motion: _Intervals) -> None:
        """Move P and turn the tractor (Eq. 10)."""
        duration = motion.duration_s
        turns = duration * (motion.u2 + 0.5 * motion.u2_rate * duration)
        # accumulate, unlike sum, adds in the same order whatever the batch size.
        headings = np.add.accumulate(np.concatenate([self._theta1[None], turns]))
        time = GAUSS_NODES * duration
        theta1 = headings[:-1] + time * (motion.u2 + 0.5 * motion.u2_rate * time)
        travel = GAUSS_WEIGHTS * duration * (motion.u1 + motion.u1_rate * time)
        self._x = self._x + _total(travel * np.cos(theta1))
        self._y = self._y + _total(travel * np.sin(theta1))
        self._theta1 = headings[-1]

    def _swing(self, motion: _Intervals) -> None:
        """Integrate the hitch angle over every interval in turn."""
        duration = motion.duration_s
        fractions = np.array([0.0, 0.5, 1.0])[:, None, None] * duration
        centripetal = (motion.u1 + fractions * motion.u1_rate) * (
            motion.u2 + fractions * motion.u2_rate
        )
        along = -motion.u1_rate / self._swing_length_m
        across = centripetal / self._swing_length_m
        angle, rate = self._hitch, self._hitch_rate
        for index in range(duration.shape[0]):
            forcing = Forcing(
                duration[index], along[index], across[:, index], -motion.u2_rate[index]
            )
            angle, rate = self._hitch_swing.step(angle, rate, forcing)
        self._hitch, self._hitch_rate = angle, rate

    def _reject_unstable_step(self) -> None:
        longest_s = self._hitch_swing.longest_step_s
        if self._max_step_s > longest_s:
            hitch = self._robot.hitch
            raise InputError(
                f"plant.analytic.max_step_s: got {self._max_step_s:g}, but the hitch spring and "
                f"damper (robot.hitch.stiffness_n_m_rad = {hitch.stiffness_n_m_rad:g}, "
                f"robot.hitch.damping_n_m_s_rad = {hitch.damping_n_m_s_rad:g}) are too stiff for "
                f"steps over {longest_s:.3g} s: lower max_step_s, or the gains"
            )


def _total(parts: FloatArray) -> FloatArray:
    """Sum (nsim,) over nodes and intervals (node, interval, nsim), in a fixed order."""
    return np.asarray(np.add.accumulate(parts.reshape(-1, parts.shape[-1]))[-1])
