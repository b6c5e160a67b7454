"""Signals that wait until files are whole."""

from __future__ import annotations

import os
import signal
import sys
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
LONGEST_WAIT_S = 15.0  # for the end of an import; a law's module may never end
# libraries tell an import that is broken off as an error of theirs, and pydantic drops what is
# raised as it asks for an instance of an abstract class
UNBROKEN = ("<frozen importlib", "<frozen abc")

_put_off_s: float | None = None  # when the signal came that waits
_taken: list[tuple[Handler, dict[int, Any]]] = []  # handlers of ours, with what was there before
_child_is_ours = False


class _Interrupted(KeyboardInterrupt):
    signum = 0


def interrupt(signum: int, frame: FrameType | None) -> None:
    """A handler that raises KeyboardInterrupt, but not where others would drop or rename it.

    There the signal comes again until it is over.
    """
    global _put_off_s
    _lift_limit_of(signum)
    now_s = monotonic()
    if _is_unbroken(frame) and now_s - (_put_off_s or now_s) < LONGEST_WAIT_S:
        _put_off_s = _put_off_s or now_s
        _send_again(signum)
        return
    _put_off_s = None
    raised = _Interrupted()
    raised.signum = signum
    raise raised


def _send_again(signum: int) -> None:
    again = threading.Timer(AGAIN_S, signal.pthread_kill, (threading.get_ident(), signum))
    again.daemon = True
    again.start()


def _is_unbroken(frame: FrameType | None) -> bool:
    while frame is not None:
        code = frame.f_code
        if code is _send_again.__code__ or code.co_filename.startswith(UNBROKEN):
            return True
        frame = frame.f_back
    return False


class _Hook:
    """A `sys.unraisablehook`: a signal comes again whose exception had nobody to go to.

    Such are those in `__del__`, in callbacks of weak references and in hooks of `os.fork`.
    """

    def __init__(self, before: Callable[[Any], Any]) -> None:
        self.before = before

    def __call__(self, unraisable: Any, /) -> None:
        if isinstance(unraisable.exc_value, _Interrupted):
            _send_again(unraisable.exc_value.signum)
        else:
            self.before(unraisable)


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
    sys.unraisablehook = _Hook(sys.unraisablehook)
    before: dict[int, Any] = {signum: signal.signal(signum, handler) for signum in heard}
    _taken.append((handler, before))
    return before


def give_back(before: dict[int, Any]) -> None:
    """Let signals be handled as they were."""
    global _put_off_s
    _put_off_s = None
    _taken[:] = [taken for taken in _taken if taken[1] is not before]
    for signum, handler in before.items():
        signal.signal(signum, signal.SIG_DFL if handler is None else handler)
    if isinstance(sys.unraisablehook, _Hook):
        sys.unraisablehook = sys.unraisablehook.before


def fork() -> int:
    """`os.fork` for a child that handles signals as this process does."""
    global _child_is_ours
    _child_is_ours = True
    try:
        return os.fork()
    finally:
        _child_is_ours = False


def _give_back_in_child() -> None:
    """A law's children know nothing of our handlers; one that they replaced stays."""
    if _child_is_ours:
        return
    for ours, before in reversed(_taken):
        give_back({n: old for n, old in before.items() if signal.getsignal(n) == ours})
    _taken.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_give_back_in_child)


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
        if came:
            interrupt(signum, frame)
        _lift_limit_of(signum)
        came.append(signum)

    before = handled_by(note)
    try:
        yield
    finally:
        give_back(before)
    if came:
        signal.raise_signal(came[0])
