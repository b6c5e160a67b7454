"""Computed torque: from the wheel speeds that a law wants to the wheel torques that give them.

The law's speeds, ramped as a servo would ramp them, are what the wheels shall have at the period's
end, ω_d(k+1). With the wheels' speeds ω by their encoders,

    ω̇ = (ω_d(k+1) − ω_d(k))/T + λ·(ω_d(k) − ω),

and (u̇1, u̇2) of it (Eq. 8-9), the believed robot's Eq. 23 (corrected) says which torques that takes,
held for one period. What a believed gear's friction takes is added.

Stability: at zero model error ω_d − ω decays by 1 − λT in a period, stable for 0 < λT < 2. The
wheels turn on straight ramps over a whole period where a velocity servo is quicker, so that they
are late by up to T/2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S
from ttwmr_mj.dynamics.kinematics import twist_from_wheels, workspace_rate
from ttwmr_mj.dynamics.motor import gear_friction
from ttwmr_mj.dynamics.servo import ramp
from ttwmr_mj.dynamics.torques import inverse_dynamics
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray

FADING_RAD_S = 0.1  # wheel speed below which gear friction is not compensated in full: 3 mm/s


class ComputedTorque(Controller):
    """Any law that commands wheel speeds, made to command wheel torques."""

    def __init__(self, law: Controller, rate_gain_1_s: float) -> None:
        """Wrap a law; the gain is λ."""
        self._law, self._gain = law, rate_gain_1_s

    def start(self, task: Task) -> None:
        """Start the law."""
        self._law.start(task)
        self._task, self._robot = task, task.robot
        self._wanted: FloatArray | None = None

    def command(self, k: int, estimate: Estimate) -> Command:
        """The law's command with wheel torques added."""
        command = self._law.command(k, estimate)
        state, period = estimate.state, self._task.sampling_time_s
        rate = workspace_rate(state.q, state.q_rate)
        speed = estimate.wheel_speed_rad_s
        assert speed is not None, "the loop knows the encoders where torques drive"
        before = speed if self._wanted is None else self._wanted
        after = ramp(before, command.wheel_speed_rad_s, self._robot.servo, np.array([period]))[:, 0]
        self._wanted = after
        wheel_rate = (after - before) / period + self._gain * (before - speed)
        twist_rate = twist_from_wheels(wheel_rate, self._robot)
        gravity = self._task.ground.gravity_m_s2
        wish = inverse_dynamics(state.q, rate, twist_rate, self._robot, gravity)
        servo = self._robot.servo
        if servo.motor is not None:
            wish = wish + gear_friction(after, servo.motor, FADING_RAD_S)
        torque = np.clip(wish, -servo.largest_torque_n_m, servo.largest_torque_n_m)
        return replace(
            command,
            wheel_torque_n_m=torque,
            saturated=command.saturated | (np.abs(wish - torque).max(axis=1) > CUT_RAD_S),
        )
