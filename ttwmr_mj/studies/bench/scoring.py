"""From run folders to lines of a ranking: scored from stored trajectories, nothing simulated."""

import os
from collections import Counter, defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import Fault, InputError, cut, described, in_brief, in_one_line
from ttwmr_mj.files import read_json
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.results.metrics_file import read_metrics
from ttwmr_mj.results.verdict import Verdict
from ttwmr_mj.runs.judgement.judged import judged
from ttwmr_mj.runs.judgement.verdict import demands_of, verdict_on
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.run import StoredRun
from ttwmr_mj.studies.bench.execute import ROW_FILE, row_folder, stored_row
from ttwmr_mj.studies.bench.lines import COLUMNS, Line, Run, ranked, without_repeats
from ttwmr_mj.studies.bench.suite import AXES, Suite, SuiteRow, rows_of
from ttwmr_mj.studies.pool.ingredients import differences, digest
from ttwmr_mj.studies.pool.task import MADE_OF_FILE

TIME_KEY = "control_time_per_sample_us"
SCENARIO_FILE, ROWS_FILE = "scenario.resolved.toml", "trajectory.parquet"
NEEDED = (SCENARIO_FILE, ROWS_FILE, "metrics.json")
MOST_KEYS = 4  # told of those in which scenarios differ
DECIDE = ("kind", "seed", "world")  # keys that others follow from


@dataclass(frozen=True, slots=True)
class Board:
    """What a bench folder holds of a suite.

    Attributes:
        lines: tasks apart; within one, fewer failures first, then the smaller error.
        rows: how many the suite has.
        made_by: version and commit → rows made by it; all together those that were run.
        damaged: rows whose files are missing, cannot be read, or are of another command or scenario
            than the suite gives them, and why; they count as not run.
    """

    lines: list[Line]
    rows: int
    made_by: Counter[str]
    damaged: dict[str, str] = field(default_factory=dict)


def collect(suite: Suite, folder: Path) -> Board:
    """Score every finished row of a suite and rank the lines within each task.

    A row whose files vanish meanwhile, row.json too, as of one that is run again, is not finished.

    Raises:
        InputError: there is no finished row, and no damaged one.
    """
    rows, damaged = rows_of(suite), dict[str, str]()
    groups: dict[tuple[str, ...], list[tuple[SuiteRow, Run]]] = defaultdict(list)
    made_by: Counter[str] = Counter()
    for row in rows:
        try:
            scored = _scored(row, folder)
        except Exception as error:  # whatever a damaged file, or a stranger's, makes of our readers
            damaged[row.key] = _why(error)
            continue
        if scored is not None:
            groups[tuple(row.names[axis] for axis in AXES)].append((row, scored))
            made_by[maker_of(row_folder(row, folder))] += 1
    if not groups and not damaged:
        problem = f"no finished runs of {suite.name} in it"
        raise InputError.at("--out", problem, got=str(folder), hint="run the suite first")
    lines = [_named(_line(group, folder), group[0][0], suite) for group in groups.values()]
    names = {axis: [line.names[axis] for line in lines] for axis in AXES}
    order = {axis: list(dict.fromkeys([*getattr(suite, axis), *names[axis]])) for axis in AXES}
    return Board(ranked(lines, order), len(rows), made_by, damaged)


def _why(error: Exception) -> str:
    """In a line."""
    if isinstance(error, InputError):
        return "; ".join(line.strip() for line in str(error).splitlines())
    return in_brief(described(error))


def maker_of(folder: Path) -> str:
    """Version and commit that made a run; unknown for one that never started, or does not say."""
    try:
        said = read_json(folder / "manifest.json")
        commit, *dirty = (said["git_commit"] or "unknown").split("-", 1)
        version = said["ttwmr_mj"].strip()
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "unknown"
    return in_one_line(cut(f"version {version}, commit {'-'.join([commit[:12], *dirty])}"))


def _line(scored: list[tuple[SuiteRow, Run]], folder: Path) -> Line:
    first = scored[0][0]
    recordings = (row_folder(row, folder) / "run.rrd" for row, _ in scored)
    manifest = row_folder(first, folder) / "manifest.json"
    line = Line(
        names=dict(first.names),
        runs=tuple(run for _, run in scored),
        scored=first.scored,
        meant=first.meant,
        command=first.command(),
        manifest=str(manifest.relative_to(folder)) if manifest.is_file() else None,
        recordings=tuple(str(p.relative_to(folder)) for p in recordings if p.is_file()),
    )
    return without_repeats(line)


def _named(line: Line, row: SuiteRow, suite: Suite) -> Line:
    """The line with the plant and the sensor that its scenario has, where the suite names none."""
    if left_out := {"plant", "sensing"} - suite.model_fields_set:
        scenario = row.load()
        found = {axis: getattr(scenario, axis).kind for axis in left_out}
        return replace(line, names=line.names | found)
    return line


def _scored(row: SuiteRow, folder: Path) -> Run | None:
    """A row's numbers and its verdict; None if it is not finished."""
    stored = stored_row(row, folder)
    if stored is None:
        return None
    numbers: Metrics = {}
    name, sentence = stored["status"], in_brief(stored["reason"])
    into = row_folder(row, folder)
    needed = NEEDED if name == "ok" else (SCENARIO_FILE,)
    try:
        if name == "ok":
            numbers, verdict = _judged(into, row)
            name, sentence = verdict.name, str(verdict)
        elif (into / SCENARIO_FILE).is_file():  # else it never started
            _refuse_another(load_scenario(into / SCENARIO_FILE), into, row)
    except (OSError, InputError):
        missing = [file for file in needed if not os.path.lexists(into / file)]
        if not missing:  # damaged
            raise
        if not (into / ROW_FILE).is_file():  # removed meanwhile
            return None
        problem = f"is missing, and {ROW_FILE} says that the run ended"
        raise InputError(problem, file=str(into / missing[0])) from None
    values = {column: how.of(numbers, row.scored) for column, how in COLUMNS.items()}
    return Run(row.seed, name, sentence, stored["status"] == "ok", values)


def _refuse_another(scenario: Scenario, folder: Path, row: SuiteRow) -> None:
    """Refuse what was run, in its folder, of another scenario than the row's.

    Raises:
        InputError: with the file's name.
    """
    if keys := differences(_comparable(scenario), _comparable(row.load())):
        keys.sort(key=lambda key: key.rpartition(".")[2] not in DECIDE)
        more = f" and {len(keys) - MOST_KEYS} more" if len(keys) > MOST_KEYS else ""
        told = f"differs in {', '.join(keys[:MOST_KEYS])}{more}"
        problem = f"is not what {row.scenario} and the suite give this row now: {told}"
        raise InputError(problem, file=str(folder / SCENARIO_FILE))


def _comparable(scenario: Scenario) -> Any:
    """Its values, but for what no number is made of and where files are, which may be moved."""
    return _without_folders(
        scenario.model_dump(
            mode="json",  # in which NaN among a law's options is equal to itself
            exclude={"name": True, "description": True, "output": True, "controller": {"folder"}},
        )
    )


def _without_folders(value: Any) -> Any:
    """The same, absolute paths as the file's name."""
    if isinstance(value, dict):
        return {key: _without_folders(item) for key, item in value.items()}
    return Path(value).name if isinstance(value, str) and Path(value).is_absolute() else value


def _refuse_exchanged(file: Path) -> None:
    """Refuse another file than the run wrote.

    Raises:
        InputError: with the file's name.
    """
    try:
        written = read_json(file.parent / MADE_OF_FILE)["files"][file.name]
    except (OSError, ValueError, KeyError, TypeError):
        return  # nobody knows
    if written != digest(file):
        problem = f"is not the one that this run wrote, whose digest is in {MADE_OF_FILE}"
        raise InputError(problem, file=str(file))


def _judged(folder: Path, row: SuiteRow) -> tuple[Metrics, Verdict]:
    """Metrics and verdict of a run, made afresh; the control time is as it was measured."""
    run, said = StoredRun.read(folder), read_metrics(folder / "metrics.json")
    _refuse_another(run.scenario, folder, row)
    _refuse_exchanged(folder / ROWS_FILE)
    if said["status"] != "ok" or said[TIME_KEY] is None:
        fault = Fault(problem=f"is not that of a run that came to its end, which {ROW_FILE} tells")
        raise InputError(fault, file=str(folder / "metrics.json"))
    numbers = score(judged(run.rows, run.scenario), run.scenario.robot)[0]
    demands = demands_of(run.scenario, run.reference)
    return {**numbers, TIME_KEY: said[TIME_KEY]}, verdict_on(run.scenario, run.rows, demands)
