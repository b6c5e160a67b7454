"""Rows of a finished sweep run again with recordings: the worst, the median, the failed."""

from __future__ import annotations

import shlex
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ttwmr_mj.errors import InputError, RunError, shown, whole
from ttwmr_mj.results.parquet import read_parquet
from ttwmr_mj.results.verdict import SUCCESSES
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.pool.jobs import Failed, run_jobs
from ttwmr_mj.studies.pool.task import PRELOAD, run_task
from ttwmr_mj.studies.sweep.folder.results import RESULTS_FILE
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.words import command_of

ALLOWED = "worst:N, best:N, median or failed:N, with N at least 1"


@dataclass(frozen=True, slots=True)
class Wish:
    """Which rows are recorded."""

    which: str  # worst, best, median or failed
    count: int

    @classmethod
    def of(cls, text: str) -> Wish:
        """What --record says.

        Raises:
            InputError: it is no such thing.
        """
        which, colon, count = text.partition(":")
        if text == "median":
            return cls("median", 1)
        if which in ("worst", "best", "failed") and colon and (number := whole(count)):
            return cls(which, number)
        raise InputError.at("--record", got=shown(text), allowed=ALLOWED)


def rows_to_record(plan: Plan, folder: Path, wish: Wish) -> list[int]:
    """The rows of a finished sweep that are meant, the most meant first.

    Rows without the headline metric are worse than all that have it.
    """
    table = read_parquet(folder / RESULTS_FILE, ["row", "verdict", plan.metric])
    if wish.which == "failed":
        failed = table.filter(pc.invert(pc.is_in(table["verdict"], pa.array(SUCCESSES))))
        return [int(row) for row in failed["row"].to_pylist()[: wish.count]]
    metric = _numbers(table[plan.metric])
    order = np.lexsort((np.arange(len(metric)), metric))  # NaN comes last
    match wish.which:
        case "worst":
            picked = order[::-1][: wish.count]
        case "best":
            picked = order[: wish.count]
        case _:
            defined = order[: max(int(np.isfinite(metric).sum()), 1)]
            picked = defined[[(len(defined) - 1) // 2]]
    return [int(row) for row in table["row"].to_numpy()[picked]]


def _numbers(column: pa.ChunkedArray) -> FloatArray:
    return np.asarray(column.cast(pa.float64()).fill_null(np.nan).to_numpy())


def record(plan: Plan, folder: Path, wish: Wish, *, workers: int | None = None) -> list[Path]:
    """Run rows again, each into recorded/row-<number>/; those that are there already are left.

    Returns:
        The run folders.

    Raises:
        RunError: a row could not be recorded.
    """
    numbers = rows_to_record(plan, folder, wish)
    tasks = []
    for row in plan.rows_at(np.array(numbers, dtype=np.int64)):
        into = folder / "recorded" / f"row-{row.row:09d}"
        words = shlex.split(command_of(plan, row))
        tasks.append((into, run_task(into.name, plan.scenario_of(row), into, words, plan.beside)))
    missing = {task.job.name: task for _, task in tasks if not task.is_done}
    jobs = [task.job for task in missing.values()]
    with closing(run_jobs(jobs, workers=workers, preload=PRELOAD)) as events:
        for event in events:
            if isinstance(event, Failed):
                raise RunError(f"{event.job.name} could not be recorded: {event.reason}")
            missing[event.job.name].mark_done()
    return [into for into, _ in tasks]
