"""What no command foresees: a full disk, an unreadable folder, a closed terminal, a bug."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import threading
import time
from collections.abc import Sequence
from types import ModuleType
from typing import Any, TextIO

from ttwmr_mj.errors import (
    InputError,
    MachineError,
    RunError,
    TtwmrError,
    cut,
    described,
    is_of_input,
    of_system,
    printable,
    strangers,
)

INSTALL = "`ttwmr doctor` says what there is; installing this package again brings it back"
FAILED, WRONG = 1, 2  # exit codes; 0: done
LEAST_ADDRESS_SPACE = 6e9  # bytes; by camera 4.6e9 are taken on two cores, most of it never used
LEAST_FILES = 64
# threads that libraries start on a processor, and on all together; a limit of MANY is not tried
THREADS_EACH, THREADS, MANY = 4, 16, 2000


def _tell_nobody(code: int) -> None:
    del code


at_close = _tell_nobody  # who wants to know the exit code before the process is over
kept: dict[str, TextIO] = {}  # "stdout", "stderr" of a process that runs a law of the user's


def give_streams_back() -> None:
    """Let words go to the terminal again, whatever a law has put in the place of the streams."""
    for name, stream in kept.items():
        setattr(sys, name, stream)


def open_streams() -> None:
    """Standard streams that can be written to, whatever the process was started with.

    A closed one would give its number to the next file that is opened, a result for instance, and
    what a library prints would end in it. Letters that a terminal lacks are printed as escapes.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            _discard(number)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115, PTH123
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a test's or a notebook's may not
            stream.reconfigure(errors="backslashreplace")


class _Outlasting(io.FileIO):
    """A file whose reader may leave: what nobody reads goes nowhere, and the work goes on."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            _discard(self.fileno())
            return super().write(data)


def outlast_readers() -> None:
    """Let nothing depend on who reads our output, such as `head`, and when they leave."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper) and stream.fileno() == number:
            setattr(sys, name, outlasting(stream, number))


def outlasting(
    stream: io.TextIOWrapper, file: int, kind: type[io.TextIOWrapper] = io.TextIOWrapper
) -> io.TextIOWrapper:
    """A stream like this one, whose reader may leave.

    Args:
        stream: what letters and lines are like.
        file: the descriptor to write to; never closed.
        kind: of stream.
    """
    return kind(
        io.BufferedWriter(_Outlasting(file, "wb", closefd=False)),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def forget_variables() -> None:
    """Forget variables that libraries obey, or fail on, as they are imported; we never want them.

    SciPy reads the time of a build, PyOpenGL a backend, Rerun how it gathers what is recorded.
    """
    strangers = [name for name in os.environ if name.startswith("RERUN_")]
    for name in ("SOURCE_DATE_EPOCH", "PYOPENGL_PLATFORM", *strangers):
        os.environ.pop(name, None)


def refuse_narrow_limits() -> None:
    """Refuse what a shell's limits leave no room for: libraries end the process there, or hang.

    Raises:
        MachineError: with the limit, and what is needed.
    """
    try:
        import resource
    except ImportError:  # a system without such limits
        return
    address_space = resource.getrlimit(resource.RLIMIT_AS)[0]
    if address_space != resource.RLIM_INFINITY and address_space < LEAST_ADDRESS_SPACE:
        raise MachineError(
            f"the address space is limited to {address_space / 1e9:.2g} GB (ulimit -v), but "
            f"{LEAST_ADDRESS_SPACE / 1e9:g} GB are needed; `ulimit -v unlimited` lifts the limit"
        )
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files != resource.RLIM_INFINITY and files < LEAST_FILES:
        raise MachineError(
            f"no more than {files} files can be open at once (ulimit -n), but {LEAST_FILES} are "
            f"needed; `ulimit -n {LEAST_FILES}` raises the limit"
        )
    processes = resource.getrlimit(resource.RLIMIT_NPROC)[0]
    needed = THREADS + THREADS_EACH * (os.cpu_count() or 1)
    if 0 <= processes < MANY and not _can_start(needed):  # unlimited is negative
        raise MachineError(
            f"no more than {processes} processes and threads of this user can run at once "
            f"(ulimit -u), and there is no room for {needed} more, which are needed; "
            f"`ulimit -u {MANY}` raises the limit"
        )


def refuse_late_clock() -> None:
    """Refuse a clock that Python cannot read: the first library that asks for the time would fail.

    Raises:
        MachineError: with what to do.
    """
    try:
        time.time()
    except OverflowError as error:
        raise MachineError(
            "this machine's clock is beyond the year 2262, where Python cannot tell the time; set "
            "the clock"
        ) from error


def _can_start(count: int) -> bool:
    """Whether so many threads can run at once."""
    end, threads = threading.Event(), []
    try:
        for _ in range(count):
            thread = threading.Thread(target=end.wait, daemon=True)
            thread.start()
            threads.append(thread)
    except RuntimeError:
        return False
    finally:
        end.set()
        for thread in threads:
            thread.join()
    return True


def readable(words: Sequence[str]) -> list[str]:
    """The words of a command line as UTF-8, whatever the locale.

    Raises:
        InputError: one of them is not.
    """
    try:
        return [word if word.isascii() else os.fsencode(word).decode() for word in words]
    except UnicodeError as error:
        bad = getattr(error, "object", "")
        text = bad.decode(errors="backslashreplace") if isinstance(bad, bytes) else ascii(bad)
        raise InputError(f"a word of the command line is not UTF-8: {text}") from error


def close_streams(code: int) -> int:
    """Flush the output; the exit code, which is FAILED where the output could not be written."""
    try:
        if sys.stdout is not None and not sys.stdout.closed:  # a law of the user's may do that
            sys.stdout.flush()
    except OSError as error:
        with contextlib.suppress(OSError, ValueError):  # it has no descriptor any longer
            _discard(sys.stdout.fileno())  # what is left would fail again at the interpreter's end
        say(f"cannot write the output: {error.strerror or error}")
        code = code or FAILED
    # Ctrl-C in code from text, which dataclasses are made of, is remembered by the interpreter: it
    # would end as if killed. With the next such code it forgets
    exec("")
    at_close(code)
    return code


def leave_threads(code: int) -> None:
    """End the process here where threads of somebody else's code would keep it alive.

    Not where another process has heard the code: that one ends those that go on for long, and a
    pool of threads ends with the interpreter, which also writes what its files still hold.
    """
    others = (one for one in threading.enumerate() if one is not threading.main_thread())
    if at_close is _tell_nobody and stranger_in_process() and any(not one.daemon for one in others):
        sys.stderr.flush()
        os._exit(code)


def told(error: BaseException) -> int:
    """Say in one line what ended the command; returns the exit code."""
    text, code = _meaning(error)
    say(text)
    return code


def say(text: str) -> None:
    """Print to stderr as far as that is possible, without what a terminal would obey."""
    give_streams_back()
    with contextlib.suppress(OSError, ValueError):
        print(f"ttwmr: {printable(text)}", file=sys.stderr, flush=True)


def _meaning(error: BaseException) -> tuple[str, int]:
    """What happened, in words, and the exit code."""
    match error:
        case KeyboardInterrupt():
            return "stopped", FAILED
        case RunError():
            return str(error), FAILED
        case TtwmrError():
            return str(error), WRONG
        case OSError():
            if is_of_input(error):
                return of_system(error), WRONG
            return f"{of_system(error)}; files that were complete are kept", FAILED
        case UnicodeEncodeError():
            hint = "set LC_ALL=C.UTF-8"
            return f"this locale cannot name {ascii(error.object)[:80]}; {hint}", WRONG
        case ImportError() if not strangers and not _is_ours(error):
            what = "is missing" if isinstance(error, ModuleNotFoundError) else "cannot be imported"
            name = (error.name or "a library").partition(".")[0]
            text = "" if isinstance(error, ModuleNotFoundError) else f": {cut(str(error), 300)}"
            return f"{name} {what}{text}; {INSTALL}", WRONG
        case AttributeError(obj=ModuleType(__file__=None, __name__=name)) if not strangers:
            return f"{name} cannot be imported: its folder holds no code; {INSTALL}", WRONG
        case RecursionError() if not strangers:  # a law may have lowered the limit
            return "the input is nested too deeply", WRONG
        case MemoryError():
            return "out of memory; files that were complete are kept", FAILED
    words = cut(described(error).splitlines()[0], 300)
    if suspect := stranger_in_process():
        suspect = f"{suspect} ran in this process and may have caused it"
        report = "if it happens without that, too, please report it"
        return f"unexpected {words}; {suspect}; {report}; --debug shows where", FAILED
    return f"unexpected {words}; --debug shows where, please report it", FAILED


def _is_ours(error: ImportError) -> bool:
    """Whether it is a module of this package that is missing."""
    return (error.name or "").partition(".")[0] == __name__.partition(".")[0]


def stranger_in_process() -> str:
    """Whose code has run here, a law of the user's or another package's; empty if nobody's."""
    return strangers[-1] if strangers else ""


def _discard(number: int) -> None:
    """Let a standard stream lead nowhere."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere != number:
        os.dup2(nowhere, number, inheritable=number <= 2)
        os.close(nowhere)
