"""Settings of the references a free trailer can follow, as a scenario gives them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from ttwmr_mj.robot import Config

Point = Annotated[tuple[float, float], Field(strict=False)]
HalfAxis = Annotated[float, Field(gt=0, le=100)]
Angle = Annotated[float, Field(ge=-100.0, le=100.0)]
Rate = Annotated[float, Field(ge=-50, le=50, description="positive: counter-clockwise")]


class _FlatReference(Config):
    """What every reference of the trailer's centre of oscillation has."""

    side: Literal["outside", "inside"] = Field(
        default="outside", description="where the trailer is, seen from P; inside is unstable"
    )
    centre_m: Point = (0.0, 0.0)


class FlatCircleReference(_FlatReference):
    """Circle of the trailer's centre of oscillation."""

    kind: Literal["flat_circle"]
    radius_m: float = Field(gt=0, le=100)
    angular_rate_rad_s: Rate
    phase_rad: Angle = 0.0


class FlatArcReference(_FlatReference):
    """Arc of the trailer's centre of oscillation, slow at both ends; then slowly on."""

    kind: Literal["flat_arc"]
    radius_m: float = Field(gt=0, le=100)
    angles_rad: Annotated[tuple[Angle, Angle], Field(strict=False)] = Field(
        description="where it begins and ends; their order gives the sense"
    )
    rest_rate_rad_s: float = Field(
        default=0.3, gt=0, le=50, description="at both ends and after them; never zero"
    )
    peak_rate_rad_s: float = Field(gt=0, le=50, description="in the middle")

    @field_validator("angles_rad")
    @classmethod
    def _two_angles(cls, given: tuple[float, float]) -> tuple[float, float]:
        if given[0] == given[1]:
            raise ValueError("two different angles")
        return given


class PlannedReference(Config):
    """A shipped plan, found by trajectory optimisation."""

    kind: Literal["planned"]
    plan: str = Field(description="figure_eight, rest_to_rest, ...; see ttwmr_mj/references/data")


class FlatEllipseReference(_FlatReference):
    """Ellipse of the trailer's centre of oscillation."""

    kind: Literal["flat_ellipse"]
    half_axes_m: Annotated[tuple[HalfAxis, HalfAxis], Field(strict=False)]
    angular_rate_rad_s: Rate
    phase_rad: Angle = 0.0
    tilt_rad: Angle = 0.0
