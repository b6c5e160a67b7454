"""References a free trailer can follow: given as paths of its centre of oscillation F."""

from abc import abstractmethod
from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.dynamics.flatness import motion_from_flat
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Point, Reference
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

FLAT_ORDERS = 7  # F and six derivatives: they give P and both angles to the fourth


class FlatReference(Reference):
    """Motion of F whose acceleration never vanishes; the rest follows by flatness.

    The trailer may point either way along F'' (`dynamics.flatness`). Outside, P runs between F and
    the centre of curvature and the trailer's swing is stable; inside, P runs around F and the
    trailer swings outwards unless it is stabilised.
    """

    side: Literal["outside", "inside"] = Field(
        default="outside", description="side of P on which the trailer is; inside is unstable"
    )
    centre_m: Point = Field(default=(0.0, 0.0), description="centre of the curve (x, y)")

    @abstractmethod
    def flat_derivatives(self, time_s: FloatArray) -> FloatArray:
        """(n, 7, 2) F [m] and its derivatives by time to the sixth, at times (n,)."""

    def sample(self, time_s: FloatArray, robot: RobotParameters) -> ReferencePath:
        """The reference at times (n,) [s], with a batch axis of one; angles are unwrapped."""
        time_s = np.asarray(time_s, dtype=np.float64)
        flat = self.flat_derivatives(time_s)
        motion = motion_from_flat(flat, 1.0 if self.side == "outside" else -1.0, robot)
        theta = np.stack([motion.theta1[:, :3], motion.theta2[:, :3]], axis=-1)[:, None]
        return ReferencePath(
            time_s=time_s,
            derivatives=motion.position[:, None],
            theta=np.unwrap(theta[:, :, 0], axis=0),
            theta_rate=theta[:, :, 1],
            theta_acceleration=theta[:, :, 2],
            flat_derivatives=flat[:, None, :5],
        )
