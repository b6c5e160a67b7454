"""One process at a time fills a folder, or a part of it; the lock ends with the process."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ttwmr_mj.errors import InputError

NAME = ".lock"


@contextmanager
def locked(folder: Path, part: str = "") -> Iterator[None]:
    """Hold a folder while the context lasts.

    Where the system has no such locks, two processes do the same work twice, and nothing worse.

    Args:
        folder: that is there.
        part: of it, such as one of several shards.

    Raises:
        InputError: another process holds it; the message says which.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    name = f"{NAME}-{part}" if part else NAME
    with (folder / name).open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.seek(0)
            hint = "wait for it, or give each process its own folder"
            problem = f"another process fills this folder: {file.read().strip()}"
            raise InputError.at("--out", problem, got=str(folder), hint=hint) from error
        except OSError:  # a file system without locks
            yield
            return
        file.truncate(0)
        file.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        file.flush()
        yield
