"""A train over one control period: from wheel commands to the next sample.

As `sampled`, for any number n of trailers: the tractor rolls while its servos ramp and hold, the
trailers swing (`train`) under springs, dampers, smooth dry friction and gravity along the floor.
Small and vectorised over any leading axes.

The wheels' angles and the heading are exact at the substeps' ends. The swing takes midpoint steps
with the mean acceleration of P, the change of its velocity over the substep. Second order in it.
"""

import math

import numpy as np

from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.kinematics import rolling, to_world, wheel_geometry
from ttwmr_mj.dynamics.servo import limit_speed, ramp_and_angle
from ttwmr_mj.dynamics.train import (
    FASTEST_SWING_RAD_S,
    accelerations_of,
    constants,
    hitch_torques,
    on_trailers,
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
        change, step = limit_speed(command, self._servo) - wheels, self.period_s / self._substeps
        x, y, theta1 = np.moveaxis(body[..., :3], -1, 0)
        theta, rate = body[..., 3 : 3 + self.trailers], body[..., 3 + self.trailers :]
        ahead, left, turning = np.moveaxis(slip, -1, 0)
        speed, _ = rolling(wheels, *self._wheels)
        before = np.stack(to_world(theta1, speed + ahead, left), axis=-1)
        angles = np.zeros_like(change)
        for i in range(1, self._substeps + 1):
            moved, angles_now = ramp_and_angle(change, self._servo, i * step)
            arc, turned = rolling(angles_now - angles + step * wheels, *self._wheels)
            angles, turned = angles_now, turned + step * turning
            speed, _ = rolling(wheels + moved, *self._wheels)
            middle = theta1 + 0.5 * turned
            dx, dy = to_world(middle, (arc + step * ahead) * (1.0 - turned**2 / 24.0), step * left)
            x, y, theta1 = x + dx, y + dy, theta1 + turned
            after = np.stack(to_world(theta1, speed + ahead, left), axis=-1)
            v, before = (after - before) / step - self._pull, after
            tractor = middle, turned / step
            mid = theta + 0.5 * step * rate
            half = rate + 0.5 * step * (self._swing(mid, rate, v, tractor) + unexplained)
            new = rate + step * (self._swing(mid, half, v, tractor) + unexplained)
            theta, rate = theta + 0.5 * step * (rate + new), new
        rate = np.clip(rate, -FASTEST_SWING_RAD_S, FASTEST_SWING_RAD_S)
        place = np.stack([x, y, theta1], axis=-1)
        return np.concatenate([place, theta, rate], axis=-1), wheels + moved

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
        self,
        theta: FloatArray,
        rate: FloatArray,
        v: FloatArray,
        tractor: tuple[FloatArray, FloatArray],
    ) -> FloatArray:
        if self._without_torque:
            return accelerations_of(self._constants, theta, rate, v)
        theta1, turn = tractor
        hitch, slide = self._hitch_rates(theta, theta1), self._hitch_rates(rate, turn)
        torque = hitch_torques(hitch, slide, self._robot) + self._rubbing(slide)
        return accelerations_of(self._constants, theta, rate, v, on_trailers(torque))

    def _rubbing(self, slide: FloatArray) -> FloatArray:
        return np.asarray(-self._dry * slide / np.hypot(slide, self._smoothing))

    @staticmethod
    def _hitch_rates(trailers: FloatArray, tractor: FloatArray) -> FloatArray:
        rates = trailers.copy()
        rates[..., 0] -= tractor
        rates[..., 1:] -= trailers[..., :-1]
        return rates
