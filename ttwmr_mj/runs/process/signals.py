"""Signals that wait until files are whole."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType
from typing import Any

# Ctrl-C and Ctrl-\, a polite end, a terminal that is closed, all the processor time that was
# allowed, and what schedulers of clusters send before they end a job
NAMES = ("SIGINT", "SIGQUIT", "SIGTERM", "SIGHUP", "SIGXCPU", "SIGUSR1", "SIGUSR2")
WAITING = tuple(signal.Signals[name] for name in NAMES if hasattr(signal, name))
Handler = Callable[[int, FrameType | None], Any]
AGAIN_S = 0.02
LONGEST_IMPORT_S = 2.0  # that is waited for; a law's module may never end

_put_off_s: float | None = None  # when the signal came that waits for an import


def interrupt(signum: int, frame: FrameType | None) -> None:
    """A handler that raises KeyboardInterrupt, but in no import: there it comes again afterwards.

    Libraries tell an import that is broken off as an error of theirs, or swallow it.
    """
    global _put_off_s
    _lift_limit_of(signum)
    now_s = monotonic()
    if _in_import(frame) and now_s - (_put_off_s or now_s) < LONGEST_IMPORT_S:
        _put_off_s = _put_off_s or now_s
        again = threading.Timer(AGAIN_S, signal.pthread_kill, (threading.get_ident(), signum))
        again.daemon = True
        again.start()
        return
    _put_off_s = None
    raise KeyboardInterrupt


def _lift_limit_of(signum: int) -> None:
    """No second SIGXCPU: every second of processor time would bring one."""
    if signum != getattr(signal, "SIGXCPU", None):
        return
    import resource

    hard_s = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (hard_s, hard_s))


def handled_by(handler: Handler) -> dict[int, Any]:
    """Let a function handle the signals of `WAITING`, but for those that are ignored.

    A shell lets what runs in its background ignore Ctrl-C, and nohup a closed terminal.

    Returns:
        What handled them before, for `give_back`.
    """
    heard = [n for n in WAITING if signal.getsignal(n) is not signal.SIG_IGN]
    return {signum: signal.signal(signum, handler) for signum in heard}


def give_back(before: dict[int, Any]) -> None:
    """Let signals be handled as they were."""
    for signum, handler in before.items():
        signal.signal(signum, signal.SIG_DFL if handler is None else handler)


def _in_import(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextmanager
def noted() -> Iterator[list[int]]:
    """Which signals of `WAITING` came, for code that swallows their KeyboardInterrupt.

    Outside the main thread, which alone gets signals, there are none.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return

    def note(signum: int, frame: FrameType | None) -> None:
        came.append(signum)
        interrupt(signum, frame)

    before = handled_by(note)
    try:
        yield came
    finally:
        give_back(before)


@contextmanager
def held_back() -> Iterator[None]:
    """Let the signals of `WAITING` wait for the end of the context; a second one does not wait.

    Outside the main thread, which alone gets signals, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def note(signum: int, frame: FrameType | None) -> None:
        del frame
        _lift_limit_of(signum)
        if came:
            raise KeyboardInterrupt
        came.append(signum)

    before = handled_by(note)
    try:
        yield
    finally:
        give_back(before)
    if came:
        signal.raise_signal(came[0])
