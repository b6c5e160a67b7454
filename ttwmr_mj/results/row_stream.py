"""A trajectory while it grows: rows appended to an Arrow IPC stream, readable whenever it ends."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

from ttwmr_mj.errors import InputError
from ttwmr_mj.files import holds, no_device
from ttwmr_mj.results.parquet import sound
from ttwmr_mj.results.trajectory import Trajectory

if TYPE_CHECKING:
    import pyarrow as pa

ROWS_FILE = "trajectory.arrows"


class RowStream:
    """Appends rows of one simulation to a file, with the columns of trajectory.parquet.

    What has been appended survives the process; nothing is promised of a machine that stops.

    Args:
        path: the file; it appears with the first rows.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: IO[bytes] | None = None
        self._writer: pa.RecordBatchStreamWriter | None = None

    def append(self, rows: Trajectory) -> None:
        """Write the next rows; all have the signals of the first.

        Raises:
            OSError: the file cannot be written.
        """
        if not len(rows):
            return
        import pyarrow as pa

        table = rows.to_table()
        if self._file is None or self._writer is None:
            # for the end: what a run needs is loaded at its start
            import pyarrow.parquet

            self._file = self._path.open("wb")
            self._writer = pa.ipc.new_stream(self._file, table.schema)
        self._writer.write_table(table)
        self._file.flush()

    def close(self) -> None:
        """Give the file back as it is; a second call does nothing."""
        if self._file is not None:
            with suppress(OSError):  # of bytes that a full disk did not take
                self._file.close()
            self._file = self._writer = None

    def delete(self) -> None:
        """Without the file, whose rows are elsewhere now."""
        self.close()
        self._path.unlink(missing_ok=True)


def read_rows(path: Path) -> Trajectory:
    """The rows of such a file, as a batch of one; a torn end is left out.

    Raises:
        InputError: it cannot be read, or holds no rows.
    """
    import pyarrow as pa

    batches = []
    try:
        no_device(path)
        with path.open("rb") as file:
            stream = pa.ipc.open_stream(file)
            with suppress(OSError, pa.ArrowException):  # its writer was killed in the middle of one
                batches.extend(stream)
            table = sound(pa.Table.from_batches(batches, stream.schema))
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"cannot be read as a trajectory: {reason}", file=str(path)) from error
    if not table.num_rows:
        raise InputError("there are no rows in it", file=str(path))
    return Trajectory.of_table(table, str(path))


def holds_rows(path: Path) -> bool:
    """Whether there is a row in such a file; a full disk may have taken none."""
    import pyarrow as pa

    try:
        no_device(path)
        with path.open("rb") as file, pa.ipc.open_stream(file) as stream:
            return bool(stream.read_next_batch().num_rows)
    except (OSError, ValueError, StopIteration, pa.ArrowException):
        return False


def rows_file(folder: Path) -> Path:
    """Where the rows of a run folder are: of a run that was killed, in what was growing.

    Raises:
        InputError: there are none, or something that is no file has their name.
    """
    for name in ("trajectory.parquet", ROWS_FILE):
        if holds(folder, name):
            return folder / name
    raise InputError(
        f"there is no trajectory.parquet and no {ROWS_FILE}: this is not a run folder, or "
        "its run ended before a row was written",
        file=str(folder),
    )


def read_run(folder: Path) -> Trajectory:
    """The rows of a run folder; of a run that was killed, those that it had written.

    Raises:
        InputError: there are none, or they cannot be read.
    """
    file = rows_file(folder)
    return read_rows(file) if file.name == ROWS_FILE else Trajectory.read(file)
