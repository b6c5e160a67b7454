"""What the robot is made of: tractor, trailers, hitches and spherical wheels (Table I)."""

import math
from typing import Literal

from pydantic import Field

from ttwmr_mj.config import Config


class Tractor(Config):
    """The differential-drive tractor (Table I), chassis, wheels and caster together."""

    mass_kg: float = Field(
        default=0.9, ge=1e-12, le=1e3, description="m1: mass of the whole tractor; Table I: 0.9"
    )
    yaw_inertia_kg_m2: float = Field(
        default=0.0035,
        ge=1e-12,
        le=1e3,
        description="J1: yaw inertia about the tractor's own COM; Table I: 0.0035",
    )
    com_offset_m: float = Field(
        default=0.029,
        ge=1e-12,
        le=10,
        description="a1: distance from P forward to the COM; Table I: 0.029",
    )
    wheel_radius_m: float = Field(
        default=0.026, ge=1e-4, le=1, description="r: mean radius of the wheels; Table I: 0.026"
    )
    wheel_radius_difference_m: float = Field(
        default=0.0,
        ge=-1,
        le=1,
        description="radius of the right wheel less that of the left, at most r; typically 1e-4",
    )
    track_width_m: float = Field(
        default=0.119, ge=1e-4, le=10, description="2b: distance between the wheels; Table I: 0.119"
    )
    wheel_mass_kg: float = Field(
        default=0.03,
        ge=1e-9,
        le=100,
        description="mass of one wheel, included in m1; assumed: 0.03",
    )
    wheel_half_width_m: float = Field(
        default=0.006, ge=1e-12, le=1, description="half the width of a tyre; assumed: 0.006"
    )
    wheel_shape: Literal["ellipsoid", "cylinder"] = Field(
        default="ellipsoid",
        description="shape of the tyres: an ellipsoid touches the floor at a point, a "
        "cylinder along a line, which scrubs in turns",
    )

    @property
    def wheel_radii_m(self) -> tuple[float, float]:
        """Of the right wheel and of the left."""
        half = 0.5 * self.wheel_radius_difference_m
        return self.wheel_radius_m + half, self.wheel_radius_m - half


class Trailer(Config):
    """A trailer (Table I), with its two spherical wheels."""

    mass_kg: float = Field(
        default=0.33, ge=1e-9, le=1e3, description="m2: mass of the whole trailer; Table I: 0.33"
    )
    yaw_inertia_kg_m2: float = Field(
        default=0.00078,
        ge=1e-12,
        le=1e3,
        description="J2: yaw inertia about the trailer's own COM; Table I: 0.00078",
    )
    com_offset_m: float = Field(
        default=0.141,
        ge=1e-9,
        le=10,
        description="l: distance from its hitch backward to the COM; Table I: 0.141",
    )
    com_lateral_m: float = Field(
        default=0.0,
        ge=-10,
        le=10,
        description="distance of the COM from the trailer's axis to its left; at most to a "
        "caster, typically 0.005",
    )
    next_hitch_offset_m: float | None = Field(
        default=None,
        ge=1e-12,
        le=10,
        description="distance from its hitch backward to the next trailer's hitch; required "
        "if another trailer follows",
    )

    @property
    def swing_length_m(self) -> float:
        """K = l + J2/(m2·l) (Eq. 24): from its hitch to its centre of oscillation."""
        return self.com_distance_m + self.yaw_inertia_kg_m2 / (self.mass_kg * self.com_distance_m)

    @property
    def swing_inertia_kg_m2(self) -> float:
        """J2 + m2·l² = m2·l·k (Eq. 17): its yaw inertia about its hitch."""
        return self.yaw_inertia_kg_m2 + self.mass_kg * self.com_distance_m**2

    @property
    def com_distance_m(self) -> float:
        """From its hitch to its COM: l of every equation, where the load is not on the axis."""
        return math.hypot(self.com_offset_m, self.com_lateral_m)

    @property
    def lean_rad(self) -> float:
        """β: the COM is on the line from the hitch in the direction of θ2 − β, behind it."""
        return math.atan2(self.com_lateral_m, self.com_offset_m)


class Hitch(Config):
    """A trailer's revolute joint, the first at P.

    It may have a torsion spring and damper (Eq. 38-43), and friction.
    """

    stiffness_n_m_rad: float = Field(
        default=0.0,
        ge=0,
        le=1e4,
        description="k_t: stiffness of a torsion spring that is relaxed when the trailer is "
        "aligned; typically 0 to 10",
    )
    damping_n_m_s_rad: float = Field(
        default=0.0,
        ge=0,
        le=1e4,
        description="c_t: coefficient of damper and viscous friction; typically 0.001",
    )
    play_m: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="radial clearance of the pin in its hole (contact plant only); typically 2e-4",
    )
    gimballed: bool = Field(
        default=False,
        description="the trailer may also pitch and roll on it (contact plant only), so that "
        "wheels and balls all touch uneven ground",
    )
    coulomb_friction_n_m: float = Field(
        default=0.0,
        ge=0,
        le=1e3,
        description="torque of dry friction, independent of the rate; typically 0.001",
    )


class Casters(Config):
    """The spherical wheels: one under the tractor's nose, two under the trailer."""

    radius_m: float = Field(
        default=0.008, ge=1e-4, le=1, description="radius of one ball; assumed: 0.008"
    )
    mass_kg: float = Field(
        default=0.001,
        ge=1e-9,
        le=10,
        description="mass of one ball, included in its body's mass; assumed: 0.001",
    )
    rolling_resistance_m: float = Field(
        default=0.0, ge=0, le=0.1, description="resisting torque per normal force; typically 1e-4"
    )
    socket_friction_n_m: float = Field(
        default=0.0, ge=0, le=10, description="dry torque of a ball in its socket; typically 1e-4"
    )
    tractor_position_m: float = Field(
        default=0.075,
        ge=1e-12,
        le=10,
        description="distance from P forward to the tractor's caster; assumed: 0.075",
    )
    trailer_half_spacing_m: float = Field(
        default=0.05,
        ge=1e-12,
        le=10,
        description="distance from the trailer's axis to each of its casters; assumed: 0.05",
    )
