"""The hybrid model over one control period: from wheel commands to the next sample.

What a controller needs to look ahead: the tractor rolls without slip while its wheel servos ramp to
the command and hold it (`plants.servo`), the trailer swings (Eq. 24) under the hitch's spring,
damper and dry friction. Small and vectorised over any leading axes; the analytic plant solves the
same equations more exactly.

Dry friction sticks where it can. Who differentiates the model asks for a smooth one instead: with
`smoothing_rad_s` = ε, friction at a hitch rate s is s/√(s² + ε²) of its full size.

The wheels' angles and the heading are exact at the substeps' ends. The swing is integrated by
drift, kick, drift: the kick is the *change of P's velocity*, n·ΔP'/k, exact however sudden, so a
wheel speed may jump. Second order in the substep: with 8 ms and 4 rad/s, relative 4e-5.
"""

from __future__ import annotations

import math

import numpy as np

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

SUBSTEP_S = 0.0085  # four in a period of 33 ms
BODY = 5  # x, y, θ1, θ2, θ̇2
SLIP = 3  # creep of P ahead and to the left [m/s], creep of the heading [rad/s]


class SampledModel:
    """One robot's sampled dynamics: (body, wheels) and a command to the next (body, wheels).

    Attributes:
        period_s: T.
        reach_rad_s: how far a wheel's speed can change in one period.
        speed_limit_rad_s: of a wheel.
    """

    def __init__(
        self,
        robot: RobotParameters,
        period_s: float,
        substep_s: float = SUBSTEP_S,
        smoothing_rad_s: float = 0.0,
    ) -> None:
        servo, hitch = robot.servo, robot.hitch
        self.period_s = period_s
        self.reach_rad_s = servo.acceleration_limit_rad_s2 * period_s
        self.speed_limit_rad_s = servo.speed_limit_rad_s
        self._acceleration = servo.acceleration_limit_rad_s2
        self._radius, self._track = robot.tractor.wheel_radius_m, robot.tractor.track_width_m
        self._length = robot.swing_length_m
        inertia = robot.swing_inertia_kg_m2
        self._stiffness = hitch.stiffness_n_m_rad / inertia  # [1/s²]
        self._damping = hitch.damping_n_m_s_rad / inertia  # [1/s]
        self._friction = hitch.coulomb_friction_n_m / inertia  # [rad/s²]
        self._smoothing = smoothing_rad_s
        self._substeps = math.ceil(period_s / substep_s)

    def advance(
        self,
        body: FloatArray,
        wheels: FloatArray,
        command: FloatArray,
        *,
        slip: FloatArray | None = None,
        swing: FloatArray | float = 0.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Hold a command for one period.

        Args:
            body: (..., 5) x, y, θ1, θ2, θ̇2.
            wheels: (..., 2) servo setpoints (right, left) at the start [rad/s].
            command: (..., 2) commanded speeds; the servo's limits apply.
            slip: (..., 3) creep of P ahead, to the left [m/s] and of the heading [rad/s].
            swing: (...) extra θ̈2 [rad/s²], whatever its cause.

        Returns:
            body and wheels one period later.
        """
        limit = self.speed_limit_rad_s
        change = np.minimum(np.maximum(command, -limit), limit) - wheels
        step = self.period_s / self._substeps
        x, y, theta1, theta2, rate = np.moveaxis(body, -1, 0)
        ahead, left, turning = (0.0, 0.0, 0.0) if slip is None else np.moveaxis(slip, -1, 0)
        speed, turn = self._twist(wheels, ahead, turning)
        vx, vy = _velocity(theta1, speed, left)
        angles = np.zeros_like(change)
        for i in range(1, self._substeps + 1):
            moved, angles_now = self._ramp(change, i * step)
            arc, turned = self._twist(angles_now - angles + step * wheels, 0.0, 0.0)
            angles = angles_now
            speed, turn = self._twist(wheels + moved, ahead, turning)
            turned = turned + step * turning
            chord = (arc + step * ahead) * (1.0 - turned**2 / 24.0)
            middle = theta1 + 0.5 * turned
            dx, dy = _velocity(middle, chord, step * left)
            x, y, theta1 = x + dx, y + dy, theta1 + turned
            new_vx, new_vy = _velocity(theta1, speed, left)
            theta2 = theta2 + 0.5 * step * rate
            kick = np.cos(theta2) * (new_vy - vy) - np.sin(theta2) * (new_vx - vx)
            rate = rate + kick / self._length + step * swing
            rate = self._hitch(rate, theta2 - middle, turn, step)
            theta2 = theta2 + 0.5 * step * rate
            vx, vy = new_vx, new_vy
        return np.stack([x, y, theta1, theta2, rate], axis=-1), wheels + moved

    def velocity(self, body: FloatArray, wheels: FloatArray, slip: FloatArray) -> FloatArray:
        """(..., 2) velocity of P rolling at these wheel speeds with this creep [m/s]."""
        speed, _ = self._twist(wheels, slip[..., 0], slip[..., 2])
        return np.stack(_velocity(body[..., 2], speed, slip[..., 1]), axis=-1)

    def within_limits(self, wheels: FloatArray, wish: FloatArray) -> FloatArray:
        """(..., 2) the wish, cut to what the servos reach in one period from these setpoints."""
        limit = self.speed_limit_rad_s
        low = np.maximum(wheels - self.reach_rad_s, -limit)
        high = np.minimum(wheels + self.reach_rad_s, limit)
        return np.asarray(np.minimum(np.maximum(wish, low), high))

    def _twist(
        self, wheels: FloatArray, ahead: FloatArray | float, turning: FloatArray | float
    ) -> tuple[FloatArray, FloatArray]:
        """u1 and u2 (Eq. 8-9) plus creep, from wheel speeds; of wheel angles: path and turn."""
        right, left = wheels[..., 0], wheels[..., 1]
        return (
            (0.5 * self._radius) * (right + left) + ahead,
            (self._radius / self._track) * (right - left) + turning,
        )

    def _ramp(self, change: FloatArray, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Change of wheel speed a time after the command, and its integral."""
        duration = np.abs(change) / self._acceleration
        ramping = np.minimum(duration, time_s)
        # sign·(½·A·τ² + |change|·(time − τ)), with A·τ = the change so far
        moved = np.copysign(self._acceleration * ramping, change)
        return moved, moved * (time_s - 0.5 * ramping)

    def _hitch(
        self, rate: FloatArray, angle: FloatArray, turn: FloatArray, step: float
    ) -> FloatArray:
        """θ̇2 after the hitch's spring, and implicit damping and dry friction, for one substep."""
        if self._stiffness:
            rate = rate - step * self._stiffness * angle
        if self._damping or self._friction:
            slide = (rate - turn) / (1.0 + step * self._damping)
            if self._smoothing:
                # linearly implicit: stable at any step
                slide = slide / (1.0 + step * self._friction / np.hypot(slide, self._smoothing))
            elif self._friction:
                # friction takes away its impulse or all of the motion: stiction
                slide = np.copysign(np.maximum(np.abs(slide) - step * self._friction, 0.0), slide)
            rate = turn + slide
        return rate


def _velocity(
    heading: FloatArray, ahead: FloatArray, left: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """A vector of the tractor's frame, in the world's."""
    cos, sin = np.cos(heading), np.sin(heading)
    return cos * ahead - sin * left, sin * ahead + cos * left
