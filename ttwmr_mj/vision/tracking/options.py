"""How the tracker weighs what it sees against what the wheels were told."""

from __future__ import annotations

from pydantic import Field

from ttwmr_mj.robot import Config


class TrackerOptions(Config):
    """How labels are looked for and fused with the commanded wheel speeds."""

    label_noise_px: float = Field(
        default=0.0225,
        gt=0,
        le=10,
        description="standard deviation of a label's centre along one axis; 0.15 in a JPEG video",
    )
    calibration_noise_m: float = Field(
        default=0.00003,
        ge=0,
        le=1,
        description="standard deviation of a label's position that the calibration leaves",
    )
    speed_noise_m_s: float = Field(
        default=0.003,
        gt=0,
        le=10,
        description="standard deviation of P's speed from what the wheels say: slip, servo error",
    )
    turn_noise_rad_s: float = Field(
        default=0.02,
        gt=0,
        le=100,
        description="standard deviation of the tractor's yaw rate from what the wheels say",
    )
    noise_time_s: float = Field(
        default=0.3, gt=0, le=3600.0, description="correlation time of these two deviations"
    )
    swing_noise_rad_s2: float = Field(
        default=0.5,
        gt=0,
        le=1e3,
        description="standard deviation of the trailer's angular acceleration from the hitch model",
    )
    gate_chi2: float = Field(
        default=18.4,
        gt=0,
        le=1e3,
        description="labels with a larger squared normalised innovation are ignored; 18.4 passes "
        "99.99 % of good ones",
    )
    max_blind_s: float = Field(
        default=0.15,
        gt=0,
        le=60,
        description="after so long without labels the estimate is invalid; a few control periods",
    )
    max_position_std_m: float = Field(
        default=0.02,
        gt=0,
        le=10,
        description="the estimate is invalid where x or y has a larger standard deviation",
    )
    max_angle_std_rad: float = Field(
        default=0.2,
        gt=0,
        le=10,
        description="the estimate is invalid where θ1 or θ2 has a larger standard deviation",
    )
