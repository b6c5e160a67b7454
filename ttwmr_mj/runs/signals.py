"""Signals that wait until files are whole."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

WAITING = (signal.SIGINT, signal.SIGTERM)
AGAIN_S = 0.02
LONGEST_IMPORT_S = 2.0  # that is waited for; a law's module may never end

_put_off_s: float | None = None  # when the signal came that waits for an import


def interrupt(signum: int, frame: FrameType | None) -> None:
    """A handler that raises KeyboardInterrupt, but in no import: there it comes again afterwards.

    Libraries tell an import that is broken off as an error of theirs, or swallow it.
    """
    global _put_off_s
    now_s = monotonic()
    if _in_import(frame) and now_s - (_put_off_s or now_s) < LONGEST_IMPORT_S:
        _put_off_s = _put_off_s or now_s
        again = threading.Timer(AGAIN_S, signal.pthread_kill, (threading.get_ident(), signum))
        again.daemon = True
        again.start()
        return
    _put_off_s = None
    raise KeyboardInterrupt


def _in_import(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextmanager
def noted() -> Iterator[list[int]]:
    """Which of Ctrl-C and SIGTERM came, for code that swallows the KeyboardInterrupt of both.

    Outside the main thread, which alone gets signals, there are none.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return

    def note(signum: int, frame: FrameType | None) -> None:
        came.append(signum)
        interrupt(signum, frame)

    before = {signum: signal.signal(signum, note) for signum in WAITING}
    try:
        yield came
    finally:
        for signum, handler in before.items():
            signal.signal(signum, signal.SIG_DFL if handler is None else handler)


@contextmanager
def held_back() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait for the end of the context; a second one does not wait.

    Outside the main thread, which alone gets signals, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def note(signum: int, frame: FrameType | None) -> None:
        del frame
        if came:
            raise KeyboardInterrupt
        came.append(signum)

    before = {signum: signal.signal(signum, note) for signum in WAITING}
    try:
        yield
    finally:
        for signum, handler in before.items():
            signal.signal(signum, signal.SIG_DFL if handler is None else handler)
    if came:
        signal.raise_signal(came[0])
