"""Tables in Parquet files; the one place where such files are opened.

PyArrow makes more of a path than its name: `~` is a home to it, and what stands before a colon a
service elsewhere. So it gets open files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.deadline import step
from ttwmr_mj.files import no_device, written

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


@contextmanager
def parquet_writer(path: Path, columns: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Takes tables of these columns; the file appears whole or not at all.

    Raises:
        OSError: as of `written`.
    """
    import pyarrow.parquet as pq

    with (
        written(path) as draft,
        draft.open("wb") as file,
        pq.ParquetWriter(file, columns) as writer,
    ):
        yield writer


def write_parquet(tables: pa.Table | Iterable[pa.Table], path: Path) -> None:
    """Write a table, or successive pieces of one; the file appears whole or not at all."""
    import pyarrow as pa

    pieces = iter([tables] if isinstance(tables, pa.Table) else tables)
    first = next(pieces)
    with parquet_writer(path, first.schema) as writer:
        for piece in chain([first], pieces):
            writer.write_table(piece)
            step()


@contextmanager
def parquet_file(path: Path) -> Iterator[pq.ParquetFile]:
    """A file that is read piece by piece.

    Raises:
        OSError: it cannot be opened; what is none, such as a pipe, is not waited for.
        ValueError: it holds no table.
    """
    import pyarrow.parquet as pq

    no_device(path)
    with path.open("rb") as file, pq.ParquetFile(file) as parquet:
        yield parquet


def sound(table: pa.Table) -> pa.Table:
    """The same table; PyArrow reads texts and names as bytes, and looks at them when asked to.

    Raises:
        ValueError: a text or the name of a column is not UTF-8, or a name is there twice.
    """
    try:
        names = table.column_names
    except UnicodeDecodeError as error:
        raise ValueError("the name of a column is not UTF-8") from error
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"it has the column {twice[0][:100]} twice")
    table.validate(full=True)
    return table


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """The table in a file, or some columns of it.

    Raises:
        OSError: as of `parquet_file`.
        ValueError: it holds no such table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    no_device(path)
    with path.open("rb") as file:
        try:
            # `pq.read_table` stumbles over names that are there twice
            with pq.ParquetFile(file) as parquet:
                return sound(parquet.read(None if columns is None else list(columns)))
        except pa.ArrowException as error:
            raise ValueError(str(error).splitlines()[0]) from error
