"""The hybrid model over one control period: from wheel commands to the next sample.

What a controller needs to look ahead: the tractor rolls without slip while its wheel servos ramp to
the command and hold it (`dynamics.servo`), the trailer swings (Eq. 24) under the hitch's spring,
damper and dry friction. Small and vectorised over any leading axes; the analytic plant solves the
same equations more exactly.

A disturbance is what the model does not explain: slip of P and of the heading, and extra θ̈2. What
acts on the trailer beside that (`dynamics.floor.influence`) is known with the robot and its floor,
or given to `advance` by who has found it out.

Dry friction sticks where it can. To differentiate the model, use a smooth one instead: with
`smoothing_rad_s` = ε, friction at a hitch rate s is s/√(s² + ε²) of its full size.

The wheels' angles and the heading are exact at the substeps' ends. The swing is integrated by
drift, kick, drift: the kick is the *change of P's velocity*, n·ΔP'/k, exact however sudden, so a
wheel speed may jump. Second order in the substep: with 8 ms and 4 rad/s, relative 4e-5.
"""

import math

import numpy as np

from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.influence import DRAG, DRY, GRAVITY, VISCOUS, held_back, influence_of
from ttwmr_mj.dynamics.hitch import rub
from ttwmr_mj.dynamics.hybrid import sideways
from ttwmr_mj.dynamics.kinematics import rolling, to_body, to_world, wheel_geometry
from ttwmr_mj.dynamics.servo import limit_speed, ramp_and_angle
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

SUBSTEP_S = 0.0085  # four in a period of 33 ms
BODY = 5  # x, y, θ1, θ2, θ̇2
SLIP = 3  # of P ahead and to the left [m/s], of the heading [rad/s]


class SampledModel:
    """One robot's sampled dynamics: (body, wheels) and a command to the next (body, wheels).

    Attributes:
        period_s: T.
        influence: (5,) what acts on the trailer, as far as it is known.
        reach_rad_s: how far a wheel's speed can change in one period.
        speed_limit_rad_s: of a wheel.
    """

    def __init__(
        self,
        robot: RobotParameters,
        period_s: float,
        substep_s: float = SUBSTEP_S,
        smoothing_rad_s: float = 0.0,
        ground: Ground | None = None,
    ) -> None:
        self._servo = servo = robot.servo
        self.period_s = period_s
        self.reach_rad_s = servo.acceleration_limit_rad_s2 * period_s
        self.speed_limit_rad_s = servo.speed_limit_rad_s
        self._wheels = wheel_geometry(robot)
        self._length, self._lean = robot.swing_length_m, robot.lean_rad
        self._robot = robot
        self._stiffness = robot.hitch.stiffness_n_m_rad / robot.swing_inertia_kg_m2  # [1/s²]
        self.influence = influence_of(robot, ground or Ground())
        self._smoothing = smoothing_rad_s
        self._substeps = math.ceil(period_s / substep_s)

    def advance(
        self,
        body: FloatArray,
        wheels: FloatArray,
        command: FloatArray,
        *,
        slip: FloatArray | None = None,
        unexplained: FloatArray | float = 0.0,
        influence: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Hold a command for one period.

        Args:
            body: (..., 5) x, y, θ1, θ2, θ̇2.
            wheels: (..., 2) servo setpoints (right, left) at the start [rad/s].
            command: (..., 2) commanded speeds; the servo's limits apply.
            slip: (..., 3) of P ahead, to the left [m/s] and of the heading [rad/s].
            unexplained: (...) extra θ̈2 [rad/s²], whatever its cause.
            influence: (..., 5) what acts on the trailer; None: what is known of it.

        Returns:
            body and wheels one period later.
        """
        change = limit_speed(command, self._servo) - wheels
        step = self.period_s / self._substeps
        acting = self.influence if influence is None else influence
        gx, gy = np.moveaxis(acting[..., GRAVITY], -1, 0)
        sloping, resisted = bool(gx.any() or gy.any()), bool(acting[..., DRAG].any())
        x, y, theta1, theta2, rate = np.moveaxis(body, -1, 0)
        ahead, left, turning = (0.0, 0.0, 0.0) if slip is None else np.moveaxis(slip, -1, 0)
        speed, turn = self._twist(wheels, ahead, turning)
        vx, vy = to_world(theta1, speed, left)
        angles = np.zeros_like(change)
        for i in range(1, self._substeps + 1):
            moved, angles_now = ramp_and_angle(change, self._servo, i * step)
            arc, turned = self._twist(angles_now - angles + step * wheels, 0.0, 0.0)
            angles = angles_now
            speed, turn = self._twist(wheels + moved, ahead, turning)
            turned = turned + step * turning
            chord = (arc + step * ahead) * (1.0 - turned**2 / 24.0)
            middle = theta1 + 0.5 * turned
            dx, dy = to_world(middle, chord, step * left)
            x, y, theta1 = x + dx, y + dy, theta1 + turned
            new_vx, new_vy = to_world(theta1, speed, left)
            theta2 = theta2 + 0.5 * step * rate
            swung = theta2 - self._lean
            kick = sideways(swung, new_vx - vx, new_vy - vy)
            if sloping:
                kick = kick - step * sideways(swung, gx, gy)
            if resisted:
                along, across = to_body(theta2, new_vx, new_vy)
                across = across - self._robot.trailer.com_offset_m * rate
                kick = kick + step * held_back(acting[..., DRAG], along, across, rate, self._robot)
            rate = rate + kick / self._length + step * unexplained
            rate = self._hitch(rate, theta2 - middle, turn, step, acting)
            theta2 = theta2 + 0.5 * step * rate
            vx, vy = new_vx, new_vy
        return np.stack([x, y, theta1, theta2, rate], axis=-1), wheels + moved

    def velocity(self, body: FloatArray, wheels: FloatArray, slip: FloatArray) -> FloatArray:
        """(..., 2) velocity of P rolling at these wheel speeds with this slip [m/s]."""
        speed, _ = self._twist(wheels, slip[..., 0], slip[..., 2])
        return np.stack(to_world(body[..., 2], speed, slip[..., 1]), axis=-1)

    def within_limits(self, wheels: FloatArray, wish: FloatArray) -> FloatArray:
        """(..., 2) desired speeds, clipped to what the servos reach in one period from `wheels`."""
        limit = self.speed_limit_rad_s
        low = np.maximum(wheels - self.reach_rad_s, -limit)
        high = np.minimum(wheels + self.reach_rad_s, limit)
        return np.asarray(np.minimum(np.maximum(wish, low), high))

    def _twist(
        self, wheels: FloatArray, ahead: FloatArray | float, turning: FloatArray | float
    ) -> tuple[FloatArray, FloatArray]:
        """u1 and u2 (Eq. 8-9) plus slip, from wheel speeds; of wheel angles: path and turn."""
        u1, u2 = rolling(wheels, *self._wheels)
        return u1 + ahead, u2 + turning

    def _hitch(
        self, rate: FloatArray, angle: FloatArray, turn: FloatArray, step: float, acting: FloatArray
    ) -> FloatArray:
        """θ̇2 after the hitch's spring, and implicit damping and dry friction, for one substep."""
        if self._stiffness:
            rate = rate - step * self._stiffness * angle
        damping, friction = acting[..., VISCOUS], acting[..., DRY]
        if damping.any() or friction.any():
            slide = (rate - turn) / (1.0 + step * damping)
            if self._smoothing:
                # linearly implicit: stable at any step
                slide = slide / (1.0 + step * friction / np.hypot(slide, self._smoothing))
            elif friction.any():
                slide = rub(slide, step * friction)
            # as in a batch where others rub: a row alone is not rounded
            rate = np.where(damping + friction > 0.0, turn + slide, rate)
        return rate
