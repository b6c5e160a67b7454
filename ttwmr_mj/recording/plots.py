"""The plots of a run: which curves each shows, their names and colours, and their values."""

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from rerun.blueprint import Corner2D

from ttwmr_mj.recording import style
from ttwmr_mj.recording.series import Series, SeriesLog, StateLog
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import FloatArray, wrap

# What was asked for is a wide band under the thin line of what happened. The viewer draws the
# series of a plot in the alphabetical order of their entities, so "true" comes last.
BAND = 5.0  # points on the screen


@dataclass(frozen=True, slots=True)
class Plot:
    """One time series view.

    Attributes:
        title: what is plotted, with its unit.
        legend: corner of the legend, where curves rarely are; None hides it.
        series: last part of the entity's path → its curves.
    """

    title: str
    legend: Corner2D | None = None
    series: dict[str, Series] = field(default_factory=dict)


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


def _single(title: str, colour: Colour, name: str = "true") -> Plot:
    label = {"true": "true", "seen": "estimated"}[name]
    return Plot(title, None, {name: Series((label,), (colour,))})


def _angles(title: str) -> Plot:
    lines = {
        "theta1": Series(("θ1",), (style.TRACTOR,)),
        "theta2": Series(("θ2",), (style.TRAILER,)),
    }
    return Plot(title, Corner2D.RightTop, lines)


_WHEEL_SPEED = {
    "command": Series(
        ("right command", "left command"),
        (style.COMMAND_RIGHT, style.COMMAND_LEFT),
        width=BAND,
        stepped=True,
    ),
    "true": Series(("right", "left"), (style.RIGHT, style.LEFT)),
}
PLOTS: dict[str, Plot] = {
    "x": _against_reference("x of P [m]", style.TRACTOR, Corner2D.RightTop),
    "y": _against_reference("y of P [m]", style.TRACTOR, Corner2D.RightTop),
    "theta1": _against_reference("θ1 of the tractor [rad]", style.TRACTOR, Corner2D.RightBottom),
    "theta2": _against_reference("θ2 of the trailer [rad]", style.TRAILER, Corner2D.RightBottom),
    "tractor_error": _single("position error of P [mm]", style.TRACTOR),
    "trailer_error": _single("position error of the trailer's COM [mm]", style.TRAILER),
    "angle_error": _angles("angle errors [°]"),
    "hitch_angle": _single("hitch angle θ2 − θ1 [°]", style.TRAILER),
    "wheel_speed": Plot("wheel speeds [rad/s]", Corner2D.RightBottom, _WHEEL_SPEED),
    "estimate_error": _single("estimation error of P [mm]", style.ESTIMATE, "seen"),
    "estimate_angle_error": _angles("estimation errors of the angles [mrad]"),
    "measurement_age": _single("age of the newest measurement [ms]", style.ESTIMATE, "seen"),
}
SENSING = ("estimate_error", "estimate_angle_error", "measurement_age")  # shown with a camera
FLAGS = ("saturated", "near_singular")
YES_NO = {"no": (" ", style.IDLE), "yes": ("yes", style.ALERT)}


class Plots:
    """Everything under plots/ and flags/ in one recording."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._series = SeriesLog(stream)
        self._flags = {name: StateLog(stream, f"flags/{name}", YES_NO) for name in FLAGS}

    def append(self, rows: Trajectory, curves: Curves) -> None:
        """Log the next rows of the run, of one simulation, and the curves of the same rows."""
        for plot, series in _values(rows, curves).items():
            for name, values in series.items():
                look = PLOTS[plot].series[name]
                self._series.append(f"plots/{plot}/{name}", look, rows.time_s, values)
        for name, values in rows.signals.items():
            look = Series((name,), (style.TRACTOR,))
            self._series.append(signal_path(name), look, rows.time_s, values)
        for name, flag in self._flags.items():
            flag.append(rows.time_s, np.where(getattr(rows, name)[:, 0], "yes", "no").tolist())


def signal_path(name: str) -> str:
    """Where a control law's signal is in the recording."""
    return f"plots/signals/{rr.escape_entity_path_part(name)}"


def _values(rows: Trajectory, curves: Curves) -> dict[str, dict[str, FloatArray]]:
    """Plot → series → values (n, curves), NaN where undefined."""
    q, ref_q, est_q = rows.q[:, 0], rows.ref_q[:, 0], rows.est_q[:, 0]
    seen = np.where((est_q != q).any(axis=1, keepdims=True), est_q, np.nan)
    values: dict[str, dict[str, FloatArray]] = {
        plot: {"true": q[:, [i]], "seen": seen[:, [i]], "reference": ref_q[:, [i]]}
        for i, plot in enumerate(("x", "y", "theta1", "theta2"))
    }
    degrees = np.degrees(curves.theta_error_rad[:, 0])
    values["tractor_error"] = {"true": 1e3 * curves.tractor_error_m}
    values["trailer_error"] = {"true": 1e3 * curves.trailer_error_m}
    values["angle_error"] = {"theta1": degrees[:, [0]], "theta2": degrees[:, [1]]}
    values["hitch_angle"] = {"true": np.degrees(curves.hitch_angle_rad)}
    values["wheel_speed"] = {
        "true": rows.wheel_speed_rad_s[:, 0],
        "command": rows.wheel_command_rad_s[:, 0],
    }
    miss = wrap(seen[:, 2:] - q[:, 2:])
    values["estimate_error"] = {"seen": 1e3 * np.hypot(*(seen - q)[:, :2].T)[:, None]}
    values["estimate_angle_error"] = {"theta1": 1e3 * miss[:, [0]], "theta2": 1e3 * miss[:, [1]]}
    aged = np.where(np.isfinite(seen[:, :1]), 1e3 * rows.measurement_age_s, np.nan)
    values["measurement_age"] = {"seen": aged}
    return values
