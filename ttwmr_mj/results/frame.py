"""The frame that a run is judged in: the world, or what a camera takes for it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ttwmr_mj.dynamics.kinematics import to_world
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import THETA1, FloatArray


@dataclass(frozen=True, slots=True)
class PlaneFrame:
    """A rigid motion of the floor: point p of the world has coordinates R(turn)·p + offset.

    Attributes:
        turn_rad: by how much directions are turned.
        offset_m: (2,) coordinates of the world's origin.
    """

    turn_rad: float
    offset_m: FloatArray

    @property
    def distance_m(self) -> float:
        """How far from the world's origin the frame sees it."""
        return float(np.hypot(*self.offset_m))

    @classmethod
    def fit(cls, world_m: FloatArray, seen_m: FloatArray) -> PlaneFrame:
        """The frame that takes points (n, 2) closest to where they are seen (n, 2).

        In least squares, in closed form (Kabsch 1976): about the centroids the turn is
        atan2(Σ a × b, Σ a · b), and the offset carries one centroid to the other.
        """
        from_mean, to_mean = world_m.mean(axis=0), seen_m.mean(axis=0)
        (ax, ay), (bx, by) = (world_m - from_mean).T, (seen_m - to_mean).T
        turn = float(np.arctan2((ax * by - ay * bx).sum(), (ax * bx + ay * by).sum()))
        return cls(turn, to_mean - rotated(from_mean, turn))

    def applied(self, rows: Trajectory) -> Trajectory:
        """The same run with the truth in this frame; reference and estimate are in it already."""
        q, q_rate = rows.q.copy(), rows.q_rate.copy()
        q[..., :2] = rotated(q[..., :2], self.turn_rad) + self.offset_m
        q[..., THETA1:] += self.turn_rad
        q_rate[..., :2] = rotated(q_rate[..., :2], self.turn_rad)
        return replace(rows, q=q, q_rate=q_rate)


def rotated(vector: FloatArray, angle_rad: float) -> FloatArray:
    """Vectors (..., 2) turned counter-clockwise."""
    return np.stack(to_world(np.asarray(angle_rad), vector[..., 0], vector[..., 1]), axis=-1)
