"""The servo of a wheel: its limits and gain, and the motor behind it where one is modelled."""

from typing import Any, Literal

from pydantic import Field, model_validator

from ttwmr_mj.config import Config
from ttwmr_mj.robot.motor import Motor

SERVO_PRESETS: dict[str, dict[str, float]] = {
    # The article names 1.62 N·m holding torque at 12 V and no speed. Servos of that torque class
    # turn 60° in about 0.16 s without load: 6.5 rad/s, 0.17 m/s at the rim. Reaching it in 0.13 s
    # is assumed.
    "lab": {"speed_limit_rad_s": 6.5, "acceleration_limit_rad_s2": 50.0},
    # The article's simulated circle (R = 1 m, 0.5 rad/s) needs 19 rad/s, which no such servo
    # reaches. 100 rad/s² is 2.6 m/s² at the rim, inside the tyres' grip.
    "fast": {"speed_limit_rad_s": 40.0, "acceleration_limit_rad_s2": 100.0},
}


class Servo(Config):
    """One wheel's velocity servo. A preset fills in the limits that are not given."""

    preset: Literal["lab", "fast"] = Field(
        default="lab",
        description="speed and acceleration limits; lab: 6.5 rad/s and 50 rad/s²; fast: 40 "
        "rad/s and 100 rad/s², for the simulated circle",
    )
    stall_torque_n_m: float = Field(
        default=1.62,
        ge=1e-12,
        le=1e3,
        description="largest torque of the servo (at stall); Section 4: 1.62",
    )
    speed_limit_rad_s: float = Field(
        default=6.5, ge=1e-12, le=1e3, description="largest wheel speed; default: the preset's"
    )
    acceleration_limit_rad_s2: float = Field(
        default=50.0,
        ge=1e-12,
        le=1e5,
        description="largest rate of change of the speed setpoint; default: the preset's",
    )
    velocity_gain_n_m_s_rad: float = Field(
        default=10.0,
        ge=1e-12,
        le=1e4,
        description="torque per rad/s of speed error, up to the stall torque; typically 10",
    )
    reflected_inertia_kg_m2: float = Field(
        default=2e-4,
        ge=0,
        le=10,
        description="inertia of motor and gears reflected to the wheel (armature); typically 2e-4",
    )
    motor: Motor | None = Field(
        default=None,
        description="a motor with gear and firmware; left out: an ideal velocity servo",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        preset, motor = given.get("preset"), given.get("motor")
        if preset and isinstance(motor, dict):
            given = {**given, "motor": {"preset": preset, **motor}}
        return {**SERVO_PRESETS.get(str(preset), {}), **given}

    @property
    def largest_torque_n_m(self) -> float:
        """What a standing wheel can get, from the motor if there is one."""
        return self.motor.stall_torque_n_m if self.motor else self.stall_torque_n_m
