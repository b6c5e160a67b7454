"""Runs the rows of a suite, each in a process of its own: what breaks in one stays there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ttwmr_mj.run_folder import write_json
from ttwmr_mj.studies.bench.suite import Row, Suite, rows_of

Progress = Callable[[float], None]


def run_suite(
    suite: Suite, folder: Path, *, workers: int | None = None, progress: Progress | None = None
) -> None:
    """Run every row that is not in the folder yet.

    Args:
        suite: what to run.
        folder: gets runs/<row>/, each a run folder with a row.json beside its files.
        workers: processes at a time; None: one per processor.
        progress: called with the number of rows done.
    """
    rows = list(rows_of(suite))
    done = 0

    def one(row: Row) -> None:
        nonlocal done
        _run_row(row, folder / "runs" / row.key, suite.timeout_s)
        done += 1
        if progress is not None:
            progress(float(done))

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        list(pool.map(one, rows))


def _run_row(row: Row, folder: Path, timeout_s: float) -> None:
    """One `ttwmr run`; its row.json, written last, marks it as finished."""
    if (folder / "row.json").is_file():
        return
    command = [sys.executable, "-m", "ttwmr_mj", *row.arguments(folder), "--force", "--quiet"]
    reason = ""
    try:
        ended = subprocess.run(
            command, capture_output=True, text=True, timeout=timeout_s, check=False
        )
        if ended.returncode != 0:
            reason = ended.stderr.strip()
    except subprocess.TimeoutExpired:
        reason = f"no end within {timeout_s:g} s"
    folder.mkdir(parents=True, exist_ok=True)
    status = _status(folder, reason)
    write_json(
        folder / "row.json",
        {**row.names, "seed": row.seed, "status": status, "reason": reason, "run": row.command()},
    )


def _status(folder: Path, reason: str) -> str:
    """As the run's metrics say; "failed" if it left none."""
    metrics = folder / "metrics.json"
    if metrics.is_file() and "no end within" not in reason:
        return str(json.loads(metrics.read_text())["status"])
    return "failed"
