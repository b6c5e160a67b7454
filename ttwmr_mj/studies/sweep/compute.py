"""Chunks computed: in processes of this machine, each a pure function from rows to a shard.

A chunk whose process breaks is cut in halves until the row is found that breaks it; that row is a
failed run, and the others are kept.
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass

from ttwmr_mj.errors import RunError, TtwmrError, described, in_brief
from ttwmr_mj.studies.pool.halves import in_halves
from ttwmr_mj.studies.pool.jobs import Done, Event, Job, run_jobs
from ttwmr_mj.studies.pool.task import PRELOAD
from ttwmr_mj.studies.sweep.engine import broken, table_of
from ttwmr_mj.studies.sweep.folder.shards import to_bytes
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

MODULES = (*PRELOAD, "ttwmr_mj.studies.sweep.compute")


@dataclass(frozen=True, slots=True)
class Computed:
    """A chunk's shard."""

    rows: IntArray
    content: bytes


@dataclass(frozen=True, slots=True)
class Broke:
    """A chunk whose process ended without an answer."""

    rows: IntArray
    reason: str
    of_machine: bool = False  # no fault of a run: killed from outside, no memory, no disk


@dataclass(frozen=True, slots=True)
class Unexpected:
    """An exception that nobody raised on purpose."""

    reason: str  # in a line
    traceback: str


Outcome = Computed | Broke
Compute = Callable[[Plan, Iterable[IntArray]], Generator[Outcome, None, None]]
"""Computes chunks in any order; takes one from the iterable only when there is room for it."""


def shard_of(plan: Plan, rows: IntArray) -> bytes | Unexpected:
    """The Parquet file of these rows: a pure function of its arguments.

    Raises:
        TtwmrError: this machine cannot run them.
    """
    try:
        return to_bytes(table_of(plan, rows))
    except TtwmrError:
        raise
    except Exception as error:
        return Unexpected(in_brief(described(error)), traceback.format_exc().strip())


def in_processes(workers: int | None) -> Compute:
    """Computes chunks in that many processes of this machine; None: one per processor."""

    def compute(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        # each process fills one processor by itself; the server of processes passes this on
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        jobs = (Job("chunk", shard_of, (plan, rows), plan.timeout_s * len(rows)) for rows in chunks)
        with closing(run_jobs(jobs, workers=workers, preload=MODULES)) as events:
            for event in events:
                yield _outcome(event)

    return compute


def _outcome(event: Event) -> Outcome:
    rows = event.job.arguments[1]
    if isinstance(event, Done):
        return computed(rows, event.result)
    if event.error is not None:
        raise event.error
    return Broke(rows, event.reason, event.of_machine)


def computed(rows: IntArray, result: bytes | Unexpected) -> Computed:
    """The shard, unless there is none for a reason that another try would not change.

    Raises:
        RunError: the code broke, not a run.
    """
    if isinstance(result, Unexpected):
        where = "a law of your own that ran there may have caused it; --debug shows where"
        what = f"rows {rows[0]} to {rows[-1]} could not be computed: {result.reason}"
        error = RunError(f"{what}; {where}")
        error.add_note(result.traceback)
        raise error
    return Computed(rows, result)


def computed_shards(
    plan: Plan, chunks: Iterable[IntArray], compute: Compute
) -> Generator[Computed, None, None]:
    """Every chunk's shard, in the order in which they are done; what breaks is halved.

    Raises:
        RunError: the machine kept a row from being run; the others may be there.
    """

    def outcomes(some: Iterable[IntArray]) -> Generator[tuple[IntArray, Outcome], None, None]:
        with closing(compute(plan, some)) as found:
            for outcome in found:
                yield outcome.rows, outcome

    pieces = in_halves(chunks, outcomes, lambda outcome: isinstance(outcome, Broke))
    with closing(pieces) as found:
        for rows, outcome in found:
            if isinstance(outcome, Broke):
                if outcome.of_machine:
                    why = in_brief(outcome.reason)
                    raise RunError(f"row {rows[0]} was not run: {why}; the same command goes on")
                table = broken(plan, int(rows[0]), outcome.reason)
                outcome = Computed(rows, to_bytes(table))
            yield outcome
