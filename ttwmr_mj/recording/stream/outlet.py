"""What Rerun streams, written to a file by us.

Rerun's own thread that writes a file dies of a full disk, and whoever then waits for it or closes
the stream may wait for ever. So it writes into a pipe that always takes what comes, and an error of
the file is an OSError of ours.
"""

from __future__ import annotations

import os
import select
import threading
from pathlib import Path

PIECE_BYTES = 1 << 18


class Outlet:
    """A pipe whose bytes end in a file.

    Args:
        path: the file, overwritten.

    Attributes:
        name: of the pipe's end that is written to, for whoever opens it.

    Raises:
        OSError: the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb", buffering=0)
        self._source, self._entry = os.pipe()
        os.set_blocking(self._source, False)
        self.name = f"/dev/fd/{self._entry}"
        self._turn = threading.Lock()
        self._error: OSError | None = None
        self._thread = threading.Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()

    def opened(self) -> None:
        """Whoever writes has opened the pipe: it ends when that one closes it."""
        os.close(self._entry)

    def take(self) -> None:
        """Bring to the file what has been written to the pipe.

        Raises:
            OSError: the file cannot be written.
        """
        self._take()
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Wait for the end of the pipe and close the file.

        Raises:
            OSError: the file could not be written.
        """
        self._thread.join()
        self._file.close()
        os.close(self._source)
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        while True:
            select.select([self._source], [], [])
            if not self._take():
                return

    def _take(self) -> bool:
        """Empty the pipe; whether more may come."""
        with self._turn:  # so that all that was taken is in the file when the turn is over
            while True:
                try:
                    piece = os.read(self._source, PIECE_BYTES)
                except BlockingIOError:
                    return True
                if not piece:
                    return False
                self._write(memoryview(piece))

    def _write(self, piece: memoryview) -> None:
        try:
            while piece and self._error is None:
                piece = piece[self._file.write(piece) :]
        except OSError as error:
            self._error = OSError(error.errno, error.strerror, self._file.name)
