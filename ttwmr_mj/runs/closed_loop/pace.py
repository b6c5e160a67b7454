"""How fast a run goes: as fast as it can, or held to the wall clock."""

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter, sleep
from types import FrameType

from ttwmr_mj.deadline import step
from ttwmr_mj.errors import InputError

REPORT_EVERY_S = 0.8  # wall time between two reports: a kill costs less than a second
LIVE_REPORT_EVERY_S = 0.1  # where someone looks on
SLOWEST = 1e-3  # a second of simulation takes 17 minutes
STEP_S = 1.0  # of waiting
BEHIND_S = 0.1  # a run this late is behind: less is not seen


@dataclass(slots=True)
class Pace:
    """Holds a run to the wall clock, and notes where the machine could not follow.

    Time that was lost is made up for as fast as the machine can; that for which the process was
    stopped, by Ctrl-Z for instance, is none.

    Attributes:
        speed: simulated seconds per second; 0: as fast as it can.
        report_every_s: wall time between two reports of the loop.
        lag_s: by how much every sample so far came too late; empty with speed 0.

    Raises:
        InputError: the speed is negative, not finite, or slower than SLOWEST.
    """

    speed: float = 0.0
    report_every_s: float = REPORT_EVERY_S
    lag_s: list[float] = field(default_factory=list)
    _started_s: float = 0.0
    _begins: bool = True

    def __post_init__(self) -> None:
        if self.speed and not SLOWEST <= self.speed < float("inf"):
            allowed = f"0 (as fast as it can), or {SLOWEST:g} or more, such as 1"
            raise InputError.at("--pace", got=f"{self.speed:g}", allowed=allowed)

    def hold(self, time_s: float) -> bool:
        """Wait until the sample at this simulated time is due; whether the run goes on."""
        if not self.speed:
            return True
        now_s = perf_counter()
        if self._begins:
            self._begins, self._started_s = False, now_s - time_s / self.speed
        early_s = self._started_s + time_s / self.speed - now_s
        self.lag_s.append(max(-early_s, 0.0))
        while early_s > STEP_S:  # of slow paces a period may take minutes
            sleep(STEP_S)
            step()
            early_s = self._started_s + time_s / self.speed - perf_counter()
        if early_s > 0.0:
            sleep(early_s)
        return True

    @contextmanager
    def heeding_stops(self) -> Iterator[None]:
        """While it lasts the pace begins anew where the process goes on after a stop."""
        main = threading.current_thread() is threading.main_thread()
        if not (self.speed and main and hasattr(signal, "SIGCONT")):
            yield
            return
        before = signal.signal(signal.SIGCONT, self._begin_anew) or signal.SIG_DFL
        try:
            yield
        finally:
            signal.signal(signal.SIGCONT, before)

    def _begin_anew(self, signum: int, frame: FrameType | None) -> None:
        del signum, frame
        self._begins = True

    def told(self) -> str:
        """In words, how the pace was kept; empty where there was none to keep."""
        if not self.lag_s:
            return ""
        latest_s = max(self.lag_s)
        if latest_s <= BEHIND_S:
            return f"pace {self.speed:g} × real time, kept"
        late = sum(lag_s > BEHIND_S for lag_s in self.lag_s) / len(self.lag_s)
        return (
            f"pace {self.speed:g} × real time was too fast for this machine: "
            f"{100.0 * late:.0f} % of the samples came late, the latest by {latest_s:.2g} s"
        )


def behind(lag_s: Sequence[float]) -> list[bool]:
    """Which samples are so late that it is seen."""
    return [late_s > BEHIND_S for late_s in lag_s]
