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
import select
import signal
import sys
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from ttwmr_mj.cli import last_resort
from ttwmr_mj.cli.last_resort import FAILED, say

if TYPE_CHECKING:
    from ttwmr_mj.scenario.schema import Scenario

LOOK_EVERY_S = 0.25
GRACE_S = 5.0  # beyond its limit, for the law's own process to break it off and say so
LEAVE_S = 3.0  # a child that has told its exit code is given this long to end
PR_SET_PDEATHSIG = 1  # of prctl(2)
TICKS_S = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100

FAR = 500  # a descriptor beyond those that a law would close; below the usual limit of 1024

own_process = False  # whether this process is the command's, and not a script's or a test's
debug = False  # whether tracebacks are wanted


class Over(BaseException):
    """The child that went on in this process's place is over.

    Attributes:
        code: its exit code.
    """

    def __init__(self, code: int) -> None:
        self.code = code


def supervise(scenario: Scenario) -> None:
    """Go on in a child of this process, where the scenario has code of the user's.

    That is a law of theirs, or a law or reference that another package adds.

    Raises:
        Over: in this process, once the child is over.
    """
    if not own_process or not hasattr(os, "fork"):
        return
    from ttwmr_mj import deadline
    from ttwmr_mj.registry import is_foreign

    foreign = any(is_foreign(type(part)) for part in (scenario.controller, scenario.reference))
    if not foreign and scenario.controller.kind != "custom":
        return

    sys.stdout.flush()
    sys.stderr.flush()
    board = mmap.mmap(-1, mmap.PAGESIZE)  # shared with the child
    told, telling = os.pipe()
    parent, child = os.getpid(), os.fork()
    if child == 0:
        os.close(told)
        _become_the_child(parent, telling)
        _keep_streams()
        deadline.show_on(memoryview(board).cast("d"))
        return
    os.close(telling)
    with open(told, "rb", buffering=0) as answers:  # noqa: PTH123  # a pipe
        raise Over(_Watch(child, answers.fileno(), memoryview(board).cast("d")).code())


def _become_the_child(parent: int, telling: int) -> None:
    """A group of its own, to be ended as one, and with its parent; its exit code goes there."""
    telling = _far(telling)
    os.setpgid(0, 0)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(FAILED)
    process = os.getpid()

    def report(code: int) -> None:
        if os.getpid() == process:  # and no child of a law
            os.write(telling, bytes([code]))

    last_resort.at_close = report
    if not debug:  # what even the last resort stumbles over, the parent has words for
        sys.excepthook = lambda *_: os._exit(FAILED)


def _far(file: int) -> int:
    """A second descriptor of a file, where a law that closes what it did not open does not look."""
    import fcntl
    import resource

    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return fcntl.fcntl(file, fcntl.F_DUPFD_CLOEXEC, min(FAR, most // 2))


class _Lasting(io.TextIOWrapper):
    """A stream that a law cannot close."""

    def close(self) -> None:
        self.flush()


def _keep_streams() -> None:
    """Let words reach the terminal though a law closes its streams, or files 1 and 2."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        # never closed, and not to be warned of where a law asks for all warnings
        raw = io.FileIO(_far(stream.fileno()), "wb", closefd=False)
        lasting = _Lasting(
            io.BufferedWriter(raw),
            encoding=stream.encoding,
            errors=stream.errors,
            line_buffering=stream.line_buffering,
        )
        last_resort.kept[name] = lasting
    last_resort.give_streams_back()


@dataclass(slots=True)
class _Watch:
    """What the parent knows of its child.

    Attributes:
        child: its process.
        answers: where it tells its exit code.
        board: what its deadline shows: the limit of a call under way or 0, the number of calls.
    """

    child: int
    answers: int
    board: Any
    _call: float = -1.0
    _began_s: float = field(default_factory=monotonic)
    _began_cpu_s: float = 0.0

    def code(self) -> int:
        """Wait for the child's end; the exit code that it has told, else FAILED with a reason."""
        from ttwmr_mj.runs.process.signals import give_back, handled_by

        before = handled_by(self._pass_on)
        try:
            told = self._wait()
            ended = self._end(LEAVE_S if told else 0.0)
        finally:
            give_back(before)
        if told:
            return told[0]
        if told is None:
            say(
                f"the law did not answer within {self.board[0]:g} s and could not be broken off, "
                "so that its process was ended; `ttwmr score` sums up what was recorded (limits: "
                "control.controller_time_limit_s, control.controller_start_limit_s)"
            )
        else:
            say(
                f"the process of the run ended {_how(ended)} before it was over: its law ended it, "
                "or the machine did; `ttwmr score` sums up what was recorded"
            )
        return FAILED

    def _wait(self) -> bytes | None:
        """What the child tells; empty: it ended without a word; None: it answers no more."""
        while True:
            if select.select([self.answers], [], [], LOOK_EVERY_S)[0]:
                return os.read(self.answers, 1)
            if os.waitid(os.P_PID, self.child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                ready = select.select([self.answers], [], [], 0.0)[0]
                return os.read(self.answers, 1) if ready else b""
            if self._is_late():
                return None

    def _is_late(self) -> bool:
        """Whether a call into the law takes longer than it may."""
        from ttwmr_mj.deadline import PATIENCE

        limit_s, call = self.board[0], self.board[1]
        if not limit_s or call != self._call:
            self._call, self._began_s, self._began_cpu_s = call, monotonic(), _cpu_s(self.child)
            return False
        waited, computed = monotonic() - self._began_s, _cpu_s(self.child) - self._began_cpu_s
        return bool(waited > PATIENCE * limit_s + GRACE_S or computed > limit_s + GRACE_S)

    def _end(self, leave_s: float) -> int:
        """See to it that the child and its group are over; its wait status."""
        until = monotonic() + leave_s
        while monotonic() < until:
            if os.waitid(os.P_PID, self.child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                break
            select.select([], [], [], 0.02)
        over = os.waitid(os.P_PID, self.child, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        try:
            os.killpg(self.child, signal.SIGKILL)
        except OSError:  # there is nobody
            if not over:
                os.kill(self.child, signal.SIGKILL)
        return os.waitpid(self.child, 0)[1]

    def _pass_on(self, signum: int, frame: object) -> None:
        del frame
        os.kill(self.child, signum)
        os.kill(self.child, signal.SIGCONT)  # a law may have stopped it


def _how(status: int) -> str:
    if os.WIFSIGNALED(status):
        return f"by {signal.Signals(os.WTERMSIG(status)).name}"
    return f"with exit code {os.WEXITSTATUS(status)}"


def _cpu_s(process: int) -> float:
    """CPU time of its main thread; 0 where the system does not tell."""
    try:
        told = Path(f"/proc/{process}/task/{process}/stat").read_text(encoding="utf-8")
    except OSError:
        return 0.0
    user, system = told.rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / TICKS_S
