"""What sums up a run, as in its metrics.json."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_json
from ttwmr_mj.results.metrics import score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.experiment import Result
from ttwmr_mj.runs.judgement.judged import frame_metrics, judged
from ttwmr_mj.scenario.schema import Scenario


def metrics_of(result: Result, scenario: Scenario, wall_time_s: float) -> dict[str, Any]:
    """metrics.json of a run of one simulation: verdict and status first, then the numbers.

    Of a clock that stands still there is no real-time factor.
    """
    (outcome,), took = result.outcomes, result.control_time_s
    controller_s = result.wall_time_s.get("controller", 0.0)
    return {
        **repeatable_metrics(result, scenario),
        "control_time_per_sample_us": 1e6 * controller_s / max(len(result.trajectory), 1),
        # Commands that took longer than a period, on this machine under its load. On a real robot
        # they would come too late; here they are used all the same, so that results do not depend
        # on the machine.
        "control_overruns": int((took > scenario.control.sampling_time_s).sum()),
        "control_slowest_s": float(took.max()) if took.size else None,
        "wall_time_s": wall_time_s,
        "real_time_factor": outcome.time_s / wall_time_s if wall_time_s else None,
    }


def repeatable_metrics(result: Result, scenario: Scenario) -> dict[str, Any]:
    """What is in metrics.json whenever the run is repeated: all but the times it took."""
    rows = judged(result.trajectory, scenario)
    (outcome,), (numbers,) = result.outcomes, score(rows, scenario.robot)
    (verdict,) = result.verdicts
    return {
        "verdict": verdict.name,
        "verdict_reason": verdict.what,
        "status": outcome.status,
        "reason": outcome.reason,
        "end_time_s": outcome.time_s,
        **numbers,
        **frame_metrics(scenario),
    }


def write_result(folder: Path, trajectory: Trajectory, metrics: dict[str, Any]) -> None:
    """What a run of one simulation is judged by; metrics that are there tell that all is."""
    trajectory.write(folder / "trajectory.parquet")
    write_metrics(folder, metrics)


def write_metrics(folder: Path, metrics: dict[str, Any]) -> None:
    """metrics.json."""
    write_json(folder / "metrics.json", metrics)
