"""A recording that is shown while it is written.

What is appended to the .rrd file is copied to a viewer in a process of its own. The file is the
buffer: a viewer that is slow, paused, closed or dead costs the run neither time nor memory, and
one that comes back to life catches up.
"""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO, Self

from ttwmr_mj.files import scratch_folder
from ttwmr_mj.recording.stream.viewer import Viewer

POLL_S = 0.05  # between two looks at the file's end
PIECE_BYTES = 1 << 18
PR_SET_PDEATHSIG = 1  # of prctl(2)
DRAIN_S = 5.0  # at the end of a run, for a viewer to take what is left


class LiveView:
    """One viewer that follows one recording; a context manager.

    Leaving the context ends a viewer that only served this run. A native viewer stays open.

    Args:
        viewer: which; it is started here, and nobody waits until it is up.
    """

    def __init__(self, viewer: Viewer) -> None:
        self.viewer = viewer
        self._ended = threading.Event()
        self._copying: threading.Thread | None = None
        # what the viewer says
        self._words: IO[bytes] = tempfile.TemporaryFile(dir=scratch_folder())  # noqa: SIM115
        self._process = subprocess.Popen(
            [*viewer.command, "-"],
            stdin=subprocess.PIPE,
            stdout=self._words,
            stderr=self._words,
            bufsize=0,
            start_new_session=True,  # Ctrl-C ends the run, and the run ends its viewer
            preexec_fn=None if viewer.stays else _ending_with_parent(),
        )

    def follow(self, recording: Path) -> None:
        """Show this file, which exists, and all that is appended to it until `finish`."""
        self._copying = threading.Thread(target=self._copy, args=(recording,), daemon=True)
        self._copying.start()

    def finish(self) -> None:
        """The file is complete: let the viewer take what is left, for a few seconds."""
        self._ended.set()
        if self._copying is not None:
            self._copying.join(DRAIN_S)

    @property
    def alive(self) -> bool:
        """Whether the viewer still runs."""
        return self._process.poll() is None

    @property
    def fault(self) -> str:
        """Why it has not shown all, in the viewer's own last words if it has any; else empty."""
        if self.alive and self._ended.is_set() and self._copying and self._copying.is_alive():
            return f"it took no more for {DRAIN_S:g} s"
        if not self._process.poll():
            return ""
        self._words.seek(0)
        lines = self._words.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {self._process.returncode}"

    def wait(self, longest_s: float | None = None) -> None:
        """Wait until the viewer ends; Ctrl-C raises KeyboardInterrupt here as anywhere."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(longest_s)

    def close(self) -> None:
        """End the viewer, unless it is a window that the user may want to look at."""
        self._ended.set()
        if not self.viewer.stays:
            if self.viewer.page:  # what feeds a viewer ends with its input
                self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(DRAIN_S)
            self._process.kill()
        self._words.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _copy(self, recording: Path) -> None:
        """In a thread: the file's bytes to the viewer, until both have ended."""
        pipe = self._process.stdin
        assert pipe is not None
        with recording.open("rb", buffering=0) as source, suppress(OSError):  # it may be gone
            complete = False
            while not complete:
                complete = self._ended.is_set()  # asked first, so that the end is read after it
                piece = memoryview(source.read(PIECE_BYTES))
                while piece:
                    piece = piece[pipe.write(piece) :]
                    piece = piece or memoryview(source.read(PIECE_BYTES))
                time.sleep(0.0 if complete else POLL_S)
            pipe.close()


def _ending_with_parent() -> Callable[[], None] | None:
    """Linux: for a new process, to be ended when this one is killed; elsewhere nothing."""
    if sys.platform != "linux":
        return None
    prctl = ctypes.CDLL(None).prctl
    return partial(prctl, PR_SET_PDEATHSIG, signal.SIGTERM)
