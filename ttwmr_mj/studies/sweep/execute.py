"""A sweep from its plan to its folder: what is missing is computed, and nothing twice."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from ttwmr_mj.errors import RunError
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.state import BoolArray
from ttwmr_mj.studies.sweep.compute import Compute, computed_shards
from ttwmr_mj.studies.sweep.folder.mend import drop_late, mend
from ttwmr_mj.studies.sweep.folder.part import Part
from ttwmr_mj.studies.sweep.folder.plan_file import PLAN_FILE, update_plan, write_plan
from ttwmr_mj.studies.sweep.folder.results import RESULTS_FILE, assemble, failures
from ttwmr_mj.studies.sweep.folder.shards import drop_remains, rows_done, shards_in, write_shard
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

BATCH = 64  # simulations at once: more are hardly faster, and lose more when they are killed
ALONE = 4  # runs that share no batch: with a camera, or a law of the user's

Told = Callable[[int, int], None]
"""Hears how many rows are done, and how many of them failed."""


def fill(
    plan: Plan,
    folder: Path,
    compute: Compute,
    *,
    part: Part | None = None,
    chunk: int | None = None,
    told: Told | None = None,
    warn: Callable[[list[str]], None] | None = None,
) -> bool:
    """Compute the rows of a plan, or of a part, that its folder lacks; then the table, if all are.

    Args:
        plan: that the folder holds, but for what changes no row: plan.json then says it anew.
        folder: of the sweep.
        compute: computes chunks.
        part: which rows; None: all.
        chunk: rows in a shard; None: what suits them.
        told: hears of the progress.
        warn: hears of files that were damaged, whose rows are computed again.

    Returns:
        Whether the table is complete.

    Raises:
        InputError: another process is at it.
        RunError: somebody removed the folder, or rows that were done; another call goes on.
    """
    part = part or Part()
    with locked(folder, part.name):
        if not part.name:
            drop_remains(folder, plan)
            if (damaged := mend(folder, plan)) and warn is not None:
                warn(damaged)
        update_plan(folder, plan)
        drop_late(folder, plan)
        done = rows_done(folder, plan)
        start, stop = part.rows(plan)
        _fill(plan, folder, compute, done[start:stop], start, chunk, told)
        done = rows_done(folder, plan)
        if gone := int((~done[start:stop]).sum()):
            rows = "1 row" if gone == 1 else f"{gone} rows"
            raise _removed(f"{rows} of {stop - start} in {folder}, which were done")
        _keep_plan(folder, plan)
        if done.all():
            if not (folder / RESULTS_FILE).is_file():
                assemble(folder, plan)
            return True
    return False


def _fill(
    plan: Plan,
    folder: Path,
    compute: Compute,
    done: BoolArray,
    start: int,
    chunk: int | None,
    told: Told | None,
) -> None:
    """Compute the rows from `start` on that are not done."""
    count, failed = int(done.sum()), 0
    if count:
        failed = _failures_before(folder, plan)
    if told is not None:
        told(count, failed)
    chunks = _chunks(np.flatnonzero(~done) + start, chunk or chunk_size(plan, len(done)))
    with closing(computed_shards(plan, chunks, compute)) as shards:
        for shard in shards:
            if not folder.is_dir():  # nor is the lock there, so that another process may fill it
                raise _removed(str(folder))
            _keep_plan(folder, plan)
            write_shard(folder, plan, shard.rows, shard.content)
            count += len(shard.rows)
            failed += failures(pq.read_table(io.BytesIO(shard.content), columns=["verdict"]))
            if told is not None:
                told(count, failed)


def _keep_plan(folder: Path, plan: Plan) -> None:
    """Without its plan a folder of shards would be refused, as nobody's."""
    if not (folder / PLAN_FILE).is_file():
        write_plan(folder, plan)


def _removed(what: str) -> RunError:
    return RunError(f"removed while the sweep ran: {what}; the same command goes on")


def _failures_before(folder: Path, plan: Plan) -> int:
    return sum(failures(shard.read(["verdict"])) for shard in shards_in(folder, plan))


def _chunks(rows: IntArray, size: int) -> Iterator[IntArray]:
    for start in range(0, len(rows), size):
        yield rows[start : start + size]


def chunk_size(plan: Plan, rows: int, processes: int = 8) -> int:
    """Rows in a shard: a batch for each variant, but several chunks for each process."""
    batch = ALONE if _alone(plan) else BATCH
    return max(1, min(batch * len(plan.variant_names), -(-rows // processes)))


def _alone(plan: Plan) -> bool:
    """Whether runs of some variant share no batch."""
    first = plan.rows_at(np.arange(min(plan.rows, len(plan.variant_names) * len(plan.seeds))))
    rows = {row.variant: row for row in first}.values()
    scenarios = (plan.scenario_of(row) for row in rows)
    return any(s.sensing.kind == "camera" or s.controller.alone for s in scenarios)
