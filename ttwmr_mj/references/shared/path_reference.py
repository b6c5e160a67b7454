"""References of P: a geometric path travelled by a time law."""

from abc import abstractmethod
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.references.shared.time_law import TimeLaw
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

Theta2Option = Literal["aligned", "outward", "none"]

STRAIGHT_PER_M = 1e-9  # curvature below which a path has no outside


class PathReference(Reference):
    """Motion of P along a path p(σ) with σ = σ(t), and the two angles that go with it.

    θ1 is the direction of the path's tangent p'(σ), which exists at standstill too; paths are
    regular (p' ≠ 0) and σ never decreases, so the tractor drives forward. θ2 is chosen by
    name, as Eq. 24 leaves it free:

    - aligned: θ2 = θ1. Behind the tractor; on a curve this is no equilibrium of a free trailer.
    - outward: θ2 = θ1 + (π/2)·sign(curvature). Where a free trailer settles on a circle at
      constant speed, its COM P − l·(cos θ2, sin θ2) outside. NaN where the path is straight; θ2
      jumps by π where the curvature changes sign.
    - none: NaN.

    More trailers are as the first.
    """

    leads_trains: ClassVar[bool] = True
    theta2: Theta2Option = Field(
        default="none",
        description="reference of θ2: along the tractor (aligned), radially outward as a free "
        "trailer settles on a circle (outward), or none",
    )
    ramp_s: float = Field(
        default=0.0,
        ge=0,
        le=600,
        description="duration of the smooth start from rest; typically 1 to 5, 0 starts at "
        "full speed",
    )

    @abstractmethod
    def path_derivatives(self, sigma: FloatArray) -> FloatArray:
        """(5, n, 2) p(σ) [m] and its derivatives by σ to the fourth, at σ (n,)."""

    @abstractmethod
    def time_law(self) -> TimeLaw:
        """σ(t)."""

    def sample(self, time_s: FloatArray, robot: RobotParameters | None = None) -> ReferencePath:
        """The reference at times (n,) [s], with a batch axis of one.

        Angles are unwrapped from sample to sample, so the path must turn by less than π between
        two of them; the first θ1 is in (−π, π].
        """
        trailers = 1 if robot is None else len(robot.trailers)
        time_s = np.asarray(time_s, dtype=np.float64)
        sigma = self.time_law().derivatives(time_s)
        path = self.path_derivatives(sigma[0])
        theta1 = _heading(path, sigma)
        theta2 = theta1 + self._theta2_offset(path)
        # θ2's rates are θ1's, and undefined where θ2 is.
        theta2[1:] = np.where(np.isnan(theta2[0]), np.nan, theta1[1:])
        theta = np.stack([theta1, *[theta2] * trailers], axis=-1)
        return ReferencePath(
            time_s=time_s,
            derivatives=np.moveaxis(compose(path, sigma), 0, 1)[:, None],
            theta=theta[0][:, None],
            theta_rate=theta[1][:, None],
            theta_acceleration=theta[2][:, None],
        )

    def _theta2_offset(self, path: FloatArray) -> FloatArray:
        """(n,) θ2 − θ1 [rad], NaN where undefined."""
        if self.theta2 == "aligned":
            return np.zeros(path.shape[1])
        if self.theta2 == "none":
            return np.full(path.shape[1], np.nan)
        curvature = _cross(path[1], path[2]) / np.hypot(path[1, :, 0], path[1, :, 1]) ** 3
        offset = 0.5 * np.pi * np.sign(curvature)
        return np.where(np.abs(curvature) > STRAIGHT_PER_M, offset, np.nan)


def compose(path: FloatArray, sigma: FloatArray) -> FloatArray:
    """Derivatives by time of p(σ(t)) to the fourth (Faà di Bruno).

    Args:
        path: (5, n, 2) p and its derivatives by σ.
        sigma: (5, n) σ and its derivatives by time.

    Returns:
        (5, n, 2) [m, m/s, ..., m/s⁴].
    """
    p0, p1, p2, p3, p4 = path
    _, s1, s2, s3, s4 = sigma[:, :, None]
    return np.stack(
        [
            p0,
            p1 * s1,
            p2 * s1**2 + p1 * s2,
            p3 * s1**3 + 3.0 * p2 * s1 * s2 + p1 * s3,
            p4 * s1**4 + 6.0 * p3 * s1**2 * s2 + p2 * (3.0 * s2**2 + 4.0 * s1 * s3) + p1 * s4,
        ]
    )


def _heading(path: FloatArray, sigma: FloatArray) -> FloatArray:
    """(3, n) direction of the tangent, unwrapped over the samples, and its two time derivatives."""
    tangent = path[1]
    angle = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    square = (tangent**2).sum(axis=-1)
    turn = _cross(tangent, path[2]) / square
    stretch = (tangent * path[2]).sum(axis=-1) / square
    turn_rate = _cross(tangent, path[3]) / square - 2.0 * turn * stretch
    return np.stack([angle, turn * sigma[1], turn_rate * sigma[1] ** 2 + turn * sigma[2]])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """(n,) z component of a × b for plane vectors (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
