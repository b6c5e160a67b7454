"""The plots of a run: which curves each shows, their names and colours, and their values.

The key below the scene tells the colours apart, so that most plots need no legend.
"""

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from rerun.blueprint import Corner2D

from ttwmr_mj.recording import style
from ttwmr_mj.recording.series import Series, SeriesLog, StateLog, widened
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.recording.words import drawable
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


def _against_reference(title: str, truth: Colour) -> Plot:
    return Plot(
        title,
        None,
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
    return Plot(title, None, lines)


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
    "x": _against_reference("x of P [mm]", style.TRACTOR),
    "y": _against_reference("y of P [mm]", style.TRACTOR),
    "theta1": _against_reference("θ1 of the tractor [rad]", style.TRACTOR),
    "theta2": _against_reference("θ2 of the trailer [rad]", style.TRAILER),
    # The viewer has no logarithmic axis, so the logarithm is what is recorded.
    "position_error": Plot(
        "off the reference, log₁₀ of mm (1 = 1 cm, 2 = 10 cm)",
        None,
        {
            "tractor": Series(("tractor, P",), (style.TRACTOR,)),
            "trailer": Series(("trailer, COM",), (style.TRAILER,)),
        },
    ),
    "tractor_error": _single("P, error [mm]", style.TRACTOR),
    "trailer_error": _single("trailer's COM, error [mm]", style.TRAILER),
    "angle_error": _angles("angle errors [°]"),
    "hitch_angle": _single("hitch angle θ2 − θ1 [°]", style.TRAILER),
    "wheel_speed": Plot("wheel speeds [rad/s]", Corner2D.RightTop, _WHEEL_SPEED),
    "estimate_error": _single("estimation error of P [mm]", style.ESTIMATE, "seen"),
    "estimate_angle_error": _angles("estimation errors of the angles [mrad]"),
    "measurement_age": _single("age of the newest measurement [ms]", style.ESTIMATE, "seen"),
}
SCALES = {"x": 1e3, "y": 1e3, "theta1": 1.0, "theta2": 1.0}  # of the columns of q
LEAST_ERROR_MM = 1e-3  # of the logarithm: a micrometre, less is nothing
RESTING_M_S = 1e-3
STATES: dict[str, dict[str, tuple[str, Colour]]] = {  # state → value → label and colour
    "wheels": {
        "free": ("within their limits", style.IDLE),
        "saturated": ("at their limit", style.ALERT),
    },
    "law": {
        "regular": ("regular", style.IDLE),
        "resting": ("at rest", style.RESTING),
        "near_singular": ("near its singularity", style.ALERT),
    },
}


class Plots:
    """Everything under plots/ and the states in one recording.

    Attributes:
        ranges: plot, or path of a signal → its smallest and largest value so far.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._series = SeriesLog(stream)
        self._states = {name: StateLog(stream, name, looks) for name, looks in STATES.items()}
        self._resting = False
        self.ranges: dict[str, tuple[float, float]] = {}

    def append(self, rows: Trajectory, curves: Curves) -> None:
        """Log the next rows of the run, of one simulation, and the curves of the same rows."""
        for plot, series in _values(rows, curves).items():
            for name, values in series.items():
                look = PLOTS[plot].series[name]
                self._series.append(f"plots/{plot}/{name}", look, rows.time_s, values)
                self._widen(plot, values)
        for name, values in rows.signals.items():
            look = Series((drawable(name),), (style.TRACTOR,))
            self._series.append(signal_path(name), look, rows.time_s, values)
            self._widen(signal_path(name), values)
        wheels = np.where(rows.saturated[:, 0], "saturated", "free").tolist()
        self._states["wheels"].append(rows.time_s, wheels)
        self._states["law"].append(rows.time_s, self._law_states(rows))

    def _widen(self, plot: str, values: FloatArray) -> None:
        if np.isfinite(values).any():
            self.ranges[plot] = widened(self.ranges.get(plot), values)

    def _law_states(self, rows: Trajectory) -> list[str]:
        """A law is singular at standstill, which is no news of a robot that rests or starts."""
        states = []
        slow = np.hypot(*rows.q_rate[:, 0, :2].T) < RESTING_M_S
        for near, still in zip(rows.near_singular[:, 0], slow, strict=True):
            self._resting = bool(near and (still or self._resting))
            states.append("resting" if self._resting else "near_singular" if near else "regular")
        return states


def signal_path(name: str) -> str:
    """Where a control law's signal is in the recording."""
    return f"plots/signals/{rr.escape_entity_path_part(name)}"


def _values(rows: Trajectory, curves: Curves) -> dict[str, dict[str, FloatArray]]:
    """Plot → series → values (n, curves), NaN where undefined."""
    q, ref_q, est_q = rows.q[:, 0], rows.ref_q[:, 0], rows.est_q[:, 0]
    seen = np.where((est_q != q).any(axis=1, keepdims=True), est_q, np.nan)
    values: dict[str, dict[str, FloatArray]] = {
        plot: {
            "true": scale * q[:, [i]],
            "seen": scale * seen[:, [i]],
            "reference": scale * ref_q[:, [i]],
        }
        for i, (plot, scale) in enumerate(SCALES.items())
    }
    degrees = np.degrees(curves.theta_error_rad[:, 0])
    values["position_error"] = {
        name: np.log10(np.maximum(1e3 * error_m, LEAST_ERROR_MM))
        for name, error_m in (
            ("tractor", curves.tractor_error_m),
            ("trailer", curves.trailer_error_m),
        )
    }
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
