"""A figure eight: the 1:2 Lissajous curve."""

from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.references.shared.path_reference import PathReference
from ttwmr_mj.references.shared.reference import Angle, Length, Point
from ttwmr_mj.references.shared.time_law import ORDERS, TimeLaw
from ttwmr_mj.state import FloatArray


class FigureEight(PathReference):
    """Horizontal figure eight of P, a 1:2 Lissajous curve (cf. Fig. 19).

    P = centre + (W·sin φ, H·sin 2φ) with φ = phase + 2π·t/period.

    It crosses itself at its centre, where φ = 0 and π; there the curvature
    changes sign. With H = W/2 it is the lemniscate of Gerono. The path parameter σ is the
    phase travelled, φ − phase.
    """

    kind: Literal["figure_eight"] = "figure_eight"
    half_width_m: Length = Field(description="half width W; typically 0.4")
    half_height_m: Length = Field(description="half height H; typically half of W")
    period_s: float = Field(
        ge=1e-12,
        le=3600,
        description="time for one complete figure eight at full rate; typically 60",
    )
    phase_rad: Angle = Field(default=0.0, description="angle φ at the start")
    centre_m: Point = Field(
        default=(0.0, 0.0), description="the point (x, y) where the figure eight crosses itself"
    )

    def path_derivatives(self, sigma: FloatArray) -> FloatArray:
        """(5, n, 2) p and its derivatives by the phase travelled, (n,)."""
        order = np.arange(ORDERS)[:, None]
        phi = self.phase_rad + sigma
        quarter_turns = 0.5 * np.pi * order  # each derivative of a sine is a quarter turn ahead
        x = self.half_width_m * np.sin(phi + quarter_turns)
        y = self.half_height_m * 2.0**order * np.sin(2.0 * phi + quarter_turns)
        path = np.stack([x, y], axis=-1)
        path[0] += self.centre_m
        return path

    def time_law(self) -> TimeLaw:
        """Constant phase rate after the start."""
        return TimeLaw(rate=2.0 * np.pi / self.period_s, ramp_s=self.ramp_s)
