"""A limit on the time of code that may never return, such as a controller of the user's.

The limit is on CPU time, so that whether code keeps it does not depend on how busy the machine is.
Code that waits without computing has many times as long, counted in timer signals, which merge into
one while the process is stopped or gets no processor.
"""

import math
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, thread_time
from types import FrameType
from typing import Any, Self

from ttwmr_mj.errors import Overrun, described

MOMENT_S = 1e-6  # the least that a timer is set to: zero stops it
AGAIN_S = 0.1  # the timer rings again and again: too early, or swallowed by a bare `except`
PATIENCE = 15.0  # limits that may pass waiting

# for whoever watches this process: the limit of the body under way, or 0; how many there were;
# steps of other work
_board: Any = memoryview(bytearray(24)).cast("d")


def show_on(board: Any) -> None:
    """Show on this memory from now on what is under way; at least three floats."""
    global _board
    _board = board


def step() -> None:
    """Show that work which has no limit goes on, though it may look as if it did not."""
    _board[2] += 1.0


class Deadline:
    """A context manager, entered once per call, whose body may take `limit_s` of CPU time.

    Between `arm` and `disarm`, in the main thread of a system with interval timers, a signal breaks
    the body off wherever its Python code is, an endless loop included. Elsewhere the time is looked
    at when the body returns, and compiled code is not broken off until it returns to Python.
    A body that swallows what should break it off has overrun all the same.

    A hook for new threads (`threading.setprofile`, `settrace`) that the body sets ends with it: the
    next ones are ours.

    There is one such timer. Who used it before, a script or the deadline of a body around this one,
    has it back from `disarm` on, which is when it rings at the earliest.

    Args:
        limit_s: allowed CPU time of one body, in its thread; and PATIENCE times as much waiting.
    """

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        self._timed = False
        self._before: Any = None
        self._due_s = self._interval_s = 0.0  # of the timer that was there; never: inf
        self._outer_limit_s = 0.0
        self._running = False
        self._rings = 0
        self._began_s = self._began_cpu_s = 0.0
        self._hooks: tuple[Any, Any] = (None, None)
        self._tell: Any = None  # the hook for exceptions that have nobody to go to

    def arm(self) -> None:
        """Take the alarm signal and its timer, until `disarm`."""
        main = threading.current_thread() is threading.main_thread()
        if main and hasattr(signal, "setitimer"):
            left_s, self._interval_s = signal.setitimer(signal.ITIMER_REAL, 0.0)
            self._due_s = perf_counter() + left_s if left_s else math.inf
            self._outer_limit_s = _board[0]
            self._before = signal.signal(signal.SIGALRM, self._ring) or signal.SIG_DFL
            self._tell, sys.unraisablehook = sys.unraisablehook, self._tell_others
            self._timed = True

    def disarm(self) -> None:
        """Give them back."""
        if self._timed:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._before)
            sys.unraisablehook = self._tell
            self._timed = False
            _board[0] = self._outer_limit_s
            if self._due_s < math.inf:
                left_s = max(self._due_s - perf_counter(), MOMENT_S)
                signal.setitimer(signal.ITIMER_REAL, left_s, self._interval_s)

    def __enter__(self) -> Self:
        self._hooks = threading.gettrace(), threading.getprofile()
        self._began_s, self._began_cpu_s = perf_counter(), thread_time()
        _board[1] += 1.0
        _board[0] = self.limit_s
        self._running, self._rings = True, 0
        if self._timed:
            signal.setitimer(signal.ITIMER_REAL, self.limit_s, AGAIN_S)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._running = False  # before the timer is stopped, which may have rung already
        _board[0] = 0.0
        if self._timed:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        trace, profile = self._hooks
        if threading.gettrace() is not trace or threading.getprofile() is not profile:
            threading.settrace(trace)
            threading.setprofile(profile)
        waited = not self._timed and perf_counter() - self._began_s > PATIENCE * self.limit_s
        if kind is None and (waited or self._is_over()):
            raise Overrun

    def _ring(self, signum: int, frame: FrameType | None) -> None:
        del signum
        if not self._running:
            return
        self._rings += 1
        # in `__enter__` an Overrun would skip `__exit__`, and in `__exit__` all that this does
        ours = frame is not None and frame.f_code in (_ENTER, _EXIT)
        if not ours and self._is_over():
            raise Overrun

    def _is_over(self) -> bool:
        waited = self._rings * AGAIN_S > PATIENCE * self.limit_s
        return waited or thread_time() - self._began_cpu_s > self.limit_s

    def _tell_others(self, unraisable: Any) -> None:
        """Not an Overrun in `__del__`, for instance: the end of the body tells it."""
        if not isinstance(unraisable.exc_value, Overrun):
            self._tell(unraisable)


_ENTER, _EXIT = Deadline.__enter__.__code__, Deadline.__exit__.__code__


def described_within(limit_s: float, error: BaseException) -> str:
    """`errors.described`, of an exception whose text may never come."""
    try:
        with limited(limit_s):
            return described(error)
    except Overrun:
        return f"{type(error).__name__} (whose text took more than {limit_s:g} s)"


@contextmanager
def limited(limit_s: float) -> Iterator[None]:
    """A deadline for one body.

    Raises:
        Overrun: it took longer.
    """
    deadline = Deadline(limit_s)
    deadline.arm()
    try:
        with deadline:
            yield
    finally:
        deadline.disarm()
