"""Runs the rows of a suite that are not there yet, several at a time."""

import os
import shlex
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, get_args

from ttwmr_mj.config import frozen
from ttwmr_mj.errors import Fault, InputError, in_brief, refused, shown
from ttwmr_mj.files import read_json, resolved, write_json
from ttwmr_mj.results.accept import Status
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.runs.files.lock import NAME as LOCK
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.runs.files.new_folder import make_folder
from ttwmr_mj.runs.judgement.foresight import foretold
from ttwmr_mj.runs.many import Placed, batches, run_into_folders
from ttwmr_mj.scenario.file import find_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.bench.suite import Suite, SuiteRow, checked_scenarios, rows_of
from ttwmr_mj.studies.pool.halves import in_halves
from ttwmr_mj.studies.pool.ingredients import made_of_run
from ttwmr_mj.studies.pool.jobs import Failed, Job, run_jobs
from ttwmr_mj.studies.pool.laws import refused_laws
from ttwmr_mj.studies.pool.limits import has_more_time
from ttwmr_mj.studies.pool.task import MADE_OF_FILE, PRELOAD, Kept, run_files

BATCH = 16  # rows at once: what a kill may cost
ENTRIES = ("ttwmr_mj.runs.many",)
RUNS = "runs"  # where rows are
ROW_FILE = "row.json"
REMOVED = "its files were removed or changed while the suite ran"
Progress = Callable[[float], None]


def row_folder(row: SuiteRow, folder: Path) -> Path:
    """Where in a bench folder a row's run is."""
    return folder / RUNS / row.key


def stored_row(row: SuiteRow, folder: Path) -> dict[str, Any] | None:
    """The row.json of a finished run of this row; None if there is none.

    Whether the code and the files are still those of that run, only `run_suite` asks.

    Raises:
        InputError: it is damaged, or of a run by another command than the row's.
    """
    stored = _read_row(row, folder)
    if stored is not None and _wording(stored["run"]) != _wording(row.command()):
        was, now = (in_brief(command) for command in (stored["run"], row.command()))
        problem = f"was run as `{was}`; the suite has `{now}` for this row now"
        raise InputError(problem, file=str(row_folder(row, folder) / ROW_FILE))
    return stored


def _wording(command: str) -> list[str]:
    """Words of a row's command; of the scenario, named from any folder, the file's name alone.

    Raises:
        ValueError: it is none.
    """
    ttwmr, run, scenario, *sets = shlex.split(command)
    return [ttwmr, run, Path(scenario).name, *sets]


def _read_row(row: SuiteRow, folder: Path) -> dict[str, Any] | None:
    """The row.json that is there; None if none is.

    Raises:
        InputError: it is damaged.
    """
    path = row_folder(row, folder) / ROW_FILE
    try:
        stored = read_json(path)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        why = refused(error) if isinstance(error, OSError) else error
        raise InputError(f"cannot be read as a row of a suite: {why}", file=str(path)) from error
    if faults := list(_faults(stored)):
        raise InputError(*faults, file=str(path))
    return stored


def _faults(stored: dict[str, Any]) -> Iterator[Fault]:
    known = all(isinstance(stored.get(key), str) for key in ("status", "reason", "verdict"))
    ended = stored.get("status"), stored.get("verdict")
    # what did not come to its end has that for its verdict
    agree = ended[0] == "ok" or (ended[0] == ended[1] and ended[0] in get_args(Status))
    if not known or ended[1] not in VERDICTS or not agree:
        yield Fault(problem="does not say how the run ended")
    if not _is_command(run := stored.get("run")):
        allowed = "the command of a run, as in 'ttwmr run lab_circle --seed 0'"
        yield Fault(key=("run",), got=shown(run), allowed=allowed)


def _is_command(value: object) -> bool:
    try:
        return isinstance(value, str) and bool(_wording(value))
    except ValueError:
        return False


def _is_done(row: SuiteRow, kept: Kept, folder: Path, timeout_s: float) -> bool:
    """Whether a row need not be run: its result is whole, and of what it would be made of.

    One that timed out is run again where it may now take longer.
    """
    try:
        stored = _read_row(row, folder) if kept.is_done else None
    except InputError:
        return False
    return stored is not None and not has_more_time(stored["reason"], timeout_s)


def run_suite(
    suite: Suite,
    folder: Path,
    *,
    workers: int | None = None,
    progress: Progress | None = None,
    told: Callable[[list[str]], None] | None = None,
) -> dict[str, str]:
    """Run every row whose result is missing or outdated; after an interruption, call it again.

    Rows that can share a batch are computed in one.

    Args:
        suite: what to run.
        folder: made if missing; gets runs/<row>/, each a run folder with a row.json beside its
            files.
        workers: processes at a time; None: one per processor.
        progress: called with the number of rows done.
        told: called before the first run with what no law can do, in lines.

    Returns:
        Rows that were not run, or are not there any more, for a reason that is the machine's or
        somebody else's, and that reason; the next call tries them again.

    Raises:
        InputError: some rows cannot run, or another process fills the folder; none was started.
    """
    rows = {row.key: row for row in rows_of(suite)}
    scenarios = checked_scenarios(list(rows.values()))
    _refuse_laws(rows, scenarios, suite.timeout_s, workers)
    if told is not None:
        told(_foretold(scenarios.values()))
    make_folder(folder)
    _refuse_foreign(folder)
    with locked(folder):
        kept = {key: _kept(row, scenarios[key], folder) for key, row in rows.items()}
        limit_s = suite.timeout_s
        missing = [k for k, row in rows.items() if not _is_done(row, kept[k], folder, limit_s)]
        for key in rows.keys() - set(missing):
            _rename_row(rows[key], folder)
        placed = [_placed(rows[key], scenarios[key], folder) for key in missing]
        not_run: dict[str, str] = {}
        done = len(rows) - len(missing)
        with closing(_computed(placed, suite.timeout_s, workers)) as computed:
            for runs, failed in computed:
                for key in (run.folder.name for run in runs):
                    if failed is not None and _is_of_machine(failed, scenarios[key]):
                        not_run[key] = failed.reason
                        (row_folder(rows[key], folder) / ROW_FILE).unlink(missing_ok=True)
                        continue
                    with suppress(FileNotFoundError):  # removed meanwhile: see below
                        _write_row(rows[key], folder, failed.reason if failed else "")
                        kept[key].mark_done()
                done += len(runs)
                if progress is not None:
                    progress(float(done))
        for key in rows.keys() - not_run.keys():
            if not _is_done(rows[key], kept[key], folder, limit_s):
                not_run[key] = REMOVED
    return {key: not_run[key] for key in rows if key in not_run}


def _refuse_laws(
    rows: dict[str, SuiteRow], scenarios: dict[str, Scenario], timeout_s: float, workers: int | None
) -> None:
    """Refuse rows whose law is not there, or cannot be made: no run would say more of it."""
    placed = {key: (scenarios[key], _beside(row)) for key, row in rows.items()}
    refused = refused_laws(placed, timeout_s, workers=workers, preload=PRELOAD)
    faults = [
        Fault(key=(f"row {key}",), problem=str(fault))
        for key, found in refused.items()
        for fault in found
    ]
    if faults:
        raise InputError("laws that cannot be loaded, each with its first row", *faults)


def _refuse_foreign(folder: Path) -> None:
    """Refuse to spread into a folder that holds something else."""
    if not (folder / RUNS).exists() and any(path.name != LOCK for path in folder.iterdir()):
        problem = "the folder holds something, and no runs of a suite"
        raise InputError.at("--out", problem, got=str(folder), hint="give another one")


def _foretold(scenarios: Iterable[Scenario]) -> list[str]:
    """What tasks ask for and cannot get; of those that are alike but for the law, once."""
    alike = {
        frozen((s.name, s.reference, s.robot, s.ground, s.plant, s.sensing, s.duration_s)): s
        for s in scenarios
    }
    return list(dict.fromkeys(line for one in alike.values() for line in foretold(one)))


def _computed(
    runs: list[Placed], timeout_s: float, workers: int | None
) -> Generator[tuple[tuple[Placed, ...], Failed | None], None, None]:
    """Batches of runs, or those parts of them that could be computed, and what failed alone."""
    # each process fills one processor by itself; the server of processes passes this on
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    def compute(
        chunks: Iterable[tuple[Placed, ...]],
    ) -> Generator[tuple[tuple[Placed, ...], Failed | None], None, None]:
        jobs = (
            Job(
                chunk[0].folder.name,
                run_into_folders,
                (chunk,),
                timeout_s * len(chunk),
                tuple(placed.folder.absolute() for placed in chunk),
            )
            for chunk in chunks
        )
        with closing(run_jobs(jobs, workers=workers, preload=PRELOAD)) as events:
            for event in events:
                yield event.job.arguments[0], event if isinstance(event, Failed) else None

    # the largest first, so that no processor waits for one at the end
    chunks = sorted(batches(runs, BATCH), key=len, reverse=True)
    return in_halves(chunks, compute, lambda failed: failed is not None)


def _is_of_machine(failed: Failed, scenario: Scenario) -> bool:
    """Whether a run says nothing about its law: of ours, any that does not know how to fail."""
    unknown = failed.error is None and not failed.late
    return failed.of_machine or (unknown and not scenario.controller.of_others)


def _placed(row: SuiteRow, scenario: Scenario, folder: Path) -> Placed:
    into = row_folder(row, folder)
    words = "ttwmr", *row.arguments(into), "--quiet"
    return Placed(scenario, into.absolute(), words, _beside(row))


def _kept(row: SuiteRow, scenario: Scenario, folder: Path) -> Kept:
    made_of = made_of_run(scenario, _beside(row), ENTRIES)
    into = row_folder(row, folder)
    return Kept(made_of, into / MADE_OF_FILE, run_files(into))


def _beside(row: SuiteRow) -> Path:
    return resolved(find_scenario(row.scenario).parent)


def _write_row(row: SuiteRow, folder: Path, reason: str) -> None:
    """row.json of a run that is over: as its metrics say, failed if it was killed."""
    into = row_folder(row, folder)
    into.mkdir(parents=True, exist_ok=True)
    status = verdict = "failed"
    if not reason:
        metrics = read_json(into / "metrics.json")
        status, verdict = metrics["status"], metrics["verdict"]
        if status != "ok":
            reason = f"{status} at {metrics['end_time_s']:.3f} s: {metrics['reason']}"
    ended = {"status": status, "reason": reason, "verdict": verdict}
    write_json(into / ROW_FILE, {**_identity(row), **ended})


def _rename_row(row: SuiteRow, folder: Path) -> None:
    """Let the row.json of a run that is used again say how the suite words it now."""
    path = row_folder(row, folder) / ROW_FILE
    stored = read_json(path)
    if stored != stored | _identity(row):
        write_json(path, stored | _identity(row))


def _identity(row: SuiteRow) -> dict[str, Any]:
    return {**row.names, "seed": row.seed, "run": row.command()}
