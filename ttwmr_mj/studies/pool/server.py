"""The server that the processes of jobs are forked from, and how it is started."""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import MachineError, cut
from ttwmr_mj.files import scratch_folder, variable
from ttwmr_mj.studies.pool.preload import ask_for

LONGEST = 70  # bytes of a folder's name: systems take some 100 for a socket's, with 32 of its own
SHORT = (Path("/tmp"), Path("/var/tmp"), Path("/dev/shm"))


def processes(preload: Sequence[str]) -> Any:
    """Processes from a server that has the modules, or, where there is none, from nothing.

    Never a fork of this process: a recording stream that is inherited drops what it is given.

    Raises:
        MachineError: there is no place for the server's socket.
    """
    ask_for(preload)
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["ttwmr_mj.studies.pool.preloaded"])
    with variable("PYTHONSAFEPATH", "1"):  # started by `python -c`, which reads files lying about
        resource_tracker.ensure_running()
        with _deaf_to_ctrl_c(), _short_names():
            forkserver.ensure_running()
    return context


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """What is started meanwhile does not hear Ctrl-C, which a terminal sends to all; we do after.

    The server ignores it by itself, but not before it has imported everything.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _short_names() -> Iterator[None]:
    """Sockets made meanwhile are where their names are short enough for the system.

    Raises:
        MachineError: TMPDIR is too long for that, and nowhere else can be written to.
    """
    usual = scratch_folder()
    length = len(os.fsencode(usual))
    fits = (folder for folder in SHORT if os.access(folder, os.W_OK | os.X_OK))
    place = usual if length <= LONGEST else next(fits, None)
    if place is None:
        raise MachineError(
            f"TMPDIR has {length} letters ({cut(str(usual))}), too many for the socket of a "
            f"server of processes; let it name a folder of at most {LONGEST}"
        )
    before, tempfile.tempdir = tempfile.tempdir, str(place)
    try:
        yield
    finally:
        tempfile.tempdir = before
