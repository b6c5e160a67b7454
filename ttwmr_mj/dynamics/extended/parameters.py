"""What the extended model has beyond Table I, as a scenario gives it or a fit finds it."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.robot import Config, RobotParameters


class ExtendedParameters(Config):
    """What the extended model has beyond Table I, or instead of it. SI units."""

    same_in_batch: ClassVar[frozenset[str]] = frozenset({"physics_step_s"})

    wheel_radius_m: float = Field(
        ge=1e-12, le=1, description="effective wheel radius; Table I: 0.026"
    )
    track_width_m: float = Field(
        ge=1e-12, le=10, description="effective distance between the wheels; Table I: 0.119"
    )
    servo_time_constant_s: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="time constant of the speed loop without load; typically 2e-5",
    )
    slip_time_s: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="side slip of P per centripetal acceleration; typically 7e-4",
    )
    hitch_damping_n_m_s_rad: float = Field(
        default=0.0,
        ge=0,
        le=1e4,
        description="coefficient of every hitch's damper and viscous friction; typically 1e-3",
    )
    hitch_coulomb_friction_n_m: float = Field(
        default=0.0,
        ge=0,
        le=1e3,
        description="torque of every hitch's dry friction; typically below 1e-3",
    )
    caster_mass_kg: float = Field(
        default=0.0, ge=0, le=10, description="mass of one rolling ball; typically 1e-3"
    )
    rolling_resistance_m: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="resisting torque of a ball per normal force; typically below 1e-4",
    )
    physics_step_s: float = Field(
        default=0.0005,
        ge=0,
        le=0.01,
        description="physics step of the contact physics it was fitted to: the wheels lead a "
        "ramp by half of it; typically 5e-4",
    )

    @classmethod
    def expected(cls, robot: RobotParameters) -> ExtendedParameters:
        """What the robot's own parameters lead one to expect; they do not determine side slip."""
        return cls(
            wheel_radius_m=robot.tractor.wheel_radius_m,
            track_width_m=robot.tractor.track_width_m,
            servo_time_constant_s=driven_inertia(robot) / robot.servo.velocity_gain_n_m_s_rad,
            hitch_damping_n_m_s_rad=robot.hitch.damping_n_m_s_rad,
            hitch_coulomb_friction_n_m=robot.hitch.coulomb_friction_n_m,
            caster_mass_kg=robot.casters.mass_kg,
            rolling_resistance_m=robot.casters.rolling_resistance_m,
        )


def driven_inertia(robot: RobotParameters) -> float:
    """Of a wheel and its gears about the axle [kg·m²]."""
    return wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
