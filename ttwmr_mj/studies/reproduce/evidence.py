"""What was run, read back: the only way figures and claims look at results."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.files import read_json
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import THETA1, THETA2, FloatArray
from ttwmr_mj.studies.reproduce.execute import run_folder, study_file
from ttwmr_mj.studies.reproduce.runs import RUNS


class Evidence:
    """Results of a reproduction's folder, each read once.

    Attributes:
        out: the folder.
        failures: runs and studies that could not be done, with the reason.
    """

    def __init__(self, out: Path, failures: dict[str, str] | None = None) -> None:
        self.out = out
        self.failures = failures or {}
        # per instance: two folders hold different results under the same names
        self.trajectory = cache(self._trajectory)
        self.metrics = cache(self._metrics)
        self.study = cache(self._study)
        self.scenario = cache(self._scenario)

    def _trajectory(self, run: str) -> Trajectory:
        return Trajectory.read(run_folder(self.out, run) / "trajectory.parquet")

    def _metrics(self, run: str) -> dict[str, Any]:
        return read_json(run_folder(self.out, run) / "metrics.json")

    def _study(self, name: str) -> dict[str, Any]:
        result: dict[str, Any] = read_json(study_file(self.out, name))["result"]
        return result

    def _scenario(self, run: str) -> Scenario:
        return RUNS[run].scenario()

    def recording(self, run: str) -> str | None:
        """A run's recording, relative to the folder; None if there is none."""
        path = f"runs/{run}/run.rrd"
        return path if (self.out / path).is_file() else None

    def lacking(self, names: Iterable[str]) -> list[str]:
        """Those of these runs and studies that could not be done."""
        return [name for name in names if name in self.failures]

    def robot(self, run: str) -> RobotParameters:
        """The run's robot."""
        return self.scenario(run).robot

    def value(self, run: str, metric: str) -> float:
        """A metric of a run; infinite where it is undefined or the run did not end well."""
        metrics = self.metrics(run)
        number = metrics[metric]
        return float(number) if metrics["status"] == "ok" and number is not None else float("inf")

    def hitch_angle(self, run: str) -> FloatArray:
        """(n,) θ2 − θ1 of a run [rad]."""
        q = self.trajectory(run).q[:, 0]
        return np.asarray(q[:, THETA2] - q[:, THETA1])

    def lyapunov(self, run: str) -> tuple[FloatArray, FloatArray]:
        """(n,) times [s] and V of Eq. 33 and 44, which the law logged, of a run that may break off.

        V mixes m² and (m/s)², as the article's does; only its shape over time means something.
        """
        trajectory = self.trajectory(run)
        v = trajectory.signals["lyapunov_v"][:, 0]
        return trajectory.time_s[np.isfinite(v)], v[np.isfinite(v)]


def second_half(values: np.ndarray) -> np.ndarray:
    """The rows of the second half of a run, when it has settled if it ever does."""
    return values[len(values) // 2 :]
