"""Regions of the floor with a friction of their own: wet spots, mats, dust."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.robot import Config
from ttwmr_mj.state import BoolArray, FloatArray

Coordinate = Annotated[float, Field(ge=-100, le=100)]
Size = Annotated[float, Field(ge=1e-12, le=100)]
Friction = Annotated[float, Field(ge=1e-12, le=10)]


class Disc(Config):
    """A round region."""

    shape: Literal["disc"]
    friction: Friction = Field(description="Coulomb coefficient there; 0.9 dry, 0.2 wet")
    x_m: Coordinate = Field(description="of its centre; typically within 1")
    y_m: Coordinate = Field(description="of its centre; typically within 1")
    radius_m: Size = Field(description="typically 0.2")

    def covers(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Whether points of any shape lie in it."""
        return np.asarray(np.hypot(x - self.x_m, y - self.y_m) <= self.radius_m)


class Rectangle(Config):
    """A rectangular region."""

    shape: Literal["rectangle"]
    friction: Friction = Field(description="Coulomb coefficient there; 0.9 dry, 0.2 wet")
    x_m: Coordinate = Field(description="of its centre; typically within 1")
    y_m: Coordinate = Field(description="of its centre; typically within 1")
    length_m: Size = Field(description="along its own x axis; typically 0.5")
    width_m: Size = Field(description="along its own y axis; typically 0.3")
    angle_rad: float = Field(default=0.0, ge=-100, le=100, description="of its x axis, from +x")

    def covers(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Whether points of any shape lie in it."""
        cos, sin = np.cos(self.angle_rad), np.sin(self.angle_rad)
        dx, dy = x - self.x_m, y - self.y_m
        along, across = np.abs(cos * dx + sin * dy), np.abs(cos * dy - sin * dx)
        return np.asarray((along <= 0.5 * self.length_m) & (across <= 0.5 * self.width_m))


Region = Annotated[Disc | Rectangle, Field(discriminator="shape")]


def friction_at(regions: tuple[Region, ...], points: FloatArray, elsewhere: float) -> FloatArray:
    """(nsim, n) friction at points (nsim, n, 2); where regions overlap, the last one's."""
    x, y = points[..., 0], points[..., 1]
    friction = np.broadcast_to(elsewhere, x.shape)
    for region in regions:
        friction = np.where(region.covers(x, y), region.friction, friction)
    return friction
