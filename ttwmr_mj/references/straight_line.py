"""A straight line without end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.references.shared.path_reference import Reference
from ttwmr_mj.references.shared.time_law import ORDERS, TimeLaw
from ttwmr_mj.state import FloatArray


@dataclass(frozen=True, kw_only=True)
class StraightLine(Reference):
    """P = start + s·(cos heading, sin heading), the distance s growing at constant speed for ever.

    A line has no outside: with theta2="outward", θ2 is NaN throughout.

    Attributes:
        speed_m_s: speed along the line.
        start_m: (x, y) at the start.
        heading_rad: direction of travel.
    """

    speed_m_s: float
    start_m: tuple[float, float] = (0.0, 0.0)
    heading_rad: float = 0.0

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
