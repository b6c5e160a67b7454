"""A straight line without end."""

from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.references.shared.path_reference import PathReference
from ttwmr_mj.references.shared.reference import Angle, Point
from ttwmr_mj.references.shared.time_law import ORDERS, TimeLaw
from ttwmr_mj.state import FloatArray


class StraightLine(PathReference):
    """Straight line of P at constant speed, without end.

    P = start + s·(cos heading, sin heading), with s growing at `speed_m_s`.

    A line has no outside: with theta2="outward", θ2 is NaN throughout.
    """

    kind: Literal["straight_line"] = "straight_line"
    speed_m_s: float = Field(
        ge=1e-12, le=100, description="speed along the line; typically 0.1 to 0.5"
    )
    start_m: Point = Field(default=(0.0, 0.0), description="the point (x, y) where the line begins")
    heading_rad: Angle = Field(default=0.0, description="direction of travel, from +x")

    def path_derivatives(self, sigma: FloatArray) -> FloatArray:
        """(5, n, 2) p and its derivatives by the distance travelled, (n,) [m]."""
        direction = np.array([np.cos(self.heading_rad), np.sin(self.heading_rad)])
        path = np.zeros((ORDERS, sigma.size, 2))
        path[0] = self.start_m + sigma[:, None] * direction
        path[1] = direction
        return path

    def time_law(self) -> TimeLaw:
        """Constant speed after the start."""
        return TimeLaw(rate=self.speed_m_s, ramp_s=self.ramp_s)
