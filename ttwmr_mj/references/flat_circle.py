"""A circle of the trailer's centre of oscillation at a constant rate."""

from typing import Literal

from pydantic import Field

from ttwmr_mj.references.flat_ellipse import FlatEllipse
from ttwmr_mj.references.shared.flat_reference import FlatReference
from ttwmr_mj.references.shared.reference import Angle, Length, Rate
from ttwmr_mj.state import FloatArray


class FlatCircle(FlatReference):
    """Circle of F, the trailer's centre of oscillation, at a constant rate.

    F = centre + R·(cos φ, sin φ) with φ = phase + ω·t; P is on a circle of |R ∓ k|.

    The hitch angle is constant: ±π/2. Outside with R < k, P runs on the far side of the centre.
    """

    kind: Literal["flat_circle"] = "flat_circle"
    radius_m: Length = Field(description="radius R of the path of F; typically 0.6")
    angular_rate_rad_s: Rate
    phase_rad: Angle = Field(default=0.0, description="angle φ at the start")

    def flat_derivatives(self, time_s: FloatArray) -> FloatArray:
        """(n, 7, 2) F and its derivatives: an ellipse with equal axes."""
        same = self.model_dump(exclude={"kind", "radius_m"})
        axes = (self.radius_m, self.radius_m)
        return FlatEllipse(half_axes_m=axes, **same).flat_derivatives(time_s)
