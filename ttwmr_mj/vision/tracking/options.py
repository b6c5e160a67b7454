"""How the tracker weighs what it sees against the commanded wheel speeds."""

from typing import Annotated

from pydantic import Field

from ttwmr_mj.robot import Config

UpTo10 = Annotated[float, Field(ge=1e-12, le=10)]


class TrackerOptions(Config):
    """How labels are looked for and fused with the commanded wheel speeds."""

    # whoever knows centres to less than the tracker's arithmetic repeats would trust nothing else
    label_noise_px: float = Field(
        default=0.0225,
        ge=1e-3,
        le=10,
        description="standard deviation of a label's measured centre; 0.15 in a JPEG video",
    )
    calibration_noise_m: float = Field(
        default=0.00003,
        ge=0,
        le=1,
        description="standard deviation of the remaining calibration error on the floor; "
        "typically 3e-5",
    )
    speed_noise_m_s: UpTo10 = Field(
        default=0.003,
        description="standard deviation of P's speed from the one commanded (slip, servo "
        "error); typically 0.003",
    )
    turn_noise_rad_s: float = Field(
        default=0.02,
        ge=1e-12,
        le=100,
        description="standard deviation of the yaw rate from the one commanded; typically 0.02",
    )
    # motion is linearised over up to 0.04 s, in which the deviations must not fade
    noise_time_s: float = Field(
        default=0.3,
        ge=0.05,
        le=3600,
        description="correlation time of these two deviations; typically 0.3",
    )
    swing_noise_rad_s2: float = Field(
        default=0.5,
        ge=1e-12,
        le=1e3,
        description="standard deviation of the trailer's angular acceleration that the model "
        "does not explain; typically 0.5",
    )
    gate_chi2: float = Field(
        default=18.4,
        ge=1e-12,
        le=1e3,
        description="largest squared normalised innovation of a label that is used; 18.4 "
        "rejects one good label in 10 000",
    )
    max_blind_s: float = Field(
        default=0.15,
        ge=1e-12,
        le=60,
        description="time without labels after which the estimate is invalid; typically 0.15",
    )
    max_position_std_m: UpTo10 = Field(
        default=0.02,
        description="standard deviation of x or y above which the estimate is invalid; "
        "typically 0.02",
    )
    max_angle_std_rad: UpTo10 = Field(
        default=0.2,
        description="standard deviation of θ1 or θ2 above which the estimate is invalid; "
        "typically 0.2",
    )
    learn_latency: bool = Field(
        default=False,
        description="find out on line how much later frames are than told, and make up for it",
    )


# Nobody tells what the wheels of a filmed robot were told: anything they can do must be expected.
# The deviations are all the twist there is, and the model has them decay: a short time would make
# up a deceleration, and with it a torque on the trailers, of which swing_noise takes what is left.
FREE_MOTION = TrackerOptions(
    label_noise_px=0.15,
    speed_noise_m_s=0.4,
    turn_noise_rad_s=4.0,
    noise_time_s=2.0,
    swing_noise_rad_s2=10.0,
)
