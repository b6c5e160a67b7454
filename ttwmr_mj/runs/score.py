"""A run folder summed up from what is in it, as of a run that was killed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.files import holds, require_none_but_files
from ttwmr_mj.results.metrics_file import MEASURED
from ttwmr_mj.results.row_stream import ROWS_FILE
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.closed_loop.loop import Outcome
from ttwmr_mj.runs.experiment import Result
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.runs.judgement.verdict import demands_of
from ttwmr_mj.runs.metrics import repeatable_metrics, write_metrics
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.run import StoredRun


def score_run(folder: Path) -> dict[str, Any]:
    """Write metrics.json, and trajectory.parquet where it is missing; returns the metrics.

    How the run ended and how long things took is as the folder's metrics.json has it. Without one
    the run was killed, unless its last row is there; how long things took is null then.

    Raises:
        InputError: it is no run folder, what it holds cannot be read or be of one run, or the run
            still goes on.
    """
    if not holds(folder, "scenario.resolved.toml"):
        problem = "no run folder, it has no scenario.resolved.toml"
        raise InputError.at("RUN", problem, got=str(folder))
    for name in ("metrics.json", "trajectory.parquet", ROWS_FILE):
        require_none_but_files(folder / name, hint="")
    with locked(folder, key="RUN"):
        run = StoredRun.read(folder)
        scenario, rows, stored = run.scenario, run.rows, run.metrics
        outcome = _outcome(rows, scenario) if stored is None else _outcome_as_stored(stored)
        demands = demands_of(scenario, run.reference)
        result = Result(scenario, rows, (outcome,), {}, np.empty(0), demands)
        metrics = repeatable_metrics(result, scenario)
        metrics |= {name: (stored or {}).get(name) for name in MEASURED}
        if not (folder / "trajectory.parquet").is_file():
            rows.write(folder / "trajectory.parquet")
        write_metrics(folder, metrics)
        (folder / ROWS_FILE).unlink(missing_ok=True)
    return metrics


def _outcome_as_stored(stored: dict[str, Any]) -> Outcome:
    return Outcome(stored["status"], stored["reason"], float(stored["end_time_s"]))


def _outcome(rows: Trajectory, scenario: Scenario) -> Outcome:
    """How a run ended that did not say it."""
    end_s = float(rows.time_s[-1])
    if len(rows) > scenario.periods and np.isfinite(rows.q).all():
        return Outcome("ok", "", end_s)
    return Outcome("killed", f"its process was killed before {scenario.duration_s:g} s", end_s)
