"""Numbers of runs and studies, by name: what claims are judged by and figures are told with.

In a data file a number is a text such as "max hitch_swing_rad of law32-omitted-*": how several are
combined (left out for a single one), what is measured, and of which runs or studies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.references.shared.reference import sampled_path
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.reproduce.claims.limits import TRACTOR_FOLLOWS_M, TRAILER_FOLLOWS_M
from ttwmr_mj.studies.reproduce.evidence import Evidence, second_half
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS, matching

TRACTOR_ERROR, TRAILER_ERROR = "steady_tractor_rmse_m", "steady_trailer_rmse_m"  # metrics

COMBINE: dict[str, Callable[[Any], Any]] = {
    "min": min,
    "max": max,
    "sum": sum,
    "mean": np.mean,
    "median": np.median,
    "count": len,
}


@dataclass(frozen=True, slots=True)
class Number:
    """A number that is read from results.

    Attributes:
        combine: a key of COMBINE.
        measure: a key of MEASURES, else of a run's metrics or of a study's result.
        of: names of runs and studies.
    """

    combine: str
    measure: str
    of: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> Number:
        """As a data file has it."""
        what, _, whose = text.partition(" of ")
        *combine, measure = what.split()
        return cls(
            combine[0] if combine else "max",
            measure,
            matching(whose.split(", "), [*RUNS, *STUDIES]),
        )

    def value(self, evidence: Evidence) -> float:
        """The number; infinite where a run's metric is undefined."""
        values = [value for name in self.of for value in self._values(evidence, name)]
        return float(COMBINE[self.combine](values))

    def _values(self, evidence: Evidence, name: str) -> list[float]:
        if name in STUDIES:
            return list(np.ravel(evidence.study(name)[self.measure]))
        if self.measure in MEASURES:
            return [float(MEASURES[self.measure](evidence, name))]
        return [evidence.value(name, self.measure)]


def worse_error(evidence: Evidence, run: str) -> float:
    """The larger of the tractor's and the trailer's steady error [m]."""
    return max(evidence.value(run, metric) for metric in (TRACTOR_ERROR, TRAILER_ERROR))


def robot_follows(evidence: Evidence, run: str) -> bool:
    """Whether tractor and trailer both follow."""
    return (
        evidence.value(run, TRACTOR_ERROR) <= TRACTOR_FOLLOWS_M
        and evidence.value(run, TRAILER_ERROR) <= TRAILER_FOLLOWS_M
    )


def effort_ratio(evidence: Evidence, run: str) -> float:
    """Mean square of the wheels' commands in the second half over that of the reference."""
    scenario, trajectory = evidence.scenario(run), evidence.trajectory(run)
    path = sampled_path(scenario.reference, trajectory.time_s, scenario.robot)
    speed = np.hypot(path.velocity_m_s[:, 0, 0], path.velocity_m_s[:, 0, 1])
    needed = wheels_from_twist(np.stack([speed, path.theta_rate[:, 0, 0]], -1), scenario.robot)
    given = trajectory.wheel_command_rad_s[:, 0]
    return float(np.mean(second_half(given) ** 2) / np.mean(second_half(needed) ** 2))


def rising_share(time_s: FloatArray, v: FloatArray) -> float:
    """Share of samples (n,) at which V goes up by more than 10⁻⁶ of its start per second."""
    rate = np.diff(v) / np.diff(time_s)
    return float((np.append(rate, rate[-1:]) > 1e-6 * v[0]).mean())


def left_share(time_s: FloatArray, v: FloatArray) -> float:
    """V (n,) at the end over V at the start."""
    del time_s
    return float(v[-1] / v[0])


def highest_rise(time_s: FloatArray, v: FloatArray) -> float:
    """The highest V (n,) stands above its lowest value so far, over V at the start."""
    del time_s
    return float((v - np.minimum.accumulate(v)).max() / v[0])


def _axis_error(evidence: Evidence, run: str, column: int) -> float:
    """Steady rms error of x or y of P [m]."""
    trajectory = evidence.trajectory(run)
    miss = second_half(trajectory.q - trajectory.ref_q)[:, 0, column]
    return float(np.sqrt(np.mean(miss**2)))


def _last_saturated(evidence: Evidence, run: str) -> float:
    """When a wheel was at its limit for the last time [s]."""
    trajectory = evidence.trajectory(run)
    return float(trajectory.time_s[trajectory.saturated[:, 0]].max(initial=0.0))


MEASURES: dict[str, Callable[[Evidence, str], float]] = {
    "hitch_swing_rad": lambda evidence, run: np.ptp(second_half(evidence.hitch_angle(run))),
    "mean_hitch_angle_rad": lambda evidence, run: second_half(evidence.hitch_angle(run)).mean(),
    "worse_error_m": worse_error,
    "robot_follows": robot_follows,
    "effort_ratio": effort_ratio,
    "steady_saturated_share": lambda evidence, run: second_half(
        evidence.trajectory(run).saturated[:, 0]
    ).mean(),
    "last_saturated_s": _last_saturated,
    "steady_x_rmse_m": lambda evidence, run: _axis_error(evidence, run, 0),
    "steady_y_rmse_m": lambda evidence, run: _axis_error(evidence, run, 1),
    "v_left_share": lambda evidence, run: left_share(*evidence.lyapunov(run)),
    "highest_rise_of_v": lambda evidence, run: highest_rise(*evidence.lyapunov(run)),
    "rising_samples_share": lambda evidence, run: rising_share(*evidence.lyapunov(run)),
}
