"""References a free trailer can follow: given as paths of its centre of oscillation F."""

from abc import abstractmethod
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field

from ttwmr_mj.dynamics.flatness import is_flat, motion_from_flat
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Point, Reference
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, hitches_unwound

FLAT_ORDERS = 7  # F and six derivatives: they give P and both angles to the fourth
Side = Literal["outside", "inside"]
SLOWEST_RAD_S = 1e-12  # as slow as other references may be


def _turning(rate: float) -> float:
    if abs(rate) < SLOWEST_RAD_S:
        raise ValueError(
            f"at least {SLOWEST_RAD_S:g} rad/s either way is needed: the trailer points along "
            "the acceleration of its centre of oscillation, which has none where it stands"
        )
    return rate


TurningRate = Annotated[
    float,
    Field(
        ge=-50,
        le=50,
        description="rate, positive counter-clockwise, never zero; typically 0.1 to 1",
    ),
    AfterValidator(_turning),
]


class FlatReference(Reference):
    """Motion of F whose acceleration never vanishes; the rest follows by flatness.

    The trailer may point either way along F'' (`dynamics.flatness`). Outside, P runs between F and
    the centre of curvature and the trailer's swing is stable; inside, P runs around F and the
    trailer swings outwards unless it is stabilised.

    Of several trailers F is the last one's, and each trailer has a side; they must be coupled at
    centres of oscillation, and no trailer's force may vanish.
    """

    leads_trains: ClassVar[bool] = True
    needs_flat: ClassVar[bool] = True  # trailers coupled at centres of oscillation, of several
    side: Side | Annotated[tuple[Side, ...], Field(strict=False)] = Field(
        default="outside",
        description="side of P on which the trailer is; inside is unstable; of several trailers "
        "one for all, or a list",
    )
    centre_m: Point = Field(default=(0.0, 0.0), description="centre of the curve (x, y)")

    @abstractmethod
    def flat_derivatives(self, time_s: FloatArray, orders: int = FLAT_ORDERS) -> FloatArray:
        """(n, orders, 2) F [m] and its derivatives by time, at times (n,)."""

    def outside(self, robot: RobotParameters) -> tuple[bool, ...]:
        """Of each trailer, front to back."""
        count = len(robot.trailers)
        sides = (self.side,) * count if isinstance(self.side, str) else self.side
        return tuple(side == "outside" for side in sides)

    def faults(self, robot: RobotParameters) -> list[Fault]:
        """Sides for other trailers, or trailers that are not flat."""
        count, faults = len(robot.trailers), []
        if not isinstance(self.side, str) and len(self.side) != count:
            allowed = f"one word for all trailers, or a list of {count}"
            got = f"a list of {len(self.side)} for {count} trailers"
            faults.append(Fault(key=("side",), got=got, allowed=allowed))
        if self.needs_flat and not is_flat(robot):
            problem = (
                "several trailers follow it only where each tows the next at its own centre of "
                "oscillation, and with its load on its axis"
            )
            hint = "set robot.trailers' next_hitch_offset_m to l + J2/(m2·l), or use a flat_circle"
            got = repr(getattr(self, "kind", ""))
            faults.append(Fault(key=("kind",), got=got, problem=problem, hint=hint))
        return faults

    def sample(self, time_s: FloatArray, robot: RobotParameters) -> ReferencePath:
        """The reference at times (n,) [s], with a batch axis of one; angles are unwrapped."""
        time_s = np.asarray(time_s, dtype=np.float64)
        flat = self.flat_derivatives(time_s, FLAT_ORDERS + 2 * (len(robot.trailers) - 1))
        signs = tuple(1.0 if outside else -1.0 for outside in self.outside(robot))
        motion = motion_from_flat(flat, signs, robot)
        angles = motion.theta1, *motion.trailers
        theta = np.stack([angle[:, :3] for angle in angles], axis=-1)[:, None]
        return ReferencePath(
            time_s=time_s,
            derivatives=motion.position[:, None, :5],
            theta=hitches_unwound(np.unwrap(theta[:, :, 0], axis=0)),
            theta_rate=theta[:, :, 1],
            theta_acceleration=theta[:, :, 2],
            flat_derivatives=flat[:, None, :5],
        )
