"""One at a time fills a folder, or a part of it; the lock ends with its process."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from ttwmr_mj.errors import InputError, refused

NAME = ".lock"
FORBIDDEN = frozenset({errno.EACCES, errno.EPERM, errno.EROFS})


@contextmanager
def locked(folder: Path, part: str = "", key: str = "--out") -> Iterator[None]:
    """Hold a folder while the context lasts; all of it while no part is held, and the reverse.

    Where the system has no such locks, two processes do the same work twice, and nothing worse.

    Args:
        folder: that is there.
        part: of it, such as one of several shards.
        key: what named the folder, for the error.

    Raises:
        InputError: another process or thread holds it, and the message says which; or nobody here
            may write in it.
    """
    path = folder / (f"{NAME}-{part}" if part else NAME)
    for other in folder.glob(NAME if part else f"{NAME}-*"):
        if (free := _taken(other, key)) is not None:  # left by a process that was killed
            with free, suppress(OSError):
                other.unlink()
    file = _taken(path, key)
    if file is None:
        yield
        return
    with file:
        try:
            with suppress(OSError):  # a full disk holds the lock all the same
                file.truncate(0)
                file.write(f"{_this_process()}\n".encode())
            yield
        finally:
            with suppress(OSError):
                path.unlink()  # while it is held: see `_is_at`


def _this_process() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"


def _taken(path: Path, key: str) -> IO[bytes] | None:
    """The lock's file, open and locked; None where there are no locks."""
    try:
        import fcntl
    except ImportError:
        return None
    while True:
        file = _opened(path, key)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            with file:
                file.seek(0)
                holder = file.read().decode(errors="replace").strip()
            other = f"another process fills this folder: {holder}"
            here = "this process fills this folder already"
            problem = here if holder == _this_process() else other
            hint = "wait for it, or give each its own folder"
            raise InputError.at(key, problem, got=str(path.parent), hint=hint) from error
        except OSError:  # a file system without locks
            file.close()
            return None
        if _is_at(path, file):
            return file
        file.close()


def _opened(path: Path, key: str) -> IO[bytes]:
    try:
        return path.open("a+b", buffering=0)
    except OSError as error:
        if error.errno not in FORBIDDEN:
            raise
        raise InputError.at(
            key,
            f"cannot be written in, so that it cannot be locked ({path.name}: {refused(error)})",
            got=str(path.parent),
            allowed="a folder that you may write in",
            hint="change its permissions, or use a folder of your own",
        ) from error


def _is_at(path: Path, file: IO[bytes]) -> bool:
    """Whether an open file is the one of this name; its holder may have deleted it meanwhile."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False
