"""From run folders to lines of a ranking: scored from stored trajectories, nothing simulated."""

import json
import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.results.curves import centre_of_oscillation
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import FloatArray
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
# A run that comes to its end is lost if its largest error in the last share of it is beyond these:
# two thirds of the trailer's length, and the size of the references.
LAST_SHARE = 0.2
LAST_CENTRE, LAST_P = "last_centre_of_oscillation_max_error_m", "last_tractor_max_error_m"
LOST_CENTRE_M = 0.1  # of the trailer's centre of oscillation, where the reference has one
LOST_P_M = 0.5  # of P, where it has none


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the leaderboard: a controller on a task, all seeds together.

    Attributes:
        names: axis → name.
        values: column → number; None where undefined.
        runs: how many there were.
        failures: how many of them ended early or were lost.
        lost: how many of them were lost.
        reason: of the first failure.
        command: runs its first seed again.
        manifest: of its first seed, relative to the leaderboard; None if that never started.
    """

    names: dict[str, str]
    values: dict[str, float | None]
    runs: int
    failures: int
    lost: int
    reason: str
    command: str
    manifest: str | None


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
    """row.json with the row's numbers, and with a run that was lost called so."""
    numbers = _numbers(run) if stored["status"] == "ok" else {}
    manifest = run / "manifest.json"
    there = str(manifest.relative_to(folder)) if manifest.is_file() else None
    found = {**stored, "numbers": numbers, "manifest": there}
    lost = lost_reason(numbers)
    return found | {"status": "lost", "reason": lost} if lost else found


def lost_reason(numbers: Metrics) -> str:
    """Why a run that finished counts as lost; empty if it does not."""
    centre, tractor = numbers.get(LAST_CENTRE), numbers.get(LAST_P)
    if centre is not None:
        where, error, limit = "the trailer's centre of oscillation", centre, LOST_CENTRE_M
    else:
        where, error, limit = "P", tractor or 0.0, LOST_P_M
    return f"lost: error of {where} at the end {error:.2g} m > {limit:g} m" if error > limit else ""


def _numbers(folder: Path) -> Metrics:
    """The metrics of a run, scored afresh; the control time is as it was measured."""
    robot = load_scenario(str(folder / "scenario.resolved.toml")).robot
    trajectory = Trajectory.read(folder / "trajectory.parquet")
    stored = json.loads((folder / "metrics.json").read_text())
    return {
        **score(trajectory, robot)[0],
        LAST_CENTRE: _last_error(trajectory, lambda q: centre_of_oscillation(q, robot)),
        LAST_P: _last_error(trajectory, lambda q: q[..., :2]),
        "control_time_per_sample_us": stored["control_time_per_sample_us"],
    }


def _last_error(trajectory: Trajectory, point: Callable[[FloatArray], FloatArray]) -> float | None:
    """Largest error of a point of q in the last share of a run [m]; None if undefined."""
    rows = slice(int((1.0 - LAST_SHARE) * len(trajectory)), None)
    miss = point(trajectory.q[rows, 0]) - point(trajectory.ref_q[rows, 0])
    largest = float(np.hypot(miss[:, 0], miss[:, 1]).max())
    return largest if math.isfinite(largest) else None


def _line(names: tuple[str, ...], rows: list[dict[str, Any]]) -> Line:
    bad = [row for row in rows if row["status"] != "ok"]
    good = [row["numbers"] for row in rows if row["numbers"]]
    return Line(
        names=dict(zip(AXES, names, strict=True)),
        values={column: _combined(good, *how) for column, how in COLUMNS.items()},
        runs=len(rows),
        failures=len(bad),
        lost=sum(row["status"] == "lost" for row in bad),
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
