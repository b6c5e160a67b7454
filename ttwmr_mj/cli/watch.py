"""What a process knows of its child that runs a law of the user's, and when it ends it.

A law's code runs outside calls that have a limit, too: as an object of its is deleted, in a hook of
the interpreter's, or in place of a function of ours. So the child shows that it gets further.
"""

from __future__ import annotations

import os
import select
import signal
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import get_ident
from time import monotonic
from typing import Any

from ttwmr_mj.cli.last_resort import FAILED, say
from ttwmr_mj.errors import described

LOOK_EVERY_S = 0.25
GRACE_S = 5.0  # beyond its limit, for the law's own process to break it off and say so
LEAVE_S = 3.0  # a child that has told its exit code is given this long to end
IDLE_S = 90.0  # without a call of the law, a step of a file, a thread that computes
WORKS = 10  # looks without work that one look at work makes up for
STOP_S = 30.0  # after a signal, without a step of a file
SIGNALS = 3  # signals; the last one is not passed on
WORKING = "RDt"  # states of threads: runs or would like to, waits for a disk, is looked into
TICKS_S = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


@dataclass(slots=True)
class Watch:
    """What the parent knows of its child.

    Attributes:
        child: its process.
        answers: where it tells its exit code.
        board: what it shows, as `deadline` has it.
        result: the JSON file that is there when it ends well; None: it leaves none.
    """

    child: int
    answers: int
    board: Any
    result: Path | None = None
    _call: float = -1.0
    _began_cpu_s: float = 0.0
    # looks, and no times: while this process is stopped, none goes by
    _waited: int = 0
    _idle: int = 0
    _since_signal: int = 0
    _call_seen: float = 0.0
    _step: float = 0.0
    _signals: list[int] = field(default_factory=list)
    _given_up: str = ""

    def code(self) -> int:
        """Wait for the child's end; the exit code that it has told, else FAILED with a reason."""
        from ttwmr_mj.runs.process.signals import give_back, handled_by

        before, on_pause = handled_by(self._pass_on), signal.signal(signal.SIGTSTP, self._pause)
        try:
            told = self._wait()
            ended = self._end(LEAVE_S if told else 0.0)
        finally:
            give_back(before)
            signal.signal(signal.SIGTSTP, on_pause)
        if told:
            return told[0] or self._looked_at()
        reason = self._given_up or (
            f"the process of the run ended {_how(ended)} before it was over: its law ended it, "
            "or the machine did"
        )
        say(f"{reason}{self._kept()}")
        return FAILED

    def _wait(self) -> bytes:
        """What the child tells; empty: it ended without a word, or is given up."""
        while True:
            if select.select([self.answers], [], [], LOOK_EVERY_S)[0]:
                return os.read(self.answers, 1)
            if os.waitid(os.P_PID, self.child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                ready = select.select([self.answers], [], [], 0.0)[0]
                return os.read(self.answers, 1) if ready else b""
            if self.board[2] != self._step:
                self._step, self._idle, self._since_signal = self.board[2], 0, 0
            self._given_up = self._late() or self._idle_too_long() or self._deaf()
            if self._given_up:
                return b""

    def _late(self) -> str:
        """A call into the law takes longer than it may, in words; empty: none does."""
        from ttwmr_mj.deadline import PATIENCE

        limit_s, call = self.board[0], self.board[1]
        if not limit_s or call != self._call:
            self._call, self._waited, self._began_cpu_s = call, 0, _cpu_s(self.child)
            return ""
        self._waited += 1
        waited_s, computed = self._waited * LOOK_EVERY_S, _cpu_s(self.child) - self._began_cpu_s
        if waited_s <= PATIENCE * limit_s + GRACE_S and computed <= limit_s + GRACE_S:
            return ""
        return (
            f"the law did not answer within {limit_s:g} s and could not be broken off, so that its "
            "process was ended (limits: control.controller_time_limit_s, "
            "control.controller_start_limit_s)"
        )

    def _idle_too_long(self) -> str:
        """Nothing goes on outside calls into the law, in words; empty: something does."""
        if self.board[0] or self.board[1] != self._call_seen:
            self._call_seen, self._idle = self.board[1], 0
        elif _works(self.child) or not _is_heard():
            self._idle = max(self._idle - WORKS, 0)
        else:
            self._idle += 1
        if self._idle * LOOK_EVERY_S <= IDLE_S:
            return ""
        return (
            f"nothing went on for {IDLE_S:g} s, so that the process of the run was ended: code of "
            "its law, such as __del__ or a hook of the interpreter, does not come to its end"
        )

    def _deaf(self) -> str:
        """A signal should have ended the child and did not, in words; empty: it may still do so."""
        if not self._signals:
            return ""
        if len(self._signals) >= SIGNALS:
            return "stopped at the third signal, before the run could end by itself"
        self._since_signal += 1
        if self._since_signal * LOOK_EVERY_S <= STOP_S:
            return ""
        name = signal.Signals(self._signals[0]).name
        return f"the process of the run did not end within {STOP_S:g} s of {name} and was ended"

    def _looked_at(self) -> int:
        """The exit code of a child that ended well, by what it left."""
        from ttwmr_mj.files import read_json

        if self.result is None:
            return 0
        try:
            read_json(self.result)
        except (OSError, ValueError) as error:
            say(
                f"the command came to its end, but {self.result} cannot be read "
                f"({described(error)}): its law may have changed what writes files"
            )
            return FAILED
        return 0

    def _kept(self) -> str:
        """What there is of the run, in words, without what was half written."""
        if self.result is None:
            return ""
        from ttwmr_mj.runs.files.new_folder import kept, settle_the_dead

        folder, told = self.result.parent, kept(self.result.parent)
        settle_the_dead(folder)
        return f"; {told}"

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

    def _pause(self, signum: int, frame: object) -> None:
        """Stop with the child, as Ctrl-Z asks, and go on with it: it has a group of its own."""
        del signum, frame
        with suppress(OSError):  # it has ended
            os.killpg(self.child, signal.SIGSTOP)
        signal.pthread_kill(get_ident(), signal.SIGSTOP)  # `fg` goes on here
        with suppress(OSError):
            os.killpg(self.child, signal.SIGCONT)

    def _pass_on(self, signum: int, frame: object) -> None:
        del frame
        self._signals.append(signum)
        if len(self._signals) < SIGNALS:
            with suppress(ProcessLookupError):
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


def _works(process: int) -> bool:
    """Whether a thread of it computes or waits for a disk; true where the system does not tell."""
    try:
        stats = [
            file.read_text(encoding="utf-8")
            for file in Path(f"/proc/{process}/task").glob("*/stat")
        ]
    except OSError:  # one that has just ended
        return True
    return not stats or any(stat.rpartition(")")[2].split()[0] in WORKING for stat in stats)


def _is_heard() -> bool:
    """Whether those who read our output take it: a terminal may be halted, a pager be full."""
    return len(select.select([], [1, 2], [], 0.0)[1]) == 2
