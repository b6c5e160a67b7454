"""The work of a reproduction: runs and studies, in parallel, and not a second time."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import TtwmrError
from ttwmr_mj.files import write_json, write_text
from ttwmr_mj.scenario.file import dump_scenario
from ttwmr_mj.studies.reproduce.fingerprint import code_of_runs, code_of_studies
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS

DONE_FILE = "done"  # written last; holds the fingerprint of the code that ran
Done = Callable[[float], None]
Failures = dict[str, str]


def run_folder(out: Path, name: str) -> Path:
    """Folder of a run."""
    return out / "runs" / name


def study_file(out: Path, name: str) -> Path:
    """File of a study's result."""
    return out / "studies" / f"{name}.json"


def execute(
    out: Path, runs: Iterable[str], studies: Iterable[str], progress: Done | None = None
) -> Failures:
    """Do what is not done yet.

    Args:
        out: the reproduction's folder.
        runs: names of `runs.RUNS`.
        studies: names of `studies.STUDIES`.
        progress: called with the number of finished tasks.

    Returns:
        What could not be done, by name, with the reason.
    """
    missing_runs = [name for name in runs if not run_is_done(out, name)]
    # a camera's frames take longest: first, or one core waits for the other at the end
    missing_runs.sort(key=lambda name: str(RUNS[name].scenario().sensing.kind) != "camera")
    missing_studies = [name for name in studies if not study_is_done(out, name)]
    failures: Failures = {}
    total = len(missing_runs) + len(missing_studies)
    if not total:
        return failures
    # spawn: a recording stream that is inherited over fork drops what it is given
    context = multiprocessing.get_context("spawn")
    workers = min(total, os.cpu_count() or 1)
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting = {pool.submit(do_run, out, name): name for name in missing_runs}
        waiting |= {pool.submit(do_study, out, name): name for name in missing_studies}
        try:
            for count, future in enumerate(as_completed(waiting), start=1):
                try:
                    future.result()
                except TtwmrError as error:
                    failures[waiting[future]] = str(error)
                if progress:
                    progress(count)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return failures


def task_count(out: Path, runs: Iterable[str], studies: Iterable[str]) -> int:
    """How many tasks `execute` would do."""
    return sum(not run_is_done(out, name) for name in runs) + sum(
        not study_is_done(out, name) for name in studies
    )


def run_is_done(out: Path, name: str) -> bool:
    """Whether a finished run of exactly this scenario, by this very code, is there."""
    folder = run_folder(out, name)
    try:
        resolved = (folder / "scenario.resolved.toml").read_text(encoding="utf-8")
        code = (folder / DONE_FILE).read_text(encoding="utf-8")
    except OSError:
        return False
    return resolved.endswith(dump_scenario(RUNS[name].scenario())) and code == code_of_runs()


def do_run(out: Path, name: str) -> None:
    """One run into its folder."""
    from ttwmr_mj.run.execute import run_scenario

    scenario, folder = RUNS[name].scenario(), run_folder(out, name)
    shutil.rmtree(folder, ignore_errors=True)  # half a run, or one of another scenario
    folder.mkdir(parents=True)
    run = run_scenario(scenario, folder, command_line=RUNS[name].command())
    if run.outcome.status == "interrupted":  # Ctrl-C reaches the workers too
        raise KeyboardInterrupt
    write_text(folder / DONE_FILE, code_of_runs())


def study_is_done(out: Path, name: str) -> bool:
    """Whether a result of this very code is there."""
    try:
        stored = json.loads(study_file(out, name).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(stored.get("code") == code_of_studies())


def do_study(out: Path, name: str) -> None:
    """One study into its file."""
    result: Any = STUDIES[name]()
    path = study_file(out, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"code": code_of_studies(), "result": result})
