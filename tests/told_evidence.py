"""Evidence that is made up, for the tests of claims and figures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Judgement
from ttwmr_mj.studies.reproduce.evidence import Evidence


class Told(Evidence):
    """Evidence that is told what it holds; a run that it is not told of did badly."""

    def __init__(
        self,
        studies: dict[str, Any] | None = None,
        values: dict[str, float] | None = None,
        *,
        swings: dict[str, float] | None = None,
        logs: dict[str, Any] | None = None,
        trajectories: dict[str, Trajectory] | None = None,
    ) -> None:
        super().__init__(Path("nowhere"))
        self.study = (studies or {}).__getitem__
        self.lyapunov = (logs or {}).__getitem__
        self.trajectory = (trajectories or {}).__getitem__
        self._values, self._swings = values or {}, swings or {}

    def value(self, run: str, metric: str) -> float:
        return self._values.get(f"{run} {metric}", self._values.get(run, math.inf))

    def hitch_angle(self, run: str) -> np.ndarray:
        return np.array([9.0, 9.0, 0.0, self._swings.get(run, math.nan)])


def judged(name: str, *told: Any, **more: Any) -> Judgement:
    return CLAIMS[name].judgement(Told(*told, **more))


def continuous(end: str, v_left: float, e5_left: float = 0.0) -> dict[str, Any]:
    case = {
        "end_time_s": 20.0 if end == "time" else 0.1,
        "v_share": [1.0, v_left],
        "e5_rad": [9.0, e5_left],
        "error_m": [v_left],
        "rho_d": [1.0],
    }
    return {"continuous": {"cases": [case | {"gamma": g} for g in ("exact", "constant")]}}
