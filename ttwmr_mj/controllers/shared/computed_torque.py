"""Computed torque: from the wheel speeds that a law wants to the wheel torques that give them.

The law's speeds, ramped as a servo would ramp them, are what the wheels shall have at the period's
end, ω_d(k+1), on a straight ramp through the period. The wheels' encoders say how far they have
turned, so with e the error of their angle and ē that of their mean speed in the period before,

    ω̇ = (ω_d(k+1) − ω_d(k))/T + λ·ē + (λ²/4)·e.

With (u̇1, u̇2) of it (Eq. 8-9) and the state that the law believes in, the believed robot's Eq. 23
(corrected) says which torques that takes; they hold for one period. What a believed gear's friction
takes is added.

Stability: with an exact model e decays with the roots of the sampled loop, which are inside the
unit circle for λT < 1.40; at T = 33 ms that is λ < 42 1/s. The wheels turn on straight ramps over a
whole period where a velocity servo is quicker, so that they are late by up to T/2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S
from ttwmr_mj.dynamics.kinematics import twist_from_wheels, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.motor import gear_friction
from ttwmr_mj.dynamics.servo import ramp
from ttwmr_mj.dynamics.torques import inverse_dynamics
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

FADING_RAD_S = 0.1  # wheel speed below which gear friction is not compensated in full: 3 mm/s


class ComputedTorque(Controller):
    """Any law that commands wheel speeds, made to command wheel torques."""

    def __init__(self, law: Controller, rate_gain_1_s: float) -> None:
        """Wrap a law; the gain is λ."""
        self._law, self._gain = law, rate_gain_1_s

    def start(self, task: Task) -> None:
        """Start the law."""
        self._law.start(task)
        self._robot, self._period = task.robot, task.sampling_time_s
        self._ground = task.ground
        self._wheels: WantedWheels | None = None

    def command(self, k: int, estimate: Estimate) -> Command:
        """The law's command with wheel torques added."""
        command, state = self._law.command(k, estimate), estimate.state
        angle = estimate.wheel_angle_rad
        assert angle is not None, "the loop asks the encoders where torques drive"
        if self._wheels is None:
            self._wheels = WantedWheels(angle, _rolling(state, self._robot), self._period)
        ahead = ramp(
            self._wheels.speed,
            command.wheel_speed_rad_s,
            self._robot.servo,
            np.array([self._period]),
        )[:, 0]
        rate = self._wheels.rate(angle, ahead, self._gain)
        wish = self._torque(state, rate, ahead)
        limit = self._robot.servo.largest_torque_n_m
        torque = np.clip(wish, -limit, limit)
        cut = np.abs(wish - torque) > CUT_RAD_S
        self._wheels.move(angle, ahead, cut)
        saturated = command.saturated | cut.any(axis=1)
        return replace(command, wheel_torque_n_m=torque, saturated=saturated)

    def _torque(self, state: RobotState, rate: FloatArray, speed: FloatArray) -> FloatArray:
        """(nsim, 2) torques for wheel accelerations, at wanted wheel speeds."""
        twist_rate = twist_from_wheels(rate, self._robot)
        xi = workspace_rate(state.q, state.q_rate)
        torque = inverse_dynamics(state.q, xi, twist_rate, self._robot, self._ground)
        motor = self._robot.servo.motor
        return torque if motor is None else torque + gear_friction(speed, motor, FADING_RAD_S)


class WantedWheels:
    """How the wheels shall turn, and how far they are from it.

    Attributes:
        speed: (nsim, 2) that they shall have now [rad/s].
    """

    def __init__(self, angle: FloatArray, speed: FloatArray, period_s: float) -> None:
        """Start at encoder angles and speeds (nsim, 2), as if they had long turned like that."""
        self.speed, self._period = speed, period_s
        self._angle, self._mean = angle, speed
        self._before = angle - period_s * speed

    def rate(self, angle: FloatArray, ahead: FloatArray, gain_1_s: float) -> FloatArray:
        """Accelerations (nsim, 2) that lead from encoder angles now to wanted speeds ahead."""
        mean_error = self._mean - (angle - self._before) / self._period
        back = gain_1_s * mean_error + 0.25 * gain_1_s**2 * (self._angle - angle)
        return (ahead - self.speed) / self._period + back

    def move(self, angle: FloatArray, ahead: FloatArray, cut: BoolArray) -> None:
        """Let a period pass; wheels (nsim, 2) whose torque was cut owe no angle."""
        self._mean = 0.5 * (self.speed + ahead)
        self._angle = np.where(cut, angle, self._angle) + self._period * self._mean
        self._before, self.speed = angle, ahead


def _rolling(state: RobotState, robot: RobotParameters) -> FloatArray:
    """(nsim, 2) speeds of wheels that roll under a robot of this state."""
    return wheels_from_twist(workspace_rate(state.q, state.q_rate)[:, :2], robot)
