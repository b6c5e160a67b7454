"""results.parquet: all rows in order, the same bytes however the work was cut up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ttwmr_mj.results.parquet import parquet_writer
from ttwmr_mj.results.verdict import SUCCESSES
from ttwmr_mj.studies.sweep.engine import schema_of
from ttwmr_mj.studies.sweep.folder.shards import Shard, shards_in
from ttwmr_mj.studies.sweep.plan.plan import Plan

RESULTS_FILE = "results.parquet"
REPORT_FILE = "report.html"
GROUP = 65_536  # rows in memory at a time, and in a row group of the file


def assemble(folder: Path, plan: Plan) -> None:
    """Write results.parquet from shards that hold every row, some perhaps twice."""
    path, shards = folder / RESULTS_FILE, shards_in(folder, plan)
    with parquet_writer(path, schema_of(plan)) as writer:
        for start in range(0, plan.rows, GROUP):
            writer.write_table(_window(shards, start, min(start + GROUP, plan.rows)), GROUP)


def _window(shards: list[Shard], start: int, stop: int) -> pa.Table:
    """The rows from start to stop, in order, each once."""
    parts = []
    for shard in shards:
        if shard.first < stop and shard.last >= start:
            table = shard.read()
            inside = pc.and_(pc.greater_equal(table["row"], start), pc.less(table["row"], stop))
            parts.append(table.filter(inside))
    table = pa.concat_tables(parts)
    rows, first = np.unique(table["row"].to_numpy(), return_index=True)
    if not np.array_equal(rows, np.arange(start, stop)):
        raise AssertionError(f"rows are missing between {start} and {stop}")
    return table.take(first).combine_chunks()


def failures(table: pa.Table) -> int:
    """How many of these rows did not do their job."""
    return len(table) - int(pc.sum(pc.is_in(table["verdict"], pa.array(SUCCESSES))).as_py() or 0)
