"""How far two runs of one robot are apart, over time and in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.dynamics.kinematics import to_body
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import THETA1, THETA2, ArrayFields, FloatArray

# Bounds whose first crossing is reported: P in metres, angles in radians.
POSITION_BOUNDS_M = (1e-4, 1e-3, 1e-2)
ANGLE_BOUNDS_RAD = (1e-3, 1e-2, 1e-1)

Numbers = dict[str, float | None]


@dataclass(frozen=True, slots=True, eq=False)
class Deviation(ArrayFields):
    """Contact physics minus analytic model, one simulation each, at the control samples.

    Angles are unwrapped on both sides and differ by what they turned: a trailer that spun once
    around on one plant only deviates by 2π.
    """

    time_s: FloatArray  # (n,)
    q: FloatArray  # (n, 3 + trailers) difference of x, y [m], θ1, θ2, … [rad]
    path_m: FloatArray  # (n,) length of the analytic model's path so far
    heading_rad: FloatArray  # (n,) θ1 of the analytic model, to tell ahead from aside

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
    def position_curves(self) -> dict[str, FloatArray]:
        """That distance, and its parts ahead and to the left of the analytic tractor (n,) [m]."""
        along, aside = to_body(self.heading_rad, self.q[:, 0], self.q[:, 1])
        return {"distance": self.position_m, "ahead": along, "aside": aside}

    @property
    def angle_curves(self) -> dict[str, FloatArray]:
        """Differences of the angles (n,) [rad]."""
        angles = {f"θ{i}": angle for i, angle in enumerate(self.q[:, THETA1:].T, start=1)}
        return angles | {"hitch": self.q[:, THETA2] - self.q[:, THETA1]}

    def numbers(self) -> Numbers:
        """Keys and numbers of compare.json; a share of the path is None where nobody moved."""
        path = float(self.path_m[-1])
        position, along, aside = self.position_curves.values()
        numbers: Numbers = {
            "path_length_m": path,
            "position_deviation_max_m": largest(position),
            "position_deviation_rms_m": rms(position),
            "position_deviation_final_m": float(position[-1]),
            "position_deviation_per_path": largest(position) / path if path > 0.0 else None,
            "along_deviation_max_m": largest(along),
            "aside_deviation_max_m": largest(aside),
        }
        names = [*(f"theta{i}" for i in range(1, self.q.shape[1] - 1)), "hitch_angle"]
        for name, angle in zip(names, self.angle_curves.values(), strict=True):
            numbers[f"{name}_deviation_max_rad"] = largest(angle)
            numbers[f"{name}_deviation_rms_rad"] = rms(angle)
        return numbers

    def times(self) -> Numbers:
        """Time until a bound is exceeded [s], None where it never is."""
        named = {f"position_over_{b:g}_m_s": (self.position_m, b) for b in POSITION_BOUNDS_M}
        for column in range(THETA1, self.q.shape[1]):
            for bound in ANGLE_BOUNDS_RAD:
                named[f"theta{column - 1}_over_{bound:g}_rad_s"] = (self.q[:, column], bound)
        beyond = {name: np.flatnonzero(np.abs(a) > bound) for name, (a, bound) in named.items()}
        return {k: float(self.time_s[at[0]]) if at.size else None for k, at in beyond.items()}


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def largest(values: FloatArray) -> float:
    """Of the absolute values."""
    return float(np.abs(values).max())
