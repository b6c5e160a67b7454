"""From run folders to lines of a ranking: scored from stored trajectories, nothing simulated."""

import json
import math
import statistics
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import InputError
from ttwmr_mj.results.accept import VerdictName
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.results.verdict import VERDICTS, Verdict
from ttwmr_mj.runs.build import sample_reference
from ttwmr_mj.runs.judged import judged
from ttwmr_mj.runs.verdict import demands_of, verdict_on
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.bench.execute import row_folder, stored_row
from ttwmr_mj.studies.bench.suite import AXES, Suite, rows_of

# column → (metric, scale, how seeds are combined)
COLUMNS: dict[str, tuple[str, float, str]] = {
    "P rms, mm": ("steady_tractor_rmse_m", 1e3, "median"),
    "P rms worst, mm": ("steady_tractor_rmse_m", 1e3, "worst"),
    "trailer rms, mm": ("steady_trailer_rmse_m", 1e3, "median"),
    "trailer rms worst, mm": ("steady_trailer_rmse_m", 1e3, "worst"),
    "settled, s": ("settling_time_s", 1.0, "median"),
    "effort, rad²/s": ("control_effort", 1.0, "median"),
    "saturated, %": ("saturated_share", 100.0, "median"),
    "blind, %": ("blind_share", 100.0, "median"),
    "control, µs": ("control_time_per_sample_us", 1.0, "median"),
}
RANKED_BY = "trailer rms, mm"
SETTLING = "settling_time_s"
SUCCESSES = ("followed", "no_reference")  # what is no failure; without a reference nothing can be


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the leaderboard: a controller on a task, all seeds together.

    Attributes:
        names: axis → name.
        values: column → number; None where undefined.
        runs: how many there were.
        failures: how many of them did not follow.
        lost: how many of those came to their end.
        verdicts: name → how many got it.
        reason: of the first failure.
        command: runs its first seed again.
        manifest: of its first seed, relative to the leaderboard; None if that never started.
    """

    names: dict[str, str]
    values: dict[str, float | None]
    runs: int
    failures: int
    lost: int
    verdicts: Counter[VerdictName]
    reason: str
    command: str
    manifest: str | None

    @property
    def verdict(self) -> str:
        """In words; with counts where runs differ."""
        counted = [(VERDICTS[name][0], count) for name, count in self.verdicts.most_common()]
        if len(counted) == 1:
            return counted[0][0]
        return "; ".join(f"{count} {words}" for words, count in counted)


@dataclass(frozen=True, slots=True)
class Board:
    """What a bench folder holds of a suite.

    Attributes:
        lines: tasks apart; within one, fewer failures first, then the smaller trailer error.
        rows: how many the suite has.
        made_by: version and commit → rows made by it; all together those that were run.
    """

    lines: list[Line]
    rows: int
    made_by: Counter[str]


def collect(suite: Suite, folder: Path) -> Board:
    """Score every finished row of a suite and rank the lines within each task.

    Raises:
        InputError: there is no finished row.
    """
    rows = rows_of(suite)
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = defaultdict(list)
    made_by: Counter[str] = Counter()
    for row in rows:
        if found := stored_row(row, folder):
            names = tuple(row.names[axis] for axis in AXES)
            groups[names].append(_scored(found, row_folder(row, folder), folder))
            made_by[_maker(row_folder(row, folder))] += 1
    if not groups:
        problem = f"no finished runs of {suite.name} in it"
        raise InputError.at("--out", problem, got=str(folder), hint="run the suite first")
    order = {axis: list(getattr(suite, axis)) for axis in AXES}
    lines = [_line(names, group) for names, group in groups.items()]
    lines.sort(key=lambda line: _rank(line, order))
    return Board(lines, len(rows), made_by)


def _maker(folder: Path) -> str:
    """Version and commit that made a run; unknown for one that never started."""
    manifest = folder / "manifest.json"
    if not manifest.is_file():
        return "unknown"
    said = json.loads(manifest.read_text())
    commit, *dirty = (said["git_commit"] or "unknown").split("-", 1)
    return f"version {said['ttwmr_mj']}, commit {'-'.join([commit[:12], *dirty])}"


def _scored(stored: dict[str, Any], run: Path, folder: Path) -> dict[str, Any]:
    """row.json with the row's numbers and its verdict."""
    numbers: Metrics = {}
    name, reason = stored["status"], stored["reason"]
    if name == "ok":
        numbers, verdict = _judged(run)
        name = verdict.name
        reason = "" if name in SUCCESSES else str(verdict)
    manifest = run / "manifest.json"
    there = str(manifest.relative_to(folder)) if manifest.is_file() else None
    return {**stored, "numbers": numbers, "manifest": there, "verdict": name, "reason": reason}


def _judged(folder: Path) -> tuple[Metrics, Verdict]:
    """Metrics and verdict of a run, made afresh; the control time is as it was measured."""
    scenario = load_scenario(str(folder / "scenario.resolved.toml"))
    trajectory = Trajectory.read(folder / "trajectory.parquet")
    stored = json.loads((folder / "metrics.json").read_text())
    key = "control_time_per_sample_us"
    numbers = {**score(judged(trajectory, scenario), scenario.robot)[0], key: stored[key]}
    demands = demands_of(scenario, sample_reference(scenario))
    return numbers, verdict_on(scenario, trajectory, demands)


def _line(names: tuple[str, ...], rows: list[dict[str, Any]]) -> Line:
    bad = [row for row in rows if row["verdict"] not in SUCCESSES]
    good = [row["numbers"] for row in rows if row["numbers"]]
    return Line(
        names=dict(zip(AXES, names, strict=True)),
        values={column: _combined(good, *how) for column, how in COLUMNS.items()},
        runs=len(rows),
        failures=len(bad),
        lost=sum(row["status"] == "ok" for row in bad),
        verdicts=Counter(row["verdict"] for row in rows),
        reason=bad[0]["reason"].splitlines()[-1] if bad and bad[0]["reason"] else "",
        command=rows[0]["run"],
        manifest=rows[0]["manifest"],
    )


def _combined(runs: list[Metrics], metric: str, scale: float, how: str) -> float | None:
    """Median or worst over the runs that came to their end; None where undefined."""
    numbers = [run[metric] for run in runs]
    if metric == SETTLING:  # what never settles takes longest
        numbers = [math.inf if number is None else number for number in numbers]
    defined = [number for number in numbers if number is not None]
    if not defined:
        return None
    value = scale * (statistics.median(defined) if how == "median" else max(defined))
    return value if math.isfinite(value) else None


def _rank(line: Line, order: dict[str, list[str]]) -> tuple[Any, ...]:
    """Tasks and their conditions as the suite has them; failures, then errors within one."""
    place = {axis: order[axis].index(name) for axis, name in line.names.items()}
    where = (place["task"], place["sensing"], place["plant"], place["disturbance"])
    error = line.values[RANKED_BY]
    return (*where, line.failures, math.inf if error is None else error, place["controller"])
