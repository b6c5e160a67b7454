"""A circle of the trailer's centre of oscillation at a constant rate."""

from __future__ import annotations

from dataclasses import dataclass

from ttwmr_mj.references.flat_ellipse import FlatEllipse
from ttwmr_mj.references.shared.flat_reference import FlatReference
from ttwmr_mj.state import FloatArray


@dataclass(frozen=True, kw_only=True)
class FlatCircle(FlatReference):
    """F = centre + R·(cos φ, sin φ) with φ = phase + ω·t; P on a circle of |R ∓ k|.

    The hitch angle is constant: ±π/2. Outside with R < k, P runs on the far side of the centre.

    Attributes:
        radius_m: R, of F.
        angular_rate_rad_s: ω; negative runs clockwise.
        phase_rad: φ at the start.
        centre_m: (x, y).
    """

    radius_m: float
    angular_rate_rad_s: float
    phase_rad: float = 0.0
    centre_m: tuple[float, float] = (0.0, 0.0)

    def flat_derivatives(self, time_s: FloatArray) -> FloatArray:
        """(n, 7, 2) F and its derivatives: an ellipse with equal axes."""
        ellipse = FlatEllipse(
            robot=self.robot,
            half_axes_m=(self.radius_m, self.radius_m),
            angular_rate_rad_s=self.angular_rate_rad_s,
            phase_rad=self.phase_rad,
            centre_m=self.centre_m,
        )
        return ellipse.flat_derivatives(time_s)
