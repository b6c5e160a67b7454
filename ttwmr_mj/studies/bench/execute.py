"""Runs the rows of a suite, each in a process of its own: what breaks in one stays there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from threading import Event

from ttwmr_mj.files import write_json
from ttwmr_mj.studies.bench.suite import Row, Suite, check_rows, rows_of

Progress = Callable[[float], None]
POLL_S = 0.2  # how soon a run ends after the suite was stopped


def row_folder(row: Row, folder: Path) -> Path:
    """Where in a bench folder a row's run is."""
    return folder / "runs" / row.key


def is_finished(row: Row, folder: Path) -> bool:
    """Whether a bench folder holds this row, run by the very same command."""
    mark = row_folder(row, folder) / "row.json"
    return mark.is_file() and bool(json.loads(mark.read_text())["run"] == row.command())


def run_suite(
    suite: Suite, folder: Path, *, workers: int | None = None, progress: Progress | None = None
) -> None:
    """Run every row that is not finished yet; stopped and called again it goes on.

    Args:
        suite: what to run.
        folder: gets runs/<row>/, each a run folder with a row.json beside its files.
        workers: processes at a time; None: one per processor.
        progress: called with the number of rows done.

    Raises:
        InputError: some rows cannot run; none was started.
    """
    rows = rows_of(suite)
    missing = [row for row in rows if not is_finished(row, folder)]
    check_rows(missing)
    done, stop = len(rows) - len(missing), Event()
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        runs = [
            pool.submit(_run_row, row, row_folder(row, folder), suite.timeout_s, stop)
            for row in missing
        ]
        try:
            for run in as_completed(runs):
                run.result()
                done += 1
                if progress is not None:
                    progress(float(done))
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _run_row(row: Row, folder: Path, timeout_s: float, stop: Event) -> None:
    """One `ttwmr run`; its row.json, written last, marks it as finished."""
    shutil.rmtree(folder, ignore_errors=True)  # of a run that was stopped, or of another command
    reason = _run([sys.executable, "-m", "ttwmr_mj", *row.arguments(folder)], timeout_s, stop)
    if stop.is_set():
        return
    folder.mkdir(parents=True, exist_ok=True)
    status = _status(folder, reason)
    write_json(
        folder / "row.json",
        {**row.names, "seed": row.seed, "status": status, "reason": reason, "run": row.command()},
    )


def _status(folder: Path, reason: str) -> str:
    """As the run's metrics say; "failed" if it left none or did not end well all the same."""
    metrics = folder / "metrics.json"
    status = str(json.loads(metrics.read_text())["status"]) if metrics.is_file() else "failed"
    return "failed" if reason and status == "ok" else status


def _run(command: list[str], timeout_s: float, stop: Event) -> str:
    """Run a command to its end, the timeout or the stop; why it did not end well, or nothing."""
    # a session of its own: Ctrl-C in the terminal is for the suite, which then ends its runs
    with subprocess.Popen(
        [*command, "--quiet"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        for _ in range(round(timeout_s / POLL_S) + 1):
            try:
                _, errors = process.communicate(timeout=POLL_S)
            except subprocess.TimeoutExpired:
                if stop.is_set():
                    process.terminate()
            else:
                return errors.strip() if process.returncode else ""
        process.kill()
        return f"no end within {timeout_s:g} s"
