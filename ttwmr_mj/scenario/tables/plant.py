"""What is driven, and what disturbs it: `[plant]`."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.references.shared.reference import Point
from ttwmr_mj.robot import Config, WhichTrailer

MAX_DURATION_S = 3600.0


class AnalyticOptions(Config):
    """Settings of the analytic plant."""

    same_in_batch: ClassVar[frozenset[str]] = frozenset({"max_step_s"})

    max_step_s: float = Field(
        default=0.011, ge=1e-5, le=0.1, description="longest integration step; typically 0.01"
    )
    published_spring: bool = Field(
        default=False,
        description="divide the torque of the hitch's spring and damper by k, as Eq. 41 is printed",
    )
    extended: ExtendedParameters | None = Field(
        default=None,
        description="a fitted model used instead of the plain one, as `ttwmr compare --fit` "
        "writes it",
    )


class PushOptions(Config):
    """A temporary force on the tractor or a trailer (contact plant only).

    It acts at that chassis' centre of mass, in every control period that starts within its time.
    """

    on: Literal["tractor", "trailer"] = Field(
        default="trailer", description="the body that is pushed"
    )
    trailer: WhichTrailer = 1
    start_s: float = Field(
        ge=0,
        le=MAX_DURATION_S,
        description="simulated time at which the push starts; typically 5 to 15",
    )
    duration_s: float = Field(
        ge=1e-12,
        le=MAX_DURATION_S,
        description="duration of the push, which acts in every control period that begins within "
        "it: at least one period; typically 0.1 to 1",
    )
    force_n: Point = Field(
        description="force (x, y) in the world frame; typically 0.5, the robot's weight is 12 N"
    )
    random_within_s: float = Field(
        default=0.0,
        ge=0,
        le=MAX_DURATION_S,
        description="the start is delayed by a random time, uniform between 0 and this value; the "
        "time of one lap makes all phases equally likely; typically 6",
    )
    random_direction: bool = Field(
        default=False, description="rotate the force by a random angle, uniform over the full turn"
    )


class PlantOptions(Config):
    """What is driven: contact physics or the analytic model, and what disturbs it."""

    kind: Literal["contact", "analytic"] = Field(
        default="contact", description="MuJoCo's contact physics, or the article's equations"
    )
    pushes: Annotated[tuple[PushOptions, ...], Field(strict=False)] = Field(
        default=(),
        max_length=1000,
        description="forces that disturb the robot (contact plant only)",
    )
    contact: ContactOptions = ContactOptions()
    analytic: AnalyticOptions = AnalyticOptions()
