"""A contact run at every physics step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.dynamics.servo import ramp
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.robot import Servo
from ttwmr_mj.state import FloatArray, RobotState


@dataclass(frozen=True, slots=True)
class PhysicsRate:
    """A run of one simulation at its start and after each of n physics steps.

    Attributes:
        time_s: (n + 1,).
        q, q_rate: (n + 1, 4) as in `RobotState`.
        wheel_speed_rad_s: (n + 1, 2) right, left.
        setpoint_rad_s: (n, 2) speeds the servos aim at, in the step that ends at time_s[1:].
    """

    time_s: FloatArray
    q: FloatArray
    q_rate: FloatArray
    wheel_speed_rad_s: FloatArray
    setpoint_rad_s: FloatArray

    @classmethod
    def of(
        cls,
        plant: ContactPlant,
        start: RobotState,
        start_wheels_rad_s: FloatArray,
        commands_rad_s: FloatArray,
        servo: Servo,
    ) -> PhysicsRate:
        """What a plant of one simulation has kept of a run.

        Args:
            plant: told to `keep_physics_rate` before the run.
            start: where it started.
            start_wheels_rad_s: (1, 2) how fast its wheels turned then.
            commands_rad_s: (periods, 2) what it was told.
            servo: of its robot.
        """
        time_s, states, wheels = plant.physics_rate_states()
        steps = len(time_s) // len(commands_rad_s)
        within = plant.time_step_s * np.arange(1, steps + 1, dtype=np.float64)
        setpoints, now = [], start_wheels_rad_s
        for command in commands_rad_s:
            setpoints.append(ramp(now, command[None], servo, within)[0])
            now = setpoints[-1][-1:]
        return cls(
            time_s=np.append(0.0, time_s),
            q=np.concatenate([start.q, states.q[0]]),
            q_rate=np.concatenate([start.q_rate, states.q_rate[0]]),
            wheel_speed_rad_s=np.concatenate([start_wheels_rad_s, wheels[0]]),
            setpoint_rad_s=np.concatenate(setpoints),
        )
