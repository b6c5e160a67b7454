"""How far a sweep is: a bar on terminals, a line every now and then where output goes to a file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

LINE_EVERY_S = 60.0
FIRST_LINE_S = 2.0  # sooner at first, so that the log of a sweep killed early says how far it was


@contextmanager
def sweep_progress(
    name: str, rows: int, quiet: bool = False
) -> Iterator[Callable[[int, int], None] | None]:
    """Show rows done, their rate, the time left and how many failed, on stderr.

    Yields:
        A function of the rows done and of those that failed; None if nothing is shown.
    """
    if quiet:
        yield None
    elif sys.stderr.isatty():
        yield from _bar(name, rows)
    else:
        yield _Lines(name, rows)


def _bar(name: str, rows: int) -> Iterator[Callable[[int, int], None]]:
    from tqdm import tqdm

    with tqdm(total=rows, desc=name, unit="run", smoothing=0.1) as bar:

        def told(done: int, failed: int) -> None:
            if bar.n == 0 and done:  # of an earlier call: no work of this one's rate
                bar.initial = done
            bar.update(done - bar.n)
            bar.set_postfix_str(f"{failed} failed")

        yield told


class _Lines:
    """Progress as text, for the log of a job."""

    def __init__(self, name: str, rows: int) -> None:
        self._name, self._rows = name, rows
        self._began = self._last = monotonic()
        self._first: int | None = None

    def __call__(self, done: int, failed: int) -> None:
        now = monotonic()
        if self._first is None:
            self._first = done
        elif done < self._rows:
            waited_s = max(FIRST_LINE_S, min(LINE_EVERY_S, self._last - self._began))
            if now - self._last < waited_s:
                return
        self._last = now
        print(self._line(done, failed, now - self._began), file=sys.stderr, flush=True)

    def _line(self, done: int, failed: int, took_s: float) -> str:
        line = f"{self._name}: {done} of {self._rows} runs, {failed} failed"
        new = done - (self._first or 0)
        if not new or took_s <= 0:
            return line
        rate = new / took_s
        return f"{line}, {rate:.3g} runs/s, {(self._rows - done) / rate:.0f} s left"
