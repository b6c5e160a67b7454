"""A smooth curve through given points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from ttwmr_mj.errors import InputError
from ttwmr_mj.references.shared.path_reference import Reference
from ttwmr_mj.references.shared.time_law import ORDERS, TimeLaw
from ttwmr_mj.state import FloatArray

DEGREE = 5  # continuous to the fourth derivative
MIN_WAYPOINTS = 3
# Third and fourth derivative zero at a free end: the least ∫|p'''|² of all curves.
FREE_END = [(3, np.zeros(2)), (4, np.zeros(2))]


@dataclass(frozen=True, kw_only=True)
class Waypoints(Reference):
    """A quintic spline through waypoints, four times continuously differentiable.

    The path parameter σ is the chord length: the sum of straight distances from waypoint to
    waypoint. It grows at `speed_m_s`, so every leg takes its straight distance over that speed;
    the speed over ground is |p'(σ)| times that, close to it where the curve is close to its
    chords and higher where it swings out.

    An open curve ends in a smooth stop of `stop_s` and then holds its last waypoint, at rest and
    with its last heading. A closed one goes on round after round.

    Attributes:
        points_m: waypoints (x, y), three or more, neighbours distinct; a closed curve returns to
            the first by itself.
        speed_m_s: rate of the chord length.
        closed: whether the last waypoint leads to the first.
        stop_s: duration of the stop of an open curve.

    Raises:
        InputError: too few waypoints, neighbours that coincide, or a curve too short for its
            start and stop.
    """

    points_m: tuple[tuple[float, float], ...]
    speed_m_s: float
    closed: bool = False
    stop_s: float = 1.0

    def __post_init__(self) -> None:
        if len(self.points_m) < MIN_WAYPOINTS:
            raise InputError(
                f"waypoints: got {len(self.points_m)}, a curve needs at least {MIN_WAYPOINTS}"
            )
        repeated = np.flatnonzero(self._legs_m == 0.0)
        if repeated.size:
            first = int(repeated[0])
            second = (first + 1) % len(self.points_m)
            hint = "; a closed curve needs no copy of its first" if second == 0 else ""
            raise InputError(
                f"waypoints {first} and {second} are the same point {self.points_m[first]}: "
                f"neighbours must differ{hint}"
            )
        self.time_law()

    def path_derivatives(self, sigma: FloatArray) -> FloatArray:
        """(5, n, 2) p and its derivatives by the chord length, (n,) [m]."""
        return np.stack([self._spline(sigma, order) for order in range(ORDERS)])

    def time_law(self) -> TimeLaw:
        """Constant rate of the chord length, with a stop at the end of an open curve."""
        if self.closed:
            return TimeLaw(rate=self.speed_m_s, ramp_s=self.ramp_s)
        return TimeLaw(
            rate=self.speed_m_s, ramp_s=self.ramp_s, end=self.length_m, stop_s=self.stop_s
        )

    @property
    def length_m(self) -> float:
        """Chord length of the whole curve, of one round if closed."""
        return float(self._knots_m[-1])

    @cached_property
    def _corners_m(self) -> FloatArray:
        """(n, 2) waypoints, with the first again at the end if closed."""
        return np.array([*self.points_m, *self.points_m[: int(self.closed)]])

    @cached_property
    def _legs_m(self) -> FloatArray:
        """(n − 1,) straight distances between neighbours."""
        return np.asarray(np.linalg.norm(np.diff(self._corners_m, axis=0), axis=-1))

    @cached_property
    def _knots_m(self) -> FloatArray:
        """(n,) chord length at the corners."""
        return np.concatenate([[0.0], np.cumsum(self._legs_m)])

    @cached_property
    def _spline(self) -> BSpline:
        ends = "periodic" if self.closed else (FREE_END, FREE_END)
        spline = make_interp_spline(self._knots_m, self._corners_m, k=DEGREE, bc_type=ends)
        spline.extrapolate = "periodic" if self.closed else True
        return spline
