"""Rows of a sweep that are computed again: of damaged files, and with more time than before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import remove
from ttwmr_mj.results.parquet import parquet_file, sound
from ttwmr_mj.studies.pool.limits import has_more_time
from ttwmr_mj.studies.sweep.engine import schema_of
from ttwmr_mj.studies.sweep.folder.results import REPORT_FILE, RESULTS_FILE
from ttwmr_mj.studies.sweep.folder.shards import Shard, shards_in, to_bytes, write_shard
from ttwmr_mj.studies.sweep.plan.plan import Plan


def mend(folder: Path, plan: Plan) -> list[str]:
    """Delete shards and a table that cannot be read or hold something else; says which."""
    bad = [shard.path for shard in shards_in(folder, plan) if not _is_sound(shard, plan)]
    table = folder / RESULTS_FILE
    if table.exists() and not table.is_dir() and not _holds_all(table, plan):
        bad.append(table)
    for path in bad:
        remove(path)
    return [f"{path}: damaged; it is made again" for path in bad]


def drop_late(folder: Path, plan: Plan) -> None:
    """Take out rows that timed out when they were allowed less time than now.

    Killed at any moment, or done by several processes at once, it can be done again.
    """
    for shard in shards_in(folder, plan):
        try:
            reasons = shard.read(["reason"])["reason"].to_pylist()
        except InputError:  # damaged, or just taken by the process of another part
            continue
        late = np.array([has_more_time(reason or "", plan.timeout_s) for reason in reasons])
        if not late.any():
            continue
        for name in (RESULTS_FILE, REPORT_FILE):
            (folder / name).unlink(missing_ok=True)
        if not late.all():
            rest = shard.read().filter(~late).combine_chunks()
            write_shard(folder, plan, rest["row"].to_numpy(), to_bytes(rest))
        shard.path.unlink(missing_ok=True)


def refuse_damaged(shard: Shard, plan: Plan) -> None:
    """Refuse a shard that cannot be read, or does not hold the rows that its name says.

    Raises:
        InputError: with the file.
    """
    table = shard.read()
    holds = table.schema.equals(schema_of(plan)) and table.num_rows == shard.count
    if holds:
        rows = table["row"].to_numpy()
        holds = (rows[0], rows[-1]) == (shard.first, shard.last) and (np.diff(rows) > 0).all()
    if not holds:
        problem = "the file is damaged: it does not hold the rows that its name says"
        hint = "delete it, and run its sweep again"
        raise InputError(Fault(problem=problem, hint=hint), file=str(shard.path))


def _is_sound(shard: Shard, plan: Plan) -> bool:
    try:
        refuse_damaged(shard, plan)
    except InputError:
        return False
    return True


def _holds_all(path: Path, plan: Plan) -> bool:
    try:
        with parquet_file(path) as file:
            rows = [
                file.read_row_group(i, columns=["row"])["row"].to_numpy()
                for i in range(file.num_row_groups)
            ]
            for i in range(file.num_row_groups):  # every column can be read
                sound(file.read_row_group(i))
            schema = file.schema_arrow
    except (OSError, ValueError, KeyError, pa.ArrowException):
        return False
    return bool(schema.equals(schema_of(plan))) and np.array_equal(
        np.concatenate(rows or [np.empty(0)]), np.arange(plan.rows)
    )
