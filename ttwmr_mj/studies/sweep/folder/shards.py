"""Shards: parts of the table of results, each written beside and renamed. They are the state.

    shards/<digest of the plan>/<first row>-<last row>-<count>.parquet

A shard's name tells its rows where none between first and last is left out; of others the rows are
read. Two processes that compute the same rows write the same bytes, and rows that are there twice
count once.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ttwmr_mj.errors import Fault, InputError, refused
from ttwmr_mj.files import delete_drafts, written
from ttwmr_mj.results.parquet import read_parquet
from ttwmr_mj.state import BoolArray
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

FOLDER = "shards"
NAMED = re.compile(r"(\d{9})-(\d{9})-(\d{1,9})(-[0-9a-f]{12})?\.parquet", re.ASCII)


@dataclass(frozen=True, slots=True)
class Shard:
    """A file of rows."""

    path: Path
    first: int
    last: int
    count: int

    @classmethod
    def of(cls, path: Path, plan: Plan) -> Self | None:
        """The shard of this name; None: it is no name of rows of this plan."""
        if not (named := NAMED.fullmatch(path.name)):
            return None
        first, last, count = map(int, named.groups()[:3])
        possible = first <= last < plan.rows and 0 < count <= last - first + 1
        return cls(path, first, last, count) if possible else None

    @property
    def rows(self) -> IntArray:
        """Which rows it holds."""
        if self.count == self.last - self.first + 1:
            return np.arange(self.first, self.last + 1, dtype=np.int64)
        return np.asarray(self.read(["row"])["row"].to_numpy())

    def read(self, columns: list[str] | None = None) -> pa.Table:
        """Its table, or some columns of it.

        Raises:
            InputError: the file is damaged.
        """
        try:
            return read_parquet(self.path, columns)
        except (OSError, ValueError) as error:
            why = refused(error) if isinstance(error, OSError) else str(error)
            problem = f"the file is damaged: {why.splitlines()[0]}"
            hint = "delete it; the same command computes its rows again"
            raise InputError(Fault(problem=problem, hint=hint), file=str(self.path)) from error


def shards_folder(folder: Path, plan: Plan) -> Path:
    """Where the shards of this plan are."""
    return folder / FOLDER / plan.digest


def shards_in(folder: Path, plan: Plan) -> list[Shard]:
    """All shards that are there, by their first rows."""
    paths = shards_folder(folder, plan).glob("*.parquet")
    found = [shard for path in paths if (shard := Shard.of(path, plan))]
    return sorted(found, key=lambda shard: (shard.first, shard.last, shard.count))


def rows_done(folder: Path, plan: Plan) -> BoolArray:
    """(rows,) Which rows are there."""
    done = np.zeros(plan.rows, dtype=bool)
    for shard in shards_in(folder, plan):
        done[shard.rows] = True
    return done


def to_bytes(table: pa.Table) -> bytes:
    """A table as a Parquet file."""
    stream = pa.BufferOutputStream()
    pq.write_table(table, stream)
    return bytes(stream.getvalue())


def write_shard(folder: Path, plan: Plan, rows: IntArray, content: bytes) -> None:
    """Put a shard where it counts; it appears whole or not at all.

    Args:
        folder: of the sweep.
        plan: whose.
        rows: that it holds, ascending.
        content: a Parquet file.
    """
    into = shards_folder(folder, plan)
    into.mkdir(parents=True, exist_ok=True)
    with written(into / _name(rows)) as draft, draft.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _name(rows: IntArray) -> str:
    first, last, count = int(rows[0]), int(rows[-1]), len(rows)
    gaps = count != last - first + 1
    which = "-" + hashlib.sha256(rows.astype("<i8").tobytes()).hexdigest()[:12] if gaps else ""
    return f"{first:09d}-{last:09d}-{count}{which}.parquet"


def drop_remains(folder: Path, plan: Plan) -> None:
    """Delete what killed processes left half written, and shards of plans that were extended."""
    for path in (folder / FOLDER).glob("*"):
        if path.name != plan.digest:
            shutil.rmtree(path, ignore_errors=True)
    delete_drafts([shards_folder(folder, plan)])
