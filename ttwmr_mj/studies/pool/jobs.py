"""Many jobs in processes: each alone with its crash, its hang and its globals.

Every job gets a process of its own, forked from a server that has imported what all of them need.
It has its own session, so that Ctrl-C reaches whoever called `run_jobs`, who then decides.
"""

from __future__ import annotations

import errno
import math
import multiprocessing
import os
import pickle
import signal
import stat
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count, islice
from multiprocessing.connection import wait
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from ttwmr_mj.errors import MachineError, TtwmrError, described, in_one_line, of_system
from ttwmr_mj.files import delete_drafts, scratch_folder
from ttwmr_mj.runs.process import signals
from ttwmr_mj.studies.pool.limits import reason_after
from ttwmr_mj.studies.pool.preload import load
from ttwmr_mj.studies.pool.server import processes

# what the machine or a person ends a process with, out of memory included
FROM_OUTSIDE = (*signals.NAMES, "SIGKILL", "SIGBUS")
NO_ROOM = 75  # exit code where the disk takes no answer; EX_TEMPFAIL of sysexits.h
NO_ROOM_FOR = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
SERVER_GONE = "the server that starts the processes ended"
LOOK_EVERY_S = 1.0  # for the caller, by a process whose law closed what tells of its end
TRIES, TRY_AGAIN_S = 50, 0.1  # to start a process
_leave, _rename = os._exit, os.replace  # which a law may put others in place of


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work."""

    name: str  # for whoever reads the events
    call: Callable[..., Any]  # a function that can be imported by its name
    arguments: tuple[Any, ...] = ()  # of `call`; they and its result can be pickled
    timeout_s: float = math.inf  # wall time after which the job's process is killed
    places: tuple[Path, ...] = ()  # files and folders of its own that it writes


@dataclass(frozen=True, slots=True)
class Done:
    """A job that came to its end, and what it returned."""

    job: Job
    result: Any


@dataclass(frozen=True, slots=True)
class Failed:
    """A job that raised, died or took too long."""

    job: Job  # which
    reason: str  # in words, a line unless it was raised on purpose
    error: TtwmrError | None = None  # what it raised, if that was raised on purpose
    of_machine: bool = False  # killed from outside, no memory, no disk, no OpenGL: no fault of it
    late: bool = False  # it took too long


Event = Done | Failed


def run_jobs(
    jobs: Iterable[Job], *, workers: int | None = None, preload: Sequence[str] = ()
) -> Generator[Event, None, None]:
    """Do jobs, several at a time, and report each as it ends.

    A job is taken from `jobs` only when a process is free for it. Closing the iterator (use
    `contextlib.closing`), or an exception such as Ctrl-C inside it, kills what is under way.

    Args:
        jobs: in the order in which they are started.
        workers: processes at a time; None: one per processor.
        preload: modules that are imported once for all jobs of this process, at its first call.

    Yields:
        One event per job, in the order in which they end.
    """
    scratch = scratch_folder()
    context = processes(preload)
    at_a_time = workers or os.cpu_count() or 1
    waiting, running = iter(jobs), list[_Process]()
    with tempfile.TemporaryDirectory(prefix="ttwmr-jobs-", dir=scratch) as folder:
        logs = (Path(folder) / str(i) for i in count())
        try:
            while True:
                for job in islice(waiting, at_a_time - len(running)):
                    with signals.held_back():  # a start broken off is a traceback of the server
                        running.append(_Process(context, job, next(logs)))
                if not running:
                    return
                _wait(running)
                for process in [process for process in running if process.is_over()]:
                    event = process.event()
                    running.remove(process)
                    yield event
        finally:
            for process in running:
                process.end()


def _wait(running: list[_Process]) -> None:
    """Until one of the processes answers, ends, or has had its time."""
    left_s = max(min(process.ends_at for process in running) - monotonic(), 0.0)
    wait([process.sentinel for process in running], None if math.isinf(left_s) else left_s)


class _Process:
    """A job under way, in a process that leaves its answer in a file.

    A pipe would be open in that process, where a law could close it or write into it.

    Attributes:
        ends_at: when its time is over, on the monotonic clock.
    """

    def __init__(self, context: Any, job: Job, log: Path) -> None:
        self._job, self._log, self._answer = job, log, log.with_suffix(".answer")
        self._process = _started(context, (job, self._answer, log))
        self.sentinel = self._process.sentinel
        self.ends_at = monotonic() + job.timeout_s

    def is_over(self) -> bool:
        """Whether there is an event."""
        return self._has_ended() or monotonic() >= self.ends_at

    def _has_ended(self) -> bool:
        return bool(wait([self.sentinel], 0.0))

    def event(self) -> Event:
        """What became of the job; its process is gone afterwards."""
        timed_out = not self._has_ended()
        server_gone = not timed_out and _is_at_end(self.sentinel)
        code = self.end()
        answer = self._answered()
        if answer is None and timed_out:
            answer = Failed(self._job, reason_after(self._job.timeout_s), late=True)
        elif answer is None and server_gone:
            answer = Failed(self._job, SERVER_GONE, of_machine=True)
        elif answer is None and code == NO_ROOM:
            problem = "the folder for temporary files (TMPDIR) is full, or ulimit -f too small"
            answer = Failed(self._job, problem, of_machine=True)
        elif answer is None:
            how = _exit_name(code)
            answer = Failed(self._job, self._death(how), of_machine=how in FROM_OUTSIDE)
        self._log.unlink(missing_ok=True)
        return answer

    def end(self) -> int:
        """Kill the process, unless it has ended, and what it started; its exit code."""
        try:
            os.killpg(self._process.pid, signal.SIGKILL)  # its children outlive it
        except (AttributeError, OSError):  # no such thing here, nobody, or no group of its own yet
            if not self._has_ended():
                self._process.kill()
        self._process.join()
        code = int(self._process.exitcode)
        self._process.close()
        if code:
            delete_drafts(self._job.places)
        return code

    def _answered(self) -> Event | None:
        """What the process left; None: nothing, or nothing that can be read."""
        try:
            answer = pickle.loads(self._answer.read_bytes())
        except FileNotFoundError:
            return None
        except Exception as error:
            return Failed(self._job, f"its answer was damaged: {in_one_line(described(error))}")
        finally:
            self._answer.unlink(missing_ok=True)
        return answer if isinstance(answer, Done | Failed) else None

    def _death(self, how: str) -> str:
        """How a process ended that did not answer, and its last words."""
        words = _end_of(self._log).strip() if self._log.is_file() else ""
        return f"the process ended with {how}" + (f": {words.splitlines()[-1]}" if words else "")


def _started(context: Any, arguments: tuple[Job, Path, Path]) -> Any:
    """A process; where the server has just been ended, from a new one."""
    for _ in range(TRIES):
        process = context.Process(target=_work, args=arguments)
        try:
            process.start()
        except (ConnectionError, EOFError):
            sleep(TRY_AGAIN_S)
        else:
            return process
    raise MachineError("the server that starts the processes keeps ending")


def _is_at_end(pipe: int) -> bool:
    """Whether a pipe that can be read holds nothing more: nobody told how a process ended."""
    if sys.platform == "win32":
        return False
    import fcntl
    import termios

    count = bytearray(4)
    fcntl.ioctl(pipe, termios.FIONREAD, count)
    return not int.from_bytes(count, sys.byteorder)


def _end_of(log: Path) -> str:
    """The last lines, of megabytes perhaps."""
    with log.open("rb") as file:
        file.seek(max(file.seek(0, os.SEEK_END) - 10_000, 0))
        return file.read().decode(errors="replace")


def _exit_name(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name


def _leave_with_the_caller() -> None:
    """Nobody would hear the answer of a process whose caller was killed."""
    caller = multiprocessing.parent_process()
    if caller is None or caller.pid is None:
        return
    caller.join()
    while _is_there(caller.pid):  # a law closed what tells of its end
        sleep(LOOK_EVERY_S)
    _leave(1)


def _is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _keep_out_of_reach() -> None:
    """Lead nowhere what a law could write into: pipes to the server and to its helpers."""
    if not Path("/proc/self/fd").is_dir():
        return
    import fcntl

    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (int(path.name) for path in Path("/proc/self/fd").iterdir()):
        with suppress(OSError):  # of the folder itself, closed by now
            mode = fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE
            if number > 2 and mode == os.O_WRONLY and stat.S_ISFIFO(os.fstat(number).st_mode):
                os.dup2(nowhere, number, inheritable=False)
    os.close(nowhere)


def _work(job: Job, answer: Path, log: Path) -> None:
    """In the process: do the job, answer with what came of it."""
    if hasattr(os, "setsid"):
        os.setsid()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # of the server
    _keep_out_of_reach()
    threading.Thread(target=_leave_with_the_caller, daemon=True).start()
    try:
        file = log.open("wb")
    except OSError:  # the caller has left, and its folder with it
        _leave(1)
    with file:  # what a law prints is not for the terminal
        for stream, usual in ((sys.__stdout__, 1), (sys.__stderr__, 2)):
            os.dup2(file.fileno(), stream.fileno() if stream else usual)
    said = _done(job)
    try:
        content = pickle.dumps(said)
    except Exception as error:
        content = pickle.dumps(Failed(job, _unforeseen(error)))
    draft = answer.with_suffix(".part")
    try:
        with draft.open("wb") as file:
            file.write(content)
        _rename(draft, answer)
    except OSError as error:
        _leave(NO_ROOM if error.errno in NO_ROOM_FOR else 1)
    _leave(0)  # threads of a law may not end


def _done(job: Job) -> Event:
    ready = False
    try:
        load()
        ready = True
        return Done(job, job.call(*job.arguments))
    except TtwmrError as error:
        return Failed(job, str(error), error, of_machine=isinstance(error, MachineError))
    except KeyboardInterrupt:
        reason = "stopped by Ctrl-C, or its law raised KeyboardInterrupt"
        return Failed(job, reason, of_machine=True)
    except BaseException as error:
        of_machine = not ready or isinstance(error, (OSError, MemoryError))
        return Failed(job, _unforeseen(error), of_machine=of_machine)


def _unforeseen(error: BaseException) -> str:
    """What nobody raised on purpose, and where, in one line."""
    if isinstance(error, OSError) and (error.errno or error.filename is not None):
        return of_system(error)
    where = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(where[-1].filename).name}:{where[-1].lineno})" if where else ""
    return f"{in_one_line(described(error))}{place}"
