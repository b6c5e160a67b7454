"""Settings of the controllers that steer the trailer, as a scenario gives them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ttwmr_mj.robot import Config


class ObserverOptions(Config):
    """What the observer believes of its measurements and of the model's gaps.

    Standard deviations per sample, and of random walks per square root of a second. The defaults
    are those of an overhead camera; they cost little where the measurement is better than that.
    """

    position_std_m: float = Field(default=2e-4, gt=0, le=1, description="of a measured x or y")
    angle_std_rad: float = Field(default=1e-3, gt=0, le=1, description="of a measured angle")
    velocity_std_m_s: float = Field(default=0.01, gt=0, le=10, description="of ẋ, ẏ")
    rate_std_rad_s: float = Field(default=0.05, gt=0, le=100, description="of θ̇1, θ̇2")
    creep_walk_m_s: float = Field(
        default=2e-3, gt=0, le=10, description="how fast the tyres' creep may change, per √s"
    )
    turn_creep_walk_rad_s: float = Field(
        default=5e-3, gt=0, le=10, description="the same for the heading, per √s"
    )
    swing_walk_rad_s2: float = Field(
        default=0.05, gt=0, le=100, description="how fast an unknown θ̈2 may change, per √s"
    )


class FrictionOptions(Config):
    """What a controller makes up for of the hitch's dry friction."""

    dry: Literal["ignored", "model"] = Field(
        default="model", description="ignored, or compensated with the robot's own figure"
    )
    believed_share: float = Field(
        default=1.0, ge=0, le=10, description="of the robot's own figure: 0.7 believes 30 % less"
    )
    smoothing_rad_s: float = Field(
        default=0.05, gt=0, le=10, description="hitch rate at which friction counts as full"
    )


class FlatnessController(Config):
    """Dynamic feedback linearisation of the trailer's centre of oscillation."""

    kind: Literal["flatness"]
    bandwidth_per_s: float | None = Field(
        default=None,
        gt=0,
        le=30,
        description="λ: the error obeys (s + λ)⁴, nearly; left out: 3.5 times the mean turn rate "
        "of the reference's trailer",
    )
    integral_share: float = Field(
        default=0.15, ge=0, le=0.5, description="κ: the error's integral settles at κλ"
    )
    least_acceleration_share: float = Field(
        default=0.3, gt=0, le=1, description="of the reference's |F''|; less makes θ2 undefined"
    )
    friction: FrictionOptions = FrictionOptions()
    observer: ObserverOptions = ObserverOptions()


class TrackingWeights(Config):
    """Scales of the tracking errors: one scale of one costs as much as one scale of another."""

    position_scale_m: float = Field(
        default=0.01, gt=0, le=10, description="of the trailer's centre of oscillation"
    )
    angle_scale_rad: float = Field(default=0.2, gt=0, le=100, description="of θ1 and θ2")
    change_scale_rad_s: float = Field(
        default=0.5, gt=0, le=1e3, description="of a wheel command's change in a period"
    )


class TvlqrController(Config):
    """Time-varying linear-quadratic control along any feasible reference."""

    kind: Literal["tvlqr"]
    weights: TrackingWeights = TrackingWeights()
    disturbance_time_s: float = Field(
        default=10.0, gt=0, le=1e4, description="how long a disturbance is taken to last"
    )
    friction: FrictionOptions = FrictionOptions()
    observer: ObserverOptions = ObserverOptions()


class MpcController(TvlqrController):
    """Model predictive control along any feasible reference."""

    kind: Literal["mpc"]  # type: ignore[assignment]  # the tag of another law
    horizon_samples: int = Field(default=30, ge=2, le=60, description="control periods ahead")
