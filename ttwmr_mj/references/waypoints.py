"""A smooth curve through given points."""

import warnings
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import LinAlgError, LinAlgWarning

from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path_reference import PathReference
from ttwmr_mj.references.shared.reference import Point
from ttwmr_mj.references.shared.time_law import ORDERS, TimeLaw
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

DEGREE = 5  # continuous to the fourth derivative
# Third and fourth derivative zero at a free end: the least ∫|p'''|² of all curves.
FREE_END = [(3, np.zeros(2)), (4, np.zeros(2))]


class Waypoints(PathReference):
    """Smooth curve of P through waypoints, open or closed.

    A quintic spline, four times continuously differentiable.

    The path parameter σ is the chord length: the sum of straight distances from waypoint to
    waypoint. It grows at `speed_m_s`, so every leg takes its straight distance over that speed;
    the speed over ground is |p'(σ)| times that, close to it where the curve is close to its
    chords and higher where it swings out.

    An open curve ends in a smooth stop of `stop_s` and then holds its last waypoint, at rest and
    with its last heading. A closed one goes on round after round.
    """

    kind: Literal["waypoints"] = "waypoints"
    points_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=3, max_length=10_000)] = (
        Field(description="waypoints (x, y); neighbours must differ")
    )
    speed_m_s: float = Field(
        ge=1e-12,
        le=100,
        description="speed with respect to the chord length; typically 0.05 to 0.5",
    )
    closed: bool = Field(
        default=False, description="whether the curve returns from the last point to the first"
    )
    stop_s: float = Field(
        default=1.0,
        ge=0,
        le=600,
        description="duration of the stop at the end of an open curve; typically 1",
    )

    def faults(self, robot: RobotParameters) -> list[Fault]:
        """Neighbours that coincide; a curve too short for its start and stop."""
        del robot
        repeated = np.flatnonzero(self._legs_m == 0.0)
        if not repeated.size:
            fault = self.time_law().fault() or self._uneven()
            return [fault] if fault else []
        first = int(repeated[0])
        second = (first + 1) % len(self.points_m)
        return [
            Fault(
                key=("points_m", first),
                got=str(self.points_m[first]),
                problem=f"which point {second} repeats: neighbours must differ",
                hint="a closed curve needs no copy of its first point" if second == 0 else "",
            )
        ]

    def _uneven(self) -> Fault | None:
        """Points of which no curve can be computed to the precision of numbers."""
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            try:
                self._spline  # noqa: B018
            except (LinAlgWarning, LinAlgError):
                legs = self._legs_m
                between = f"between {legs.min():.3g} and {legs.max():.3g} m apart"
                problem = f"neighbours are {between}, too unevenly for a smooth curve through them"
                return Fault(key=("points_m",), problem=problem, hint="leave out near ones")
        return None

    def path_derivatives(self, sigma: FloatArray) -> FloatArray:
        """(5, n, 2) p and its derivatives by the chord length, (n,) [m]."""
        spline = self._spline
        return np.stack([spline(sigma, order) for order in range(ORDERS)])

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

    @property
    def _corners_m(self) -> FloatArray:
        """(n, 2) waypoints, with the first again at the end if closed."""
        return np.array([*self.points_m, *self.points_m[: int(self.closed)]])

    @property
    def _legs_m(self) -> FloatArray:
        """(n − 1,) straight distances between neighbours."""
        return np.asarray(np.linalg.norm(np.diff(self._corners_m, axis=0), axis=-1))

    @property
    def _knots_m(self) -> FloatArray:
        """(n,) chord length at the corners."""
        return np.concatenate([[0.0], np.cumsum(self._legs_m)])

    @property
    def _spline(self) -> BSpline:
        ends = "periodic" if self.closed else (FREE_END, FREE_END)
        spline = make_interp_spline(self._knots_m, self._corners_m, k=DEGREE, bc_type=ends)
        spline.extrapolate = "periodic" if self.closed else True
        return spline
