"""A circle of the trailer's centre of oscillation, or of P, at a constant rate."""

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ttwmr_mj.dynamics.circling import Circling, circling, circling_behind
from ttwmr_mj.references.flat_ellipse import FlatEllipse
from ttwmr_mj.references.shared.flat_reference import FLAT_ORDERS, FlatReference, TurningRate
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Angle, Length
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, hitches_unwound


class FlatCircle(FlatReference):
    """Circle of F, the trailer's centre of oscillation, at a constant rate.

    F = centre + R·(cos φ, sin φ) with φ = phase + ω·t; P is on a circle of |R ∓ k|.

    The hitch angle is constant: ±π/2. Outside with R < k, P runs on the far side of the centre.
    With `circle_of = "P"` it is P that runs on that circle. Any number of trailers can follow,
    wherever their hitches are (`dynamics.circling`): F is then the last one's.
    """

    needs_flat: ClassVar[bool] = False
    kind: Literal["flat_circle"] = "flat_circle"
    radius_m: Length = Field(description="radius R of the path of F; typically 0.6")
    angular_rate_rad_s: TurningRate
    phase_rad: Angle = Field(default=0.0, description="angle φ at the start")
    circle_of: Literal["F", "P"] = Field(
        default="F", description="whose circle has the radius: the last trailer's F, or P"
    )

    def flat_derivatives(self, time_s: FloatArray, orders: int = FLAT_ORDERS) -> FloatArray:
        """(n, orders, 2) F and its derivatives: an ellipse with equal axes."""
        same = self.model_dump(exclude={"kind", "radius_m", "circle_of"})
        axes = (self.radius_m, self.radius_m)
        ellipse = FlatEllipse.model_construct(half_axes_m=axes, **same)  # valid as this one is
        return ellipse.flat_derivatives(time_s, orders)

    def sample(self, time_s: FloatArray, robot: RobotParameters) -> ReferencePath:
        """The reference at times (n,) [s], with a batch axis of one; angles are unwrapped."""
        if self.circle_of == "F" and len(robot.trailers) == 1:
            return super().sample(time_s, robot)
        sides = self.outside(robot)
        around = circling_behind if self.circle_of == "F" else circling
        return self._turning(np.asarray(time_s, np.float64), around(robot, sides, self.radius_m))

    def _turning(self, time_s: FloatArray, shape: Circling) -> ReferencePath:
        rate = self.angular_rate_rad_s
        radius = self.phase_rad + rate * time_s
        ahead = np.copysign(0.5 * np.pi, rate * shape.radius_m)
        start = np.array([ahead, *shape.trailer_rad])
        theta = radius[:, None] + (start - 2.0 * np.pi * np.floor(start / (2.0 * np.pi) + 0.5))
        # the first of each angle in (−π, π]
        theta -= 2.0 * np.pi * np.ceil((theta[:1] - np.pi) / (2.0 * np.pi))
        theta = hitches_unwound(theta)
        turn = radius[:, None] + 0.5 * np.pi * np.arange(5)
        spun = np.asarray(rate ** np.arange(5) * np.exp(1j * turn), dtype=np.complex128)
        whole = np.ones((len(time_s), 1))
        P, F = (
            _plane(np.asarray(spun * centre, np.complex128), self.centre_m)
            for centre in (shape.radius_m, complex(*shape.centre_m))
        )
        return ReferencePath(
            time_s=time_s,
            derivatives=P[:, None],
            theta=theta[:, None],
            theta_rate=(rate * whole * np.ones(theta.shape[1]))[:, None],
            theta_acceleration=np.zeros_like(theta)[:, None],
            flat_derivatives=F[:, None],
        )


def _plane(z: NDArray[np.complex128], centre_m: tuple[float, float]) -> FloatArray:
    points = np.stack([z.real, z.imag], axis=-1)
    points[:, 0] += np.array(centre_m)
    return points
