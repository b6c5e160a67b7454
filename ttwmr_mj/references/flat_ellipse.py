"""An ellipse of the trailer's centre of oscillation."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.references.shared.flat_reference import FLAT_ORDERS, FlatReference, TurningRate
from ttwmr_mj.references.shared.reference import Angle, Length
from ttwmr_mj.state import FloatArray


class FlatEllipse(FlatReference):
    """Ellipse of F.

    F = centre + Q·(A·cos φ, B·sin φ) with φ = phase + ω·t, Q a turn by `tilt_rad`.

    F'' = −ω²·(F − centre) points to the centre and vanishes nowhere.
    """

    kind: Literal["flat_ellipse"] = "flat_ellipse"
    half_axes_m: Annotated[tuple[Length, Length], Field(strict=False)] = Field(
        description="half axes A and B of the path of F; typically 0.4 to 0.6"
    )
    angular_rate_rad_s: TurningRate
    phase_rad: Angle = Field(default=0.0, description="angle φ at the start")
    tilt_rad: Angle = Field(
        default=0.0, description="angle of the first axis from the world's x axis"
    )

    def flat_derivatives(self, time_s: FloatArray, orders: int = FLAT_ORDERS) -> FloatArray:
        """(n, orders, 2) F and its derivatives: each ω times the one before, a quarter turn on."""
        rate, order = self.angular_rate_rad_s, np.arange(orders)
        phi = (self.phase_rad + rate * time_s)[:, None] + 0.5 * np.pi * order
        axes = rate**order * np.stack([np.cos(phi), np.sin(phi)])
        axes *= np.array(self.half_axes_m)[:, None, None]
        cos, sin = np.cos(self.tilt_rad), np.sin(self.tilt_rad)
        flat = np.stack([cos * axes[0] - sin * axes[1], sin * axes[0] + cos * axes[1]], axis=-1)
        flat[:, 0] += self.centre_m
        return np.asarray(flat)
