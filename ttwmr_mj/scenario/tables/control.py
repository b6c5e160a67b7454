"""The sampled loop: `[control]`."""

from typing import Literal

from pydantic import Field

from ttwmr_mj.robot import Config
from ttwmr_mj.sensing import Lost

LONGEST_START_S = 86_400.0


class ControlOptions(Config):
    """The sampled loop."""

    sampling_time_s: float = Field(
        default=0.033,
        ge=1e-6,
        le=10,
        description="control period, the time between commands; Section 4: 0.033",
    )
    controller_time_limit_s: float = Field(
        default=10.0,
        ge=1e-12,
        le=3600,
        description="CPU time after which a command times out and the run ends as failed; "
        "a law that plans may take a second, several on a busy machine. The limit in wall time is "
        "15 times as long, for a controller that waits",
    )
    controller_start_limit_s: float = Field(
        default=60.0,
        ge=1e-12,
        le=LONGEST_START_S,
        description="the same for importing and making a law, and for starting it; the latter in "
        "proportion longer where the run has more than 5,000 periods",
    )
    inner_loop: Literal["velocity_servo", "computed_torque", "torque"] = Field(
        default="velocity_servo",
        description="what drives the wheels; velocity_servo: servos that follow the law's wheel "
        "speeds; computed_torque: torques that Eq. 23 asks for these speeds; torque: torques that "
        "a user's own law gives",
    )
    rate_gain_1_s: float = Field(
        default=20.0,
        ge=0,
        le=1e4,
        description="λ of computed_torque: rate at which the wheels return to the angles they "
        "should have; typically 20, stable below 1.4 / sampling_time_s",
    )
    command_latency_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="time from a sample until the servos receive its command, a whole number of "
        "physics steps (plant.contact.timestep_s) on both plants; typically 0.01",
    )
    command_jitter_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="largest additional latency of a command; the value is a random whole number "
        "of control periods, uniform from 0; overtaken commands are discarded; typically 0.033",
    )
    command_drop_probability: Lost = Field(
        default=0.0,
        description="probability that a command is lost, so that the servos hold the last one; "
        "typically 0.02",
    )

    @property
    def torque_input(self) -> bool:
        """Whether wheel torques drive the robot, not wheel speeds."""
        return self.inner_loop != "velocity_servo"
