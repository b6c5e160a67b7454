"""Where the wall time of a run goes."""

from collections import defaultdict
from time import perf_counter


class Stopwatch:
    """Adds up wall time by part.

    Attributes:
        parts: seconds by name.
    """

    def __init__(self) -> None:
        self.parts: defaultdict[str, float] = defaultdict(float)
        self._last = perf_counter()

    def lap(self, part: str) -> float:
        """Book the time since the last lap under `part`; returns the time now."""
        now = perf_counter()
        self.parts[part] += now - self._last
        self._last = now
        return now
