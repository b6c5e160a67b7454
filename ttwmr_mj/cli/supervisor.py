"""A process that watches the one that runs a law of the user's, and has the last word.

A law shares its process with the loop: it may leave with exit code 0, never answer and swallow what
should break it off, or have threads and children that do not end. So the command goes on in a child
of this process. It is ended when it answers no more, and only what it said at its own end counts.
"""

from __future__ import annotations

import ctypes
import io
import mmap
import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.cli import last_resort
from ttwmr_mj.cli.last_resort import FAILED
from ttwmr_mj.cli.watch import Watch
from ttwmr_mj.runs.process import signals

if TYPE_CHECKING:
    from ttwmr_mj.scenario.schema import Scenario

PR_SET_PDEATHSIG = 1  # of prctl(2)

FAR = 500  # a descriptor beyond those that a law would close; below the usual limit of 1024

own_process = False  # whether this process is the command's, and not a script's or a test's
debug = False  # whether tracebacks are wanted
_watched = False  # whether this process is the child


class Over(BaseException):
    """The child that went on in this process's place is over.

    Attributes:
        code: its exit code.
    """

    def __init__(self, code: int) -> None:
        self.code = code


def supervise(scenario: Scenario, result: Path | None = None) -> None:
    """Go on in a child of this process, where the scenario has code of the user's.

    That is a law of theirs, or a law or reference that another package adds.

    Args:
        scenario: what the child goes on with.
        result: the JSON file in the folder of results that a child leaves that ends well, if any.

    Raises:
        Over: in this process, once the child is over.
    """
    global _watched
    if not own_process or _watched or not hasattr(os, "fork"):
        return
    from ttwmr_mj import deadline
    from ttwmr_mj.registry import is_foreign
    from ttwmr_mj.runs import build

    if not scenario.controller.of_others and not is_foreign(type(scenario.reference)):
        return

    sys.stdout.flush()
    sys.stderr.flush()
    board = mmap.mmap(-1, mmap.PAGESIZE)  # shared with the child
    told, telling = os.pipe()
    parent, child = os.getpid(), signals.fork()
    if child == 0:
        os.close(told)
        _keep_streams()
        _take_the_keyboard()
        _become_the_child(parent, telling)
        deadline.show_on(memoryview(board).cast("d"))
        build.keep_laws()
        _watched = True
        return
    os.close(telling)
    with open(told, "rb", buffering=0) as answers:  # noqa: PTH123  # a pipe
        watch = Watch(child, answers.fileno(), memoryview(board).cast("d"), result)
        raise Over(watch.code())


def _become_the_child(parent: int, telling: int) -> None:
    """A group of its own, to be ended as one, and with its parent; its exit code goes there."""
    telling = _far(telling)
    os.setpgid(0, 0)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # `stty tostop` stops who prints in such a group
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(FAILED)
    process = os.getpid()

    nowhere = _far(os.open(os.devnull, os.O_WRONLY))
    streams = 2, last_resort.kept["stderr"].fileno()
    getpid, write, dup2 = os.getpid, os.write, os.dup2  # a law may put others in their place

    def report(code: int) -> None:
        if getpid() != process:  # a child of a law
            return
        if not debug:  # what the interpreter complains of as it ends, after what a law did to it
            for stream in streams:
                dup2(nowhere, stream)
        write(telling, bytes([code]))

    last_resort.at_close = report
    if not debug:  # what even the last resort stumbles over, the parent has words for
        sys.excepthook = lambda *_: os._exit(FAILED)


def _far(file: int) -> int:
    """A second descriptor of a file, where a law that closes what it did not open does not look."""
    import fcntl
    import resource

    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return fcntl.fcntl(file, fcntl.F_DUPFD_CLOEXEC, min(FAR, most // 2))


class _NoKeyboard(io.TextIOBase):
    """The standard input of the child, where a terminal would stop who reads from it."""

    def isatty(self) -> bool:
        return True

    def readable(self) -> bool:
        return True

    def read(self, size: int | None = -1) -> str:
        del size
        raise io.UnsupportedOperation(
            "a law that a command runs has no keyboard; in a script, tt.simulate lets it read, and "
            "breakpoint() stop there"
        )

    def readline(self, size: int = -1) -> str:  # type: ignore[override]
        return self.read(size)


def _take_the_keyboard() -> None:
    """Refuse words from a terminal at once; pipes and files are read as ever."""
    if sys.stdin.isatty():
        signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # a read of the descriptor fails then
        sys.stdin = _NoKeyboard()


class _Lasting(io.TextIOWrapper):
    """A stream that a law cannot close."""

    def close(self) -> None:
        self.flush()


def _keep_streams() -> None:
    """Let words reach the terminal though a law closes its streams, or files 1 and 2."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        last_resort.kept[name] = last_resort.outlasting(stream, _far(stream.fileno()), _Lasting)
    last_resort.give_streams_back()
