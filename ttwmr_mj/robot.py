"""The robot's numbers: Table I of the article and what it leaves open, each with its source.

Every model in this package, analytic or MuJoCo, is built from one `RobotParameters`. Values are
checked here, at the border; inside, they are trusted.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class Config(BaseModel):
    """Base of every configuration: frozen, strict about types, closed to unknown keys."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True
    )


class Tractor(Config):
    """The differential-drive tractor (Table I), chassis, wheels and caster together."""

    mass_kg: float = Field(default=0.9, gt=0, le=1e3, description="m1, Table I")
    yaw_inertia_kg_m2: float = Field(
        default=0.0035, gt=0, le=1e3, description="J1 about the tractor's own COM, Table I"
    )
    com_offset_m: float = Field(
        default=0.029, gt=0, le=10, description="a1: from P forward to the COM, Table I"
    )
    wheel_radius_m: float = Field(default=0.026, gt=0, le=1, description="r, Table I")
    track_width_m: float = Field(
        default=0.119, gt=0, le=10, description="2b: distance between the wheels, Table I"
    )
    wheel_mass_kg: float = Field(
        default=0.03, gt=0, le=100, description="of one wheel; part of m1 (assumed: 52 mm wheel)"
    )
    wheel_half_width_m: float = Field(
        default=0.006, gt=0, le=1, description="half width of a wheel's tyre (assumed)"
    )
    wheel_shape: Literal["ellipsoid", "cylinder"] = Field(
        default="ellipsoid",
        description="an ellipsoid touches in a point, a cylinder along a line that scrubs",
    )


class Trailer(Config):
    """The trailer (Table I), with its two spherical wheels."""

    mass_kg: float = Field(default=0.33, gt=0, le=1e3, description="m2, Table I")
    yaw_inertia_kg_m2: float = Field(
        default=0.00078, gt=0, le=1e3, description="J2 about the trailer's own COM, Table I"
    )
    com_offset_m: float = Field(
        default=0.141, gt=0, le=10, description="l: from P backward to the COM, Table I"
    )


class Hitch(Config):
    """The revolute joint at P: an optional torsion spring and damper (Eq. 38-43), and friction."""

    stiffness_n_m_rad: float = Field(
        default=0.0, ge=0, le=1e4, description="k_t: torque per hitch angle, at rest when aligned"
    )
    damping_n_m_s_rad: float = Field(
        default=0.0, ge=0, le=1e4, description="c_t: damper and viscous friction together"
    )
    coulomb_friction_n_m: float = Field(
        default=0.0, ge=0, le=1e3, description="dry friction torque, whatever the rate"
    )


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
        default="lab", description="lab: 6.5 rad/s; fast: 40 rad/s, for the simulated circle"
    )
    stall_torque_n_m: float = Field(default=1.62, gt=0, le=1e3, description="Section 4")
    speed_limit_rad_s: float = Field(default=6.5, gt=0, le=1e3)
    acceleration_limit_rad_s2: float = Field(default=50.0, gt=0, le=1e5)
    velocity_gain_n_m_s_rad: float = Field(
        default=10.0, gt=0, le=1e4, description="torque per rad/s of speed error, up to stall"
    )
    reflected_inertia_kg_m2: float = Field(
        default=2e-4, ge=0, le=10, description="motor and gears, seen at the wheel (armature)"
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        return {**SERVO_PRESETS.get(given.get("preset", "lab"), {}), **given}


class Casters(Config):
    """The spherical wheels: one under the tractor's nose, two under the trailer."""

    radius_m: float = Field(default=0.008, gt=0, le=1)
    mass_kg: float = Field(
        default=0.001, gt=0, le=10, description="of one ball; part of its body's mass"
    )
    rolling_resistance_m: float = Field(
        default=0.0, ge=0, le=0.1, description="resisting torque per normal force"
    )
    tractor_position_m: float = Field(
        default=0.075, gt=0, le=10, description="of the nose caster, forward of P"
    )
    trailer_half_spacing_m: float = Field(
        default=0.05, gt=0, le=10, description="of the trailer's casters, under its COM"
    )


class RobotParameters(Config):
    """All numbers of the robot, SI units (Table I and stated assumptions)."""

    tractor: Tractor = Tractor()
    trailer: Trailer = Trailer()
    hitch: Hitch = Hitch()
    servo: Servo = Servo()
    casters: Casters = Casters()

    @property
    def swing_length_m(self) -> float:
        """K = l + J2/(m2·l) (Eq. 24): from P to the trailer's centre of oscillation."""
        trailer = self.trailer
        return trailer.com_offset_m + trailer.yaw_inertia_kg_m2 / (
            trailer.mass_kg * trailer.com_offset_m
        )

    @property
    def swing_inertia_kg_m2(self) -> float:
        """J2 + m2·l² = m2·l·k (Eq. 17): the trailer's yaw inertia about P."""
        trailer = self.trailer
        return trailer.yaw_inertia_kg_m2 + trailer.mass_kg * trailer.com_offset_m**2

    @property
    def half_track_m(self) -> float:
        """b: half the distance between the wheels (Table I)."""
        return 0.5 * self.tractor.track_width_m
