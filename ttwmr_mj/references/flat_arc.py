"""An arc of the trailer's centre of oscillation: slow at its ends, fast in its middle."""

from math import comb
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import Field, field_validator

from ttwmr_mj.references.shared.flat_reference import FLAT_ORDERS, FlatReference
from ttwmr_mj.references.shared.reference import Angle, Length
from ttwmr_mj.state import FloatArray

# 0 at both ends with five derivatives, 1 in the middle: the angle is C⁶, as many as F needs
BUMP = Polynomial([0.0, 4.0, -4.0]) ** 6
BUMP_INTEGRAL = BUMP.integ()


class FlatArc(FlatReference):
    """Arc of F, slow at both ends, then onward at the low rate.

    F = centre + R·(cos φ, sin φ), φ from one angle to another and on.

    φ̇ = ±(r + (p − r)·bump(t/T)), with T such that the arc takes exactly T; outside of it φ̇ = ±r.
    As r > 0 the centripetal part Rφ̇² of F'' vanishes nowhere, whatever the tangential one; but θ2
    is the direction of F'', so an r much smaller than p requires quick turns
    (`references.shared.feasibility`).
    """

    leads_trains: ClassVar[bool] = False  # it has six derivatives only
    kind: Literal["flat_arc"] = "flat_arc"
    radius_m: Length = Field(description="radius R of the path of F; typically 0.6")
    angles_rad: Annotated[tuple[Angle, Angle], Field(strict=False)] = Field(
        description="angles φ where the arc begins and ends; their order gives the direction"
    )
    rest_rate_rad_s: float = Field(
        default=0.3,
        ge=1e-12,
        le=50,
        description="rate r at both ends and beyond the end; never zero, typically 0.3",
    )
    peak_rate_rad_s: float = Field(ge=1e-12, le=50, description="rate p in the middle; typically 1")

    @field_validator("angles_rad")
    @classmethod
    def _two_angles(cls, given: tuple[float, float]) -> tuple[float, float]:
        if given[0] == given[1]:
            raise ValueError("two different angles are needed")
        return given

    @property
    def duration_s(self) -> float:
        """T."""
        rest, mean = self.rest_rate_rad_s, float(BUMP_INTEGRAL(1.0))
        angle = abs(self.angles_rad[1] - self.angles_rad[0])
        return angle / (rest + (self.peak_rate_rad_s - rest) * mean)

    def flat_derivatives(self, time_s: FloatArray, orders: int = FLAT_ORDERS) -> FloatArray:
        """(n, 7, 2) F and its derivatives, from z = R·exp(iφ): z' = iφ̇·z, by Leibniz' rule."""
        assert orders == FLAT_ORDERS, "`leads_trains` says so"
        phi = self._angle(time_s)
        z = np.empty((FLAT_ORDERS, time_s.size), dtype=np.complex128)
        z[0] = self.radius_m * np.exp(1j * phi[0])
        for n in range(FLAT_ORDERS - 1):
            z[n + 1] = 1j * sum(comb(n, j) * phi[j + 1] * z[n - j] for j in range(n + 1))
        z[0] += complex(*self.centre_m)
        return np.stack([z.real.T, z.imag.T], axis=-1)

    def _angle(self, time_s: FloatArray) -> FloatArray:
        """(7, n) φ and its derivatives."""
        start, stop = self.angles_rad
        rest, more = self.rest_rate_rad_s, self.peak_rate_rad_s - self.rest_rate_rad_s
        T = self.duration_s
        share = np.clip(time_s / T, 0.0, 1.0)
        angle = np.zeros((FLAT_ORDERS, time_s.size))
        angle[0] = rest * time_s + more * T * BUMP_INTEGRAL(share)
        angle[1] = rest + more * BUMP(share)
        for order in range(2, FLAT_ORDERS):
            angle[order] = more * BUMP.deriv(order - 1)(share) / T ** (order - 1)
        angle *= np.sign(stop - start)
        angle[0] += start
        return angle
