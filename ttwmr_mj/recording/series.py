"""Values and states over time: the one timeline, and how rows reach a recording chunk by chunk."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ttwmr_mj.recording.style import Colour
from ttwmr_mj.state import BoolArray, FloatArray

TIMELINE = "sim_time"


def time_column(time_s: FloatArray) -> rr.TimeColumn:
    """Simulated times (n,) in whole nanoseconds; rerun would truncate float seconds."""
    return rr.TimeColumn(TIMELINE, duration=np.rint(1e9 * time_s).astype("timedelta64[ns]"))


def widened(span: tuple[float, float] | None, values: FloatArray) -> tuple[float, float]:
    """The smallest and the largest of what was spanned before and of the finite values."""
    known = values[np.isfinite(values)]
    low, high = span or (np.inf, -np.inf)
    return float(known.min(initial=low)), float(known.max(initial=high))


@dataclass(frozen=True, slots=True)
class Series:
    """Curves of one entity, defined or undefined together."""

    names: tuple[str, ...]  # one per curve, as the legend says
    colours: tuple[Colour, ...]  # one per curve
    width: float = 2.0  # of the lines, in points on the screen
    stepped: bool = False  # values hold until the next row


class SeriesLog:
    """Logs series whose rows arrive in the order of time, in chunks of any size."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._was_defined: dict[str, bool] = {}  # by path; absent: nothing logged there yet

    def append(self, path: str, series: Series, time_s: FloatArray, values: FloatArray) -> None:
        """Log the rows where the curves are defined, and an empty row where they cease to be.

        Args:
            path: of the entity.
            series: how it looks; logged before its first value.
            time_s: (n,) times of the rows.
            values: (n, curves); a row with a NaN is undefined.
        """
        defined: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
        before = np.append(self._was_defined.get(path, False), defined[:-1])
        kept = defined | before
        if not kept.any():
            return
        if path not in self._was_defined:
            self._stream.log(path, _looks(series), static=True)
        self._was_defined[path] = bool(defined[-1])
        columns = rr.Scalars.columns(scalars=values[defined])
        if not defined.all():
            columns = columns.partition(values.shape[1] * defined[kept])
        self._stream.send_columns(path, [time_column(time_s[kept])], columns)


def _looks(series: Series) -> rr.SeriesLines:
    return rr.SeriesLines(
        names=series.names,
        colors=series.colours,
        widths=[series.width] * len(series.names),
        interpolation_mode="StepAfter" if series.stepped else "Linear",
    )


class StateLog:
    """One state over time, of which only the changes are logged.

    Args:
        stream: of the recording.
        path: of the entity.
        looks: state → label on the timeline and colour.
    """

    def __init__(
        self, stream: rr.RecordingStream, path: str, looks: dict[str, tuple[str, Colour]]
    ) -> None:
        self._stream = stream
        self._path = path
        self._last: str | None = None
        labels, colours = zip(*looks.values(), strict=True)
        shown = rr.StateConfiguration(values=list(looks), labels=labels, colors=colours)
        stream.log(path, shown, static=True)

    def append(self, time_s: FloatArray, states: Sequence[str]) -> None:
        """Log the changes among the next states, one per time (n,)."""
        before = [self._last, *states[:-1]]
        changed = [k for k, state in enumerate(states) if state != before[k]]
        self._last = states[-1]
        if changed:
            columns = rr.StateChange.columns(state=[states[k] for k in changed])
            self._stream.send_columns(self._path, [time_column(time_s[changed])], columns)
