"""Runs the rows of a suite that are not there yet, several at a time."""

import json
from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_json
from ttwmr_mj.runs.foresight import foretold
from ttwmr_mj.scenario.file import find_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.bench.suite import Suite, SuiteRow, checked_scenarios, rows_of
from ttwmr_mj.studies.pool.jobs import Failed, run_jobs
from ttwmr_mj.studies.pool.task import PRELOAD, Work, run_task

Progress = Callable[[float], None]


def row_folder(row: SuiteRow, folder: Path) -> Path:
    """Where in a bench folder a row's run is."""
    return folder / "runs" / row.key


def stored_row(row: SuiteRow, folder: Path) -> dict[str, Any] | None:
    """The row.json of a finished run of this row, by the very same command; None if there is none.

    Whether the code and the files are still those of that run, only `run_suite` asks.
    """
    path = row_folder(row, folder) / "row.json"
    stored = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return stored if stored.get("run") == row.command() else None


def run_suite(
    suite: Suite,
    folder: Path,
    *,
    workers: int | None = None,
    progress: Progress | None = None,
    told: Callable[[list[str]], None] | None = None,
) -> None:
    """Run every row whose result is missing or outdated; after an interruption, call it again.

    Args:
        suite: what to run.
        folder: gets runs/<row>/, each a run folder with a row.json beside its files.
        workers: processes at a time; None: one per processor.
        progress: called with the number of rows done.
        told: called before the first run with what no law can do, in lines.

    Raises:
        InputError: some rows cannot run; none was started.
    """
    rows = {row.key: row for row in rows_of(suite)}
    scenarios = checked_scenarios(list(rows.values()))
    if told is not None:
        told(_foretold(scenarios.values()))
    tasks = {key: _task(row, scenarios[key], folder, suite.timeout_s) for key, row in rows.items()}
    missing = [key for key, task in tasks.items() if not task.is_done]
    for key in rows.keys() - set(missing):
        _rename_row(rows[key], folder)
    there = len(rows) - len(missing)
    jobs = [tasks[key].job for key in missing]
    with closing(run_jobs(jobs, workers=workers, preload=PRELOAD)) as events:
        for done, event in enumerate(events, start=there + 1):
            key, reason = event.job.name, event.reason if isinstance(event, Failed) else ""
            _write_row(rows[key], folder, reason)
            tasks[key].mark_done()
            if progress is not None:
                progress(float(done))


def _foretold(scenarios: Iterable[Scenario]) -> list[str]:
    """What tasks ask for and cannot get; of those that are alike but for the law, once."""
    alike = {
        (s.name, s.reference, s.robot, s.ground, s.plant, s.sensing, s.duration_s): s
        for s in scenarios
    }
    return list(dict.fromkeys(line for one in alike.values() for line in foretold(one)))


def _task(row: SuiteRow, scenario: Scenario, folder: Path, timeout_s: float) -> Work:
    into = row_folder(row, folder)
    words = ["ttwmr", *row.arguments(into), "--quiet"]
    beside = find_scenario(row.scenario).parent
    return run_task(row.key, scenario, into, words, beside, timeout_s)


def _write_row(row: SuiteRow, folder: Path, reason: str) -> None:
    """row.json of a run that is over: as its metrics say, failed if it was killed."""
    into = row_folder(row, folder)
    into.mkdir(parents=True, exist_ok=True)
    status = verdict = "failed"
    if not reason:
        metrics = json.loads((into / "metrics.json").read_text(encoding="utf-8"))
        status, verdict = metrics["status"], metrics["verdict"]
        if status != "ok":
            reason = f"{status} at {metrics['end_time_s']:.3f} s: {metrics['reason']}"
    ended = {"status": status, "reason": reason, "verdict": verdict}
    write_json(into / "row.json", {**_identity(row), **ended})


def _rename_row(row: SuiteRow, folder: Path) -> None:
    """Let the row.json of a run that is used again say how the suite words it now."""
    path = row_folder(row, folder) / "row.json"
    stored = json.loads(path.read_text(encoding="utf-8"))
    if stored != stored | _identity(row):
        write_json(path, stored | _identity(row))


def _identity(row: SuiteRow) -> dict[str, Any]:
    return {**row.names, "seed": row.seed, "run": row.command()}
