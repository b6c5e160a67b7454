"""Where a run starts: `[initial]`."""

from typing import Annotated, Literal

from pydantic import Field

from ttwmr_mj.references.shared.reference import Angle
from ttwmr_mj.robot import Config

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]


class AtRest(Config):
    """Start standing still at a pose; Table II's (0.6, −0.3) m is the default."""

    kind: Literal["at_rest"] = "at_rest"
    x_m: Coordinate = Field(default=0.6, description="x of P at the start; typically -1 to 1")
    y_m: Coordinate = Field(default=-0.3, description="y of P at the start; typically -1 to 1")
    theta1_rad: Angle = Field(
        default=0.0, description="heading of the tractor at the start, from +x"
    )
    theta2_rad: Angle = Field(
        default=0.0,
        description="heading of the trailer at the start; equal to theta1_rad if aligned",
    )
    more_trailers_rad: Annotated[tuple[Angle, ...], Field(strict=False)] = Field(
        default=(),
        description="headings of the trailers behind the first; left out: theta2_rad, all of them",
    )


class OnReference(Config):
    """Start on the reference, moving with it, except for these offsets."""

    kind: Literal["on_reference"]
    x_offset_m: Coordinate = Field(
        default=0.0, description="offset of P in x from the reference; typically 0.1"
    )
    y_offset_m: Coordinate = Field(
        default=0.0, description="offset of P in y from the reference; typically 0.1"
    )
    theta1_offset_rad: Angle = Field(
        default=0.0,
        description="offset of the tractor's heading, and with it of its velocity, from the "
        "reference; typically 0.2",
    )
    theta2_offset_rad: Angle = Field(
        default=0.0,
        description="offset of the trailer's heading from the reference of θ2, or from θ1 if "
        "there is none; typically 0.2",
    )
    more_trailers_offset_rad: Annotated[tuple[Angle, ...], Field(strict=False)] = Field(
        default=(), description="the same of the trailers behind the first; left out: none"
    )


Initial = Annotated[AtRest | OnReference, Field(discriminator="kind")]
