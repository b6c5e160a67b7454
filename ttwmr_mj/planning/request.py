"""A way through points that a plan is asked for, and its faults that show before it is planned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.errors import Fault
from ttwmr_mj.planning.transcription import Limits
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

KNOTS_PER_SWING, LEAST_KNOTS = 8, 12  # in a swing length of the way; of a leg
MOST_KNOTS = 2000  # of a way; its solver takes minutes


@dataclass(frozen=True, slots=True)
class Request:
    """A way that is asked for."""

    points_m: FloatArray  # (m, 2) of P
    closed: bool = False  # back to the first and round again; else from rest to rest
    duration_s: float | None = None  # of one round, or from start to end; None: as it comes

    @property
    def corners_m(self) -> FloatArray:
        """(legs + 1, 2) the points, the first again at the end if closed."""
        return np.vstack([self.points_m, self.points_m[: int(self.closed)]])

    @property
    def legs_m(self) -> FloatArray:
        """(legs,) straight distances."""
        return np.asarray(np.hypot(*np.diff(self.corners_m, axis=0).T))

    def faults(self, robot: RobotParameters, limits: Limits) -> list[Fault]:
        """Too few points, neighbours that coincide, points out of bounds, too long a way."""
        least = 3 if self.closed else 2
        if len(self.points_m) < least:
            told = f"at least {least} of them"
            return [Fault(key=("points",), got=str(len(self.points_m)), allowed=told)]
        beyond = ~(np.abs(self.points_m) <= 0.5 * np.array(limits.workspace_m)).all(axis=1)
        if beyond.any():
            return [self._beyond(np.flatnonzero(beyond).tolist(), limits)]
        if (count := sum(self.knots(robot))) > MOST_KNOTS:
            return [self._too_long(count)]
        near = np.flatnonzero(self.legs_m < 1e-3)
        return [
            Fault(
                key=("points", int(i) + 1),
                problem="is where the next one is; neighbours must be a millimetre apart",
                hint="a closed way needs no copy of its first point" if self.closed else "",
            )
            for i in near
        ]

    def knots(self, robot: RobotParameters) -> tuple[int, ...]:
        """Of each leg."""
        spacing = robot.swing_length_m / KNOTS_PER_SWING
        return tuple(max(LEAST_KNOTS, int(np.ceil(leg / spacing))) for leg in self.legs_m)

    def _beyond(self, rows: list[int], limits: Limits) -> Fault:
        """These points are outside of the workspace."""
        x, y = self.points_m[rows[0]]
        width, height = limits.workspace_m
        others = f", and {len(rows) - 1} more that are outside" if len(rows) > 1 else ""
        return Fault(
            key=("points", rows[0] + 1),
            got=f"({x:.4g}, {y:.4g}) m{others}",
            allowed=f"within the workspace, {width:.4g} × {height:.4g} m about the origin",
            hint="allow a larger --workspace, or move the points in (a drawing: --scale)",
        )

    def _too_long(self, count: int) -> Fault:
        """The way has too many knots."""
        return Fault(
            key=("points",),
            problem=f"{len(self.points_m)} of them along {self.legs_m.sum():.4g} m make {count:,} "
            f"steps of the plan, which has at most {MOST_KNOTS:,}",
            hint="take fewer points or a shorter way, or plan it in parts",
        )
