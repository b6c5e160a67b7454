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
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.evidence import Evidence, second_half
from ttwmr_mj.studies.reproduce.ideal.continuous import decades, largest_ratio
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS, matching

Measure = Callable[[Evidence, str], float]

MEASURES: dict[str, Measure] = {}
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
    """A number that is read from results."""

    combine: str  # a key of COMBINE
    measure: str  # a key of MEASURES, else of a run's metrics or of a study's result
    of: tuple[str, ...]  # names of runs and studies

    @classmethod
    def parse(cls, text: str) -> Number:
        """As a data file has it."""
        what, _, whose = text.partition(" of ")
        *combine, measured = what.split()
        of = matching(whose.split(", "), [*RUNS, *STUDIES])
        return cls(combine[0] if combine else "max", measured, of)

    def value(self, evidence: Evidence) -> float:
        """The number; infinite where a run's metric is undefined."""
        values = [value for name in self.of for value in self._values(evidence, name)]
        return float(COMBINE[self.combine](values))

    def _values(self, evidence: Evidence, name: str) -> list[float]:
        if name in STUDIES:
            return list(np.ravel(evidence.study(name)[self.measure]))
        if self.measure in MEASURES:
            return [MEASURES[self.measure](evidence, name)]
        return [evidence.value(name, self.measure)]


def measure(function: Measure) -> Measure:
    """Makes a function of (evidence, run) a measure by its own name."""
    MEASURES[function.__name__] = function
    return function


@measure
def worse_error_m(evidence: Evidence, run: str) -> float:
    """The larger of the tractor's and the trailer's steady error."""
    return max(evidence.value(run, f"steady_{body}_rmse_m") for body in ("tractor", "trailer"))


@measure
def beyond_limits(evidence: Evidence, run: str) -> float:
    """The worse of the tractor's and the trailer's steady error, each over its limit."""
    errors = (
        evidence.value(run, f"steady_{body}_rmse_m") / LIMITS[f"{body.upper()}_FOLLOWS_M"]
        for body in ("tractor", "trailer")
    )
    return max(errors)


@measure
def decades_reached(evidence: Evidence, run: str) -> float:
    """How many powers of ten P's error has come down by at its least; six are counted."""
    return float(len(_decades(evidence, run)))


@measure
def ratio_of_decades(evidence: Evidence, run: str) -> float:
    """The time of a decade of P's error over that of the one before, at most."""
    return largest_ratio(_decades(evidence, run))


def _decades(evidence: Evidence, run: str) -> list[float]:
    rows = evidence.trajectory(run)
    return decades(rows.time_s, np.hypot(*(rows.q - rows.ref_q)[:, 0, :2].T))


@measure
def hitch_swing_rad(evidence: Evidence, run: str) -> float:
    """Peak to peak of the hitch angle in the second half."""
    return float(np.ptp(second_half(evidence.hitch_angle(run))))


@measure
def mean_hitch_angle_rad(evidence: Evidence, run: str) -> float:
    """Mean of the hitch angle in the second half."""
    return float(second_half(evidence.hitch_angle(run)).mean())


@measure
def steady_x_rmse_m(evidence: Evidence, run: str) -> float:
    """Steady error of P along x."""
    return _axis_error(evidence, run, 0)


@measure
def steady_y_rmse_m(evidence: Evidence, run: str) -> float:
    """Steady error of P along y."""
    return _axis_error(evidence, run, 1)


def _axis_error(evidence: Evidence, run: str, column: int) -> float:
    trajectory = evidence.trajectory(run)
    miss = second_half(trajectory.q - trajectory.ref_q)[:, 0, column]
    return float(np.sqrt(np.mean(miss**2)))


@measure
def effort_ratio(evidence: Evidence, run: str) -> float:
    """Mean square of the wheels' commands in the second half over that of the reference."""
    scenario, trajectory = evidence.scenario(run), evidence.trajectory(run)
    path = sampled_path(scenario.reference, trajectory.time_s, scenario.robot)
    speed = np.hypot(path.velocity_m_s[:, 0, 0], path.velocity_m_s[:, 0, 1])
    needed = wheels_from_twist(np.stack([speed, path.theta_rate[:, 0, 0]], -1), scenario.robot)
    given = trajectory.wheel_command_rad_s[:, 0]
    return float(np.mean(second_half(given) ** 2) / np.mean(second_half(needed) ** 2))


@measure
def steady_saturated_share(evidence: Evidence, run: str) -> float:
    """Share of the samples of the second half with a wheel at its limit."""
    return float(second_half(evidence.trajectory(run).saturated[:, 0]).mean())


@measure
def last_saturated_s(evidence: Evidence, run: str) -> float:
    """When a wheel was at its limit for the last time; 0 if it never was."""
    trajectory = evidence.trajectory(run)
    return float(trajectory.time_s[trajectory.saturated[:, 0]].max(initial=0.0))


@measure
def v_left_share(evidence: Evidence, run: str) -> float:
    """V at the end over V at the start."""
    _, v = evidence.lyapunov(run)
    return float(v[-1] / v[0])


@measure
def highest_rise_of_v(evidence: Evidence, run: str) -> float:
    """The highest V stands above its lowest value so far, over V at the start."""
    _, v = evidence.lyapunov(run)
    return float((v - np.minimum.accumulate(v)).max() / v[0])


@measure
def rising_samples_share(evidence: Evidence, run: str) -> float:
    """Share of samples at which V goes up by more than 10⁻⁶ of its start per second."""
    time_s, v = evidence.lyapunov(run)
    rate = np.diff(v) / np.diff(time_s)
    return float((np.append(rate, rate[-1:]) > 1e-6 * v[0]).mean())
