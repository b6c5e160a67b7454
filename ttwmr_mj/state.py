"""The robot's state for a batch of simulations, and angles on the circle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

X, Y, THETA1, THETA2 = range(4)  # columns of q (Eq. 2); further trailers' angles follow
TWO_PI = 2.0 * np.pi
BELOW_PI = float(np.nextafter(np.pi, 0.0))  # the largest angle there is below π
RIGHT, LEFT = range(2)  # columns of wheel speeds: (ω_r, ω_l) as in Eq. 8-9


class ArrayFields:
    """Base of dataclasses with arrays: equal where every value is, NaN to NaN; without a hash.

    They are made with `eq=False`, since the comparison that `dataclass` writes fails on arrays.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        compared = (f for f in fields(self) if f.compare)  # type: ignore[arg-type]  # a subclass is
        names = [f.name for f in compared]
        return all(_same(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # type: ignore[assignment]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    return bool(a is b or a == b)


@dataclass(frozen=True, slots=True, eq=False)
class RobotState(ArrayFields):
    """Generalized coordinates q = (x, y, θ1, θ2, …) (Eq. 2) and their rates, with n trailers.

    World frame, SI units. (x, y) is P, the middle of the wheel axle and the hitch. Angles are
    counter-clockwise from +x and unwrapped: a full turn adds 2π.

    Attributes:
        q: (nsim, 3 + n) x [m], y [m], θ1 [rad] (tractor), θ2 … [rad] (trailers, front to back).
        q_rate: (nsim, 3 + n) time derivatives of q [m/s, m/s, rad/s, rad/s …].
    """

    q: FloatArray
    q_rate: FloatArray

    @classmethod
    def at_rest(
        cls,
        x_m: float,
        y_m: float,
        theta1_rad: float,
        theta2_rad: float | Sequence[float],
        nsim: int = 1,
    ) -> RobotState:
        """The same pose for every simulation, with all rates zero.

        Args:
            x_m: of P.
            y_m: of P.
            theta1_rad: of the tractor.
            theta2_rad: of the trailer, or of each, front to back.
            nsim: number of simulations.
        """
        q = np.tile(np.hstack([x_m, y_m, theta1_rad, theta2_rad]), (nsim, 1)).astype(np.float64)
        return cls(q=q, q_rate=np.zeros_like(q))

    @property
    def nsim(self) -> int:
        """Number of simulations in the batch."""
        return int(self.q.shape[0])

    @property
    def hitch_angle_rad(self) -> FloatArray:
        """θ2 − θ1, (nsim,) [rad]: the hinge coordinate of the first trailer on the tractor."""
        return hitch_angles(self.q)[:, 0]


def hitch_angles(q: FloatArray) -> FloatArray:
    """(..., n) angle of each trailer minus that of what tows it, for q (..., 3 + n) [rad]."""
    return np.diff(q[..., THETA1:], axis=-1)


@np.errstate(invalid="ignore")  # 1 µs a call
def wrap(angle_rad: FloatArray) -> FloatArray:
    """The same angles in [−π, π) [rad], any shape; NaN of NaN and of what is infinite."""
    # the remainder of what is a little below −π rounds to 2π
    return np.minimum((np.asarray(angle_rad) + np.pi) % TWO_PI - np.pi, BELOW_PI)


def hitches_unwound(theta: FloatArray) -> FloatArray:
    """The same motion of θ1, θ2, … (n, ..., 1 + trailers), with no hitch wound up at its start.

    Whole turns are taken off the trailers, so that each begins within π of what tows it: a hitch's
    spring feels every turn.
    """
    start = theta[:1]
    hitches = np.diff(start, axis=-1)
    turns = np.zeros_like(start)
    turns[..., 1:] = np.add.accumulate(np.round((hitches - wrap(hitches)) / TWO_PI), axis=-1)
    return np.asarray(theta - TWO_PI * turns)


def unwrap_near(angle_rad: FloatArray, previous_rad: FloatArray) -> FloatArray:
    """The representative of each angle that lies within π of the previous one [rad]."""
    return previous_rad + wrap(angle_rad - previous_rad)
