"""A train over one control period: from wheel commands to the next sample.

As `sampled`, for any number n of trailers: the tractor rolls while its servos ramp and hold, the
trailers swing (`train`) under springs, dampers, smooth dry friction and gravity along the floor.
Small and vectorised over any leading axes.

The wheels' angles and the heading are exact at the substeps' ends. The swing takes midpoint steps
with the mean acceleration of P, the change of its velocity over the substep. Second order in it.
"""

import math
from collections.abc import Callable

import numpy as np

from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.kinematics import rolling, to_world, wheel_geometry
from ttwmr_mj.dynamics.servo import limit_speed, ramp_and_angle
from ttwmr_mj.dynamics.train import (
    FASTEST_SWING_RAD_S,
    accelerations_at,
    constants,
    hitch_torques,
    on_trailers,
    posture,
    solve,
    swing_matrix,
)
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

SUBSTEP_S = 0.0085  # four in a period of 33 ms
SLIP = 3  # of P ahead and to the left [m/s], of the heading [rad/s]


class SampledTrain:
    """One robot's sampled dynamics: (body, wheels) and a command to the next (body, wheels).

    A body (..., 3 + 2n) is x, y, θ1, θ2, …, θ̇2, …; a disturbance is slip of P and of the heading,
    and an extra acceleration of every trailer.

    Attributes:
        period_s: T.
        trailers: n.
    """

    def __init__(
        self,
        robot: RobotParameters,
        period_s: float,
        smoothing_rad_s: float,
        ground: Ground = LEVEL,
        substep_s: float = SUBSTEP_S,
    ) -> None:
        """Set up; dry friction at a hitch rate s is s/√(s² + ε²) of its full size, ε given."""
        self.period_s, self.trailers = period_s, len(robot.trailers)
        self._robot, self._servo = robot, robot.servo
        self._wheels, self._pull = wheel_geometry(robot), ground.gravity_m_s2
        self._reach = robot.servo.acceleration_limit_rad_s2 * period_s
        self._constants = constants(robot)
        self._without_torque = not any(
            hitch.stiffness_n_m_rad or hitch.damping_n_m_s_rad or hitch.coulomb_friction_n_m
            for hitch in robot.hitches
        )
        self._dry = np.array([hitch.coulomb_friction_n_m for hitch in robot.hitches])
        self._smoothing = smoothing_rad_s
        self._substeps = math.ceil(period_s / substep_s)

    def advance(
        self,
        body: FloatArray,
        wheels: FloatArray,
        command: FloatArray,
        slip: FloatArray,
        unexplained: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Hold a command for one period.

        Args:
            body: (..., 3 + 2n).
            wheels: (..., 2) servo setpoints (right, left) at the start [rad/s].
            command: (..., 2) commanded speeds; the servo's limits apply.
            slip: (..., 3) of P ahead, to the left [m/s] and of the heading [rad/s].
            unexplained: (..., n) extra θ̈ of the trailers [rad/s²].

        Returns:
            body and wheels one period later.
        """
        step, tractor = self.period_s / self._substeps, body[..., :3]
        place, moved, pulls, headings, turns = self._tractor(tractor, wheels, command, slip)
        theta, rate = body[..., 3 : 3 + self.trailers], body[..., 3 + self.trailers :]
        for v, theta1, turn in zip(pulls, headings, turns, strict=True):
            mid = theta + 0.5 * step * rate
            swing = self._swing(mid, v, theta1, turn)
            half = rate + 0.5 * step * (swing(rate) + unexplained)
            new = rate + step * (swing(half) + unexplained)
            theta, rate = theta + 0.5 * step * (rate + new), new
        rate = np.minimum(np.maximum(rate, -FASTEST_SWING_RAD_S), FASTEST_SWING_RAD_S)
        return np.concatenate([place, theta, rate], axis=-1), wheels + moved

    def _tractor(
        self, body: FloatArray, wheels: FloatArray, command: FloatArray, slip: FloatArray
    ) -> tuple[FloatArray, ...]:
        """The tractor's period, which no trailer changes: all substeps at once.

        Returns:
            (..., 3) x, y, θ1 at its end, (..., 2) how far the setpoints have moved; and of each
            substep, in front: mean acceleration of P less gravity's (..., 2), θ1 (...) in its
            middle, and mean θ̇1 (...).
        """
        step, ahead, left = self.period_s / self._substeps, slip[..., 0], slip[..., 1]
        change = limit_speed(command, self._servo) - wheels
        times: FloatArray = step * np.arange(float(self._substeps + 1))
        times = times.reshape(-1, *[1] * change.ndim)
        moved, angle = ramp_and_angle(change, self._servo, times)
        arc, turned = rolling(angle[1:] - angle[:-1] + step * wheels, *self._wheels)
        turned = turned + step * slip[..., 2]
        theta1 = _running(body[..., 2], turned)
        middle = theta1[:-1] + 0.5 * turned
        dx, dy = to_world(middle, (arc + step * ahead) * (1.0 - turned**2 / 24.0), step * left)
        speed, _ = rolling(wheels + moved, *self._wheels)
        velocity = np.stack(to_world(theta1, speed + ahead, left), axis=-1)
        x, y = _running(body[..., 0], dx)[-1], _running(body[..., 1], dy)[-1]
        pull = (velocity[1:] - velocity[:-1]) / step - self._pull
        return np.stack([x, y, theta1[-1]], axis=-1), moved[-1], pull, middle, turned / step

    def velocity(self, body: FloatArray, wheels: FloatArray, slip: FloatArray) -> FloatArray:
        """(..., 2) velocity of P rolling at these wheel speeds with this slip [m/s]."""
        speed, _ = rolling(wheels, *self._wheels)
        return np.stack(to_world(body[..., 2], speed + slip[..., 0], slip[..., 1]), axis=-1)

    def within_limits(self, wheels: FloatArray, wish: FloatArray) -> FloatArray:
        """(..., 2) desired speeds, clipped to what the servos reach in one period from `wheels`."""
        limit = self._servo.speed_limit_rad_s
        low, high = wheels - self._reach, wheels + self._reach
        return np.clip(wish, np.maximum(low, -limit), np.minimum(high, limit))

    def friction(self, theta: FloatArray, rate: FloatArray, turn: FloatArray) -> FloatArray:
        """(..., n) θ̈ that dry friction causes, at θ̇1 = turn (...) [rad/s²]."""
        torque = on_trailers(self._rubbing(self._hitch_rates(rate, turn)))
        return solve(swing_matrix(theta, self._robot), torque)

    def _swing(
        self, theta: FloatArray, v: FloatArray, theta1: FloatArray, turn: FloatArray
    ) -> Callable[[FloatArray], FloatArray]:
        """Rates (..., n) → θ̈ (..., n), with the trailers at θ."""
        at = posture(self._constants, theta, v)
        if self._without_torque:
            return lambda rate: accelerations_at(at, rate)
        hitch = self._hitch_rates(theta, theta1)

        def swing(rate: FloatArray) -> FloatArray:
            slide = self._hitch_rates(rate, turn)
            torque = hitch_torques(hitch, slide, self._robot) + self._rubbing(slide)
            return accelerations_at(at, rate, on_trailers(torque))

        return swing

    def _rubbing(self, slide: FloatArray) -> FloatArray:
        return np.asarray(-self._dry * slide / np.hypot(slide, self._smoothing))

    @staticmethod
    def _hitch_rates(trailers: FloatArray, tractor: FloatArray) -> FloatArray:
        rates = trailers.copy()
        rates[..., 0] -= tractor
        rates[..., 1:] -= trailers[..., :-1]
        return rates


def _running(start: FloatArray, changes: FloatArray) -> FloatArray:
    """(n + 1, ...) a value (...) and what becomes of it with one change (n, ...) after another."""
    values = np.empty((len(changes) + 1, *changes.shape[1:]))
    values[0], values[1:] = start, changes
    return np.asarray(np.add.accumulate(values, axis=0))
