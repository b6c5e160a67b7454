"""A circle at constant angular rate."""

from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.references.shared.path_reference import PathReference
from ttwmr_mj.references.shared.reference import Angle, Length, Point, Rate
from ttwmr_mj.references.shared.time_law import ORDERS, TimeLaw
from ttwmr_mj.state import FloatArray


class Circle(PathReference):
    """Circle of P at a constant rate (Eq. 37 and 72-73).

    P = centre + R·(cos φ, sin φ) with φ = phase + ω·t.

    The article's circles: Eq. 37 has R = 1 m, ω = 0.5 rad/s, phase 0; Eq. 72-73 have R = 0.43 m,
    ω = 1/8 rad/s, phase 0.35 rad. The path parameter σ is the angle travelled, |ω|·t.
    """

    kind: Literal["circle"] = "circle"
    radius_m: Length = Field(description="radius R; 0.43 in the laboratory, 1 in the simulation")
    angular_rate_rad_s: Rate
    phase_rad: Angle = Field(default=0.0, description="angle φ on the circle at the start")
    centre_m: Point = Field(default=(0.0, 0.0), description="centre of the circle (x, y)")

    def path_derivatives(self, sigma: FloatArray) -> FloatArray:
        """(5, n, 2) p and its derivatives by the angle travelled, (n,)."""
        sense = np.copysign(1.0, self.angular_rate_rad_s)
        phi = self.phase_rad + sense * sigma
        radial = self.radius_m * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
        tangential = sense * np.stack([-radial[:, 1], radial[:, 0]], axis=-1)
        path = np.stack([radial, tangential, -radial, -tangential, radial][:ORDERS])
        path[0] += self.centre_m
        return path

    def time_law(self) -> TimeLaw:
        """Constant angular rate after the start."""
        return TimeLaw(rate=abs(self.angular_rate_rad_s), ramp_s=self.ramp_s)
