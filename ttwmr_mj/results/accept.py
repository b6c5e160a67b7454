"""What a run has to achieve: the limits of `results.verdict`, which a scenario sets in [accept]."""

from typing import Literal

from pydantic import Field

from ttwmr_mj.robot import Config

VerdictName = Literal[
    "followed",
    "tractor_follows_trailer_lost",
    "lost",
    "reference_not_feasible",
    "blind",
    "tipped_over",
    "off_the_ground",
    "saturated_throughout",
    "no_reference",
    "diverged",
    "failed",
    "interrupted",
    "killed",
]
Status = Literal["ok", "diverged", "failed", "interrupted", "killed"]  # how a run ended
SLIPPING_M_S = 0.03  # of a wheel over the ground; creep of tyres that roll is a tenth of that
END_SHARE = 0.2  # of the time is "the last fifth of the run": a lap of the shipped 30 s circles
GROWTH = 1.5  # times its start an error may first reach: the trailer swings as the tractor turns


class AcceptOptions(Config):
    """What counts as followed: the limits of the run's verdict, and the one that is expected."""

    verdict: VerdictName = Field(
        default="followed",
        description="what this scenario is there to show; the limits below decide what it gets",
    )
    end_tractor_m: float = Field(
        default=0.05,
        ge=1e-12,
        le=1e6,
        description="largest distance of P from its reference in the last fifth of the run; "
        "typically 0.05, less than half the track width",
    )
    end_trailer_m: float = Field(
        default=0.05,
        ge=1e-12,
        le=1e6,
        description="the same of the trailer's COM; typically 0.05, a third of l",
    )
    end_theta2_rad: float = Field(
        default=0.2,
        ge=1e-12,
        le=1e6,
        description="largest error of θ2 in the last fifth of the run; typically 0.2: with P in "
        "place it moves the trailer's COM by 28 mm",
    )
    transient_tractor_m: float = Field(
        default=0.35,
        ge=1e-12,
        le=1e6,
        description="largest distance of P from its reference before that, offset of the start "
        "apart; typically 0.35, the robot's length",
    )
    transient_trailer_m: float = Field(
        default=0.35, ge=1e-12, le=1e6, description="the same of the trailer's COM; typically 0.35"
    )
    transient_theta2_rad: float = Field(
        default=1.5,
        ge=1e-12,
        le=1e6,
        description="largest error of θ2 before the end; typically 1.5: at a right angle the "
        "trailer has fallen over",
    )
    settling_share: float = Field(
        default=0.5,
        ge=1e-12,
        le=0.8,
        description="share of the time in which the offset of the start is worked off; "
        "typically 0.5, as the steady_* metrics begin there",
    )
    tilt_rad: float = Field(
        default=0.3,
        ge=1e-12,
        le=1.6,
        description="largest tilt of the tractor against the floor's plane; typically 0.3",
    )
    height_m: float = Field(
        default=0.02,
        ge=1e-12,
        le=1e6,
        description="largest height of P above where it stands; typically 0.02",
    )
    airborne_share: float = Field(
        default=0.3,
        ge=0,
        le=1,
        description="largest share of samples at which a wheel does not touch the ground; "
        "typically 0.3",
    )
    blind_share: float = Field(
        default=0.2,
        ge=0,
        le=1,
        description="largest share of samples at which the sensor is blind; typically 0.2",
    )
    saturated_share: float = Field(
        default=0.9,
        ge=0,
        le=1,
        description="largest share of samples whose command is cut to the servo's range; "
        "typically 0.9: beyond it the law is hardly in command",
    )
