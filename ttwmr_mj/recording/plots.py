"""The plots: which curves each shows, their names and colours, and how rows reach them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from rerun.blueprint import Corner2D

from ttwmr_mj.recording import style
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.recording.timeline import time_column
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import BoolArray, FloatArray, wrap

# plot → series → values (n, curves), NaN where undefined
Values = dict[str, dict[str, FloatArray]]

# What was asked for is a wide band under the thin line of what happened. The viewer draws the
# series of a plot in the alphabetical order of their entities, so "true" comes last.
BAND, LINE = 5.0, 2.0  # points on the screen


@dataclass(frozen=True, slots=True)
class Series:
    """Curves of one entity, defined or undefined together.

    Attributes:
        names: one per curve, as the legend says.
        colours: one per curve.
        width: of the lines, in points on the screen.
        stepped: values hold until the next row.
    """

    names: tuple[str, ...]
    colours: tuple[Colour, ...]
    width: float = LINE
    stepped: bool = False


@dataclass(frozen=True, slots=True)
class Plot:
    """One time series view.

    Attributes:
        title: what is plotted, with its unit.
        legend: corner of the legend, where curves rarely are; None hides it.
        series: last part of the entity's path → its curves.
    """

    title: str
    legend: Corner2D | None
    series: dict[str, Series]


def _against_reference(title: str, truth: Colour, legend: Corner2D) -> Plot:
    return Plot(
        title,
        legend,
        {
            "reference": Series(("reference",), (style.REFERENCE,), width=BAND),
            "seen": Series(("estimated",), (style.ESTIMATE,)),
            "true": Series(("true",), (truth,)),
        },
    )


def _single(colour: Colour) -> Series:
    return Series(("true",), (colour,))


PLOTS: dict[str, Plot] = {
    "x": _against_reference("x of P [m]", style.TRACTOR, Corner2D.RightTop),
    "y": _against_reference("y of P [m]", style.TRACTOR, Corner2D.RightTop),
    "theta1": _against_reference("θ1 of the tractor [rad]", style.TRACTOR, Corner2D.RightBottom),
    "theta2": _against_reference("θ2 of the trailer [rad]", style.TRAILER, Corner2D.RightBottom),
    "tractor_error": Plot("position error of P [mm]", None, {"true": _single(style.TRACTOR)}),
    "trailer_error": Plot(
        "position error of the trailer's COM [mm]", None, {"true": _single(style.TRAILER)}
    ),
    "angle_error": Plot(
        "angle errors [°]",
        Corner2D.RightTop,
        {
            "theta1": Series(("θ1",), (style.TRACTOR,)),
            "theta2": Series(("θ2",), (style.TRAILER,)),
        },
    ),
    "hitch_angle": Plot("hitch angle θ2 − θ1 [°]", None, {"true": _single(style.TRAILER)}),
    "wheel_speed": Plot(
        "wheel speeds [rad/s]",
        Corner2D.RightBottom,
        {
            "command": Series(
                ("right command", "left command"),
                (style.COMMAND_RIGHT, style.COMMAND_LEFT),
                width=BAND,
                stepped=True,
            ),
            "true": Series(("right", "left"), (style.RIGHT, style.LEFT)),
        },
    ),
    "lyapunov": Plot("V over its start, log10 (Eq. 33)", None, {"true": _single(style.TRACTOR)}),
    "lyapunov_rate": Plot(
        "V′ over V [1/s]: positive where V grows",
        Corner2D.RightTop,
        {
            "claimed": Series(("Eq. 36",), (style.REFERENCE,), width=BAND),
            "true": Series(("measured",), (style.TRACTOR,)),
        },
    ),
    "estimate_error": Plot("estimation error of P [mm]", None, {"seen": _single(style.ESTIMATE)}),
    "estimate_angle_error": Plot(
        "estimation errors of the angles [mrad]",
        Corner2D.RightTop,
        {
            "theta1": Series(("θ1",), (style.TRACTOR,)),
            "theta2": Series(("θ2",), (style.TRAILER,)),
        },
    ),
    "measurement_age": Plot(
        "age of the newest measurement [ms]", None, {"seen": _single(style.ESTIMATE)}
    ),
}
SENSING = (
    "estimate_error",
    "estimate_angle_error",
    "measurement_age",
)  # worth a look with a camera
LYAPUNOV = ("lyapunov", "lyapunov_rate")  # of laws that have such a function
FLAGS = ("saturated", "near_singular")


class Plots:
    """Everything under plots/ and flags/ in one recording."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._styled: set[str] = set()
        self._was_defined: dict[str, bool] = {}
        self._flags: dict[str, bool] = {}
        for name in FLAGS:
            looks = rr.StateConfiguration(
                values=["no", "yes"], labels=[" ", "yes"], colors=[style.IDLE, style.ALERT]
            )
            stream.log(f"flags/{name}", looks, static=True)

    def append(
        self,
        now: rr.TimeColumn,
        rows: Trajectory,
        curves: Curves,
        more: Values | None = None,
    ) -> None:
        """Log the next rows of the run.

        Args:
            now: the rows' times.
            rows: n rows; the first simulation is drawn.
            curves: of the same rows.
            more: values of further plots, of the same rows.
        """
        for plot, series in (_values(rows, curves) | (more or {})).items():
            for name, values in series.items():
                path = f"plots/{plot}/{name}"
                self._append_series(path, PLOTS[plot].series[name], now, rows.time_s, values)
        for name in FLAGS:
            self._append_flag(f"flags/{name}", rows.time_s, getattr(rows, name)[:, 0])

    def _append_series(
        self,
        path: str,
        series: Series,
        now: rr.TimeColumn,
        time_s: FloatArray,
        values: FloatArray,
    ) -> None:
        """Log the rows where the curves are defined, and an empty row where they cease to be."""
        defined: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
        before = np.append(self._was_defined.get(path, False), defined[:-1])
        self._was_defined[path] = bool(defined[-1])
        kept = defined | before
        if not kept.any():
            return
        if path not in self._styled:
            self._styled.add(path)
            self._stream.log(path, _looks(series), static=True)
        columns = rr.Scalars.columns(scalars=values[defined])
        if not defined.all():
            now = time_column(time_s[kept])
            columns = columns.partition(values.shape[1] * defined[kept])
        self._stream.send_columns(path, [now], columns)

    def _append_flag(self, path: str, time_s: FloatArray, flags: BoolArray) -> None:
        """Log the rows where the flag changes."""
        changed: BoolArray = flags != np.append(self._flags.get(path, not flags[0]), flags[:-1])
        self._flags[path] = bool(flags[-1])
        if changed.any():
            states = rr.StateChange.columns(state=np.where(flags[changed], "yes", "no").tolist())
            self._stream.send_columns(path, [time_column(time_s[changed])], states)


def _looks(series: Series) -> rr.SeriesLines:
    return rr.SeriesLines(
        names=series.names,
        colors=series.colours,
        widths=[series.width] * len(series.names),
        interpolation_mode="StepAfter" if series.stepped else "Linear",
    )


def _values(rows: Trajectory, curves: Curves) -> Values:
    """The values of the first simulation."""
    q, ref_q, est_q = rows.q[:, 0], rows.ref_q[:, 0], rows.est_q[:, 0]
    seen = np.where((est_q != q).any(axis=1, keepdims=True), est_q, np.nan)
    values: Values = {
        plot: {"true": q[:, [i]], "seen": seen[:, [i]], "reference": ref_q[:, [i]]}
        for i, plot in enumerate(("x", "y", "theta1", "theta2"))
    }
    degrees = np.degrees(curves.theta_error_rad[:, 0])
    values["tractor_error"] = {"true": 1e3 * curves.tractor_error_m[:, :1]}
    values["trailer_error"] = {"true": 1e3 * curves.trailer_error_m[:, :1]}
    values["angle_error"] = {"theta1": degrees[:, [0]], "theta2": degrees[:, [1]]}
    values["hitch_angle"] = {"true": np.degrees(curves.hitch_angle_rad[:, :1])}
    values["wheel_speed"] = {
        "true": rows.wheel_speed_rad_s[:, 0],
        "command": rows.wheel_command_rad_s[:, 0],
    }
    miss = wrap(seen[:, 2:] - q[:, 2:])
    values["estimate_error"] = {"seen": 1e3 * np.hypot(*(seen - q)[:, :2].T)[:, None]}
    values["estimate_angle_error"] = {"theta1": 1e3 * miss[:, [0]], "theta2": 1e3 * miss[:, [1]]}
    aged = np.where(np.isfinite(seen[:, :1]), 1e3 * rows.measurement_age_s, np.nan)
    values["measurement_age"] = {"seen": aged[:, :1]}
    return values
