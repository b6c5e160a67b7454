"""Work beside the loop: what has been simulated is recorded while the simulation goes on."""

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Self


class Background:
    """A thread that does one piece of work at a time, in the order given; a context manager.

    Leaving the context waits for the work that is under way, and re-raises its exception.
    """

    # [s] a thread that waits for Python's lock gets it after that; Python's own 5 ms, at every
    # return from compiled code, stop a loop that runs at 5 ms a frame
    SWITCH_INTERVAL_S = 5e-5

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="background")
        self._work: Future[None] | None = None
        self._interval_s = sys.getswitchinterval()

    def do(self, work: Callable[[], None]) -> None:
        """Hand over work, once the work before it is done; re-raises its exception."""
        self.wait()
        self._work = self._thread.submit(work)

    def wait(self) -> None:
        """Wait until all is done; re-raises its exception."""
        if self._work is not None:
            self._work.result()

    def __enter__(self) -> Self:
        self._interval_s = sys.getswitchinterval()
        sys.setswitchinterval(self.SWITCH_INTERVAL_S)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._thread.shutdown()
        sys.setswitchinterval(self._interval_s)
        if kind is None:
            self.wait()
