"""Damaged files of a sweep: named, and out of the way, so that their rows are computed again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ttwmr_mj.errors import InputError
from ttwmr_mj.files import no_device, remove
from ttwmr_mj.studies.sweep.engine import schema_of
from ttwmr_mj.studies.sweep.folder.results import RESULTS_FILE
from ttwmr_mj.studies.sweep.folder.shards import Shard, shards_in
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


def _is_sound(shard: Shard, plan: Plan) -> bool:
    try:
        table = shard.read()
    except InputError:
        return False
    if not table.schema.equals(schema_of(plan)) or table.num_rows != shard.count or not len(table):
        return False
    rows = table["row"].to_numpy()
    ends = (rows[0], rows[-1]) == (shard.first, shard.last)
    return bool(ends and rows[-1] < plan.rows and (np.diff(rows) > 0).all())


def _holds_all(path: Path, plan: Plan) -> bool:
    try:
        no_device(path)
        with pq.ParquetFile(path) as file:
            rows = [
                file.read_row_group(i, columns=["row"])["row"].to_numpy()
                for i in range(file.num_row_groups)
            ]
            for i in range(file.num_row_groups):  # every column can be read
                file.read_row_group(i)
            schema = file.schema_arrow
    except (OSError, ValueError, KeyError, pa.ArrowException):
        return False
    return bool(schema.equals(schema_of(plan))) and np.array_equal(
        np.concatenate(rows or [np.empty(0)]), np.arange(plan.rows)
    )
