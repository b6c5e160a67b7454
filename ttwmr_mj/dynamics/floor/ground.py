"""The floor: a plane, level or sloping, and what lies on it.

World coordinates lie in the floor, so on a slope it is gravity that leans: g·cos(slope) presses on
the floor and g·sin(slope) pulls along it, downhill.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from ttwmr_mj.dynamics.floor.regions import Region
from ttwmr_mj.dynamics.floor.terrain import Kerb, Terrain
from ttwmr_mj.dynamics.kinematics import to_body
from ttwmr_mj.robot import Config
from ttwmr_mj.state import FloatArray

GRAVITY_M_S2 = 9.81  # standard gravity, as in MuJoCo


class Pull(NamedTuple):
    """Gravity's pull along the floor, seen from a heading [m/s²]."""

    ahead: FloatArray
    left: FloatArray


class Ground(Config):
    """The floor the robot runs on."""

    slope_rad: float = Field(
        default=0.0, ge=0, le=0.5, description="of the floor; typically 0.01, half a degree"
    )
    downhill_rad: float = Field(
        default=0.0, ge=-100, le=100, description="direction in which the floor falls, from +x"
    )

    regions: Annotated[tuple[Region, ...], Field(strict=False)] = Field(
        default=(),
        max_length=1000,
        description="parts with a friction of their own (contact plant only), the last on top; "
        "elsewhere it is plant.contact.floor_friction",
    )
    terrain: Terrain | None = Field(
        default=None, description="rolling terrain (contact plant only); left out: a plane"
    )
    kerbs: Annotated[tuple[Kerb, ...], Field(strict=False)] = Field(
        default=(), max_length=200, description="plates on the floor (contact plant only)"
    )

    @property
    def gravity_m_s2(self) -> FloatArray:
        """(2,) g_p: what of gravity pulls along the floor."""
        pull = GRAVITY_M_S2 * math.sin(self.slope_rad)
        return pull * np.array([math.cos(self.downhill_rad), math.sin(self.downhill_rad)])

    def pull(self, heading_rad: FloatArray) -> Pull:
        """g_p ahead and to the left of a heading (..., nsim)."""
        x, y = self.gravity_m_s2.T
        return Pull(*to_body(heading_rad, x, y))

    @property
    def normal_gravity_m_s2(self) -> float:
        """What of gravity presses on the floor."""
        return GRAVITY_M_S2 * math.cos(self.slope_rad)


LEVEL = Ground()
