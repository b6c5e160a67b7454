"""How far two runs of one robot are apart, over time and in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.dynamics.kinematics import to_body
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import THETA1, THETA2, FloatArray

# Bounds whose first crossing is reported: P in metres, angles in radians.
POSITION_BOUNDS_M = (1e-4, 1e-3, 1e-2)
ANGLE_BOUNDS_RAD = (1e-3, 1e-2, 1e-1)

Numbers = dict[str, float | None]


@dataclass(frozen=True, slots=True)
class Deviation:
    """Contact physics minus analytic model, one simulation each, at the control samples.

    Angles are unwrapped on both sides and differ by what they turned: a trailer that spun once
    around on one plant only deviates by 2π.

    Attributes:
        time_s: (n,).
        q: (n, 4) difference of x, y [m], θ1, θ2 [rad].
        path_m: (n,) length of the analytic model's path so far.
        heading_rad: (n,) θ1 of the analytic model, to tell ahead from aside.
    """

    time_s: FloatArray
    q: FloatArray
    path_m: FloatArray
    heading_rad: FloatArray

    @classmethod
    def between(cls, contact: Trajectory, analytic: Trajectory) -> Deviation:
        """The deviation of two runs over the samples both have.

        Raises:
            InputError: one is of several simulations.
        """
        n = min(len(contact), len(analytic))
        ours, theirs = (run.simulation().q[:n, 0] for run in (analytic, contact))
        steps = np.hypot(*np.diff(ours[:, :2], axis=0).T)
        return cls(
            time_s=analytic.time_s[:n],
            q=theirs - ours,
            path_m=np.concatenate([[0.0], np.cumsum(steps)]),
            heading_rad=ours[:, THETA1],
        )

    @property
    def position_m(self) -> FloatArray:
        """(n,) distance between the two P."""
        return np.asarray(np.hypot(self.q[:, 0], self.q[:, 1]))

    @property
    def along_m(self) -> FloatArray:
        """(n,) part of it along the analytic tractor's heading."""
        return to_body(self.heading_rad, self.q[:, 0], self.q[:, 1])[0]

    @property
    def aside_m(self) -> FloatArray:
        """(n,) part of it to the analytic tractor's left."""
        return to_body(self.heading_rad, self.q[:, 0], self.q[:, 1])[1]

    @property
    def hitch_angle_rad(self) -> FloatArray:
        """(n,) difference of θ2 − θ1."""
        return np.asarray(self.q[:, THETA2] - self.q[:, THETA1])

    def exceeds_at_s(self, values: FloatArray, bound: float) -> float | None:
        """When |values| (n,) first exceeds a bound, or None."""
        beyond = np.flatnonzero(np.abs(values) > bound)
        return float(self.time_s[beyond[0]]) if beyond.size else None

    def numbers(self) -> Numbers:
        """Keys and numbers of compare.json; a share of the path is None where nobody moved."""
        path = float(self.path_m[-1])
        position = self.position_m
        numbers: Numbers = {
            "path_length_m": path,
            "position_deviation_max_m": float(position.max()),
            "position_deviation_rms_m": rms(position),
            "position_deviation_final_m": float(position[-1]),
            "position_deviation_per_path": float(position.max()) / path if path > 0.0 else None,
            "along_deviation_max_m": _largest(self.along_m),
            "aside_deviation_max_m": _largest(self.aside_m),
        }
        angles = {"theta1": self.q[:, THETA1], "theta2": self.q[:, THETA2]}
        for name, angle in {**angles, "hitch_angle": self.hitch_angle_rad}.items():
            numbers[f"{name}_deviation_max_rad"] = _largest(angle)
            numbers[f"{name}_deviation_rms_rad"] = rms(angle)
        return numbers

    def times(self) -> Numbers:
        """Time until a bound is exceeded [s], None where it never is."""
        named = {f"position_over_{b:g}_m_s": (self.position_m, b) for b in POSITION_BOUNDS_M}
        for name, column in (("theta1", THETA1), ("theta2", THETA2)):
            for bound in ANGLE_BOUNDS_RAD:
                named[f"{name}_over_{bound:g}_rad_s"] = (self.q[:, column], bound)
        return {name: self.exceeds_at_s(*pair) for name, pair in named.items()}


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _largest(values: FloatArray) -> float:
    return float(np.abs(values).max())
