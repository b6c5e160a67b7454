"""The plots under a video: drawn once, then uncovered as time goes on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.files import importing_matplotlib
from ttwmr_mj.recording import style
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 100
PAPER = "#181A1E"
INK = "#D5D9DF"
LEAST_MM = 1e-2
LEAST_S = 0.1  # that an axis of time covers: a film may have one picture
FUTURE = 0.22  # how much of the curves is seen beforehand
CURSOR: Colour = (255, 255, 255)


class Strip:
    """Errors on the left, wheel speeds and the hitch angle on the right.

    Args:
        footage: what is shown.
        width, height: of the strip in pixels.
    """

    def __init__(self, footage: Footage, width: int, height: int) -> None:
        self._time_s = footage.time_s
        self._full, spans = _draw(footage, width, height)
        self._spans = spans
        paper = np.array([24, 26, 30], dtype=np.float32)
        faint = paper + FUTURE * (self._full.astype(np.float32) - paper)
        self._faint = faint.astype(np.uint8)

    def at(self, frame: int) -> Image:
        """The strip (height, width, 3) RGB at a frame."""
        picture = self._full.copy()
        share = frame / max(len(self._time_s) - 1, 1)
        for left, right, top, bottom in self._spans:
            now = round(left + share * (right - left))
            inside = np.s_[top:bottom, now + 1 : right]
            picture[inside] = self._faint[inside]
            picture[top:bottom, now : now + 2] = CURSOR
        return picture


def _draw(
    footage: Footage, width: int, height: int
) -> tuple[Image, list[tuple[int, int, int, int]]]:
    """The whole strip, and (left, right, top, bottom) of its plots in pixels."""
    with importing_matplotlib():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=PAPER)
    axes = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.05, right=0.98, top=0.84, bottom=0.17, wspace=0.17)
    _errors(axes[0], footage)
    _hitch(axes[1], footage)
    _wheels(axes[2], footage)
    for one in axes:
        _dress(one, footage)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    picture = np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
    spans = []
    for one in axes:
        box = one.get_window_extent()
        spans.append(
            (round(box.x0) + 1, round(box.x1), height - round(box.y1), height - round(box.y0))
        )
    return picture, spans


def _dress(axes: Axes, footage: Footage) -> None:
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    axes.set_facecolor(PAPER)
    first_s, last_s = footage.time_s[0], footage.time_s[-1]
    axes.set_xlim(first_s, max(last_s, first_s + LEAST_S))
    axes.tick_params(colors=INK, labelsize=9, length=3)
    axes.grid(color="#343941", linewidth=0.7)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color("#5A616B")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} s"))


def _title(axes: Axes, parts: Sequence[tuple[str, Colour | None]]) -> None:
    """A title whose words have the colours of the curves: no legend is needed."""
    from matplotlib.axes import Axes
    from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

    assert isinstance(axes, Axes)
    areas = [
        TextArea(text, textprops={"color": _hex(colour) if colour else INK, "fontsize": 10.5})
        for text, colour in parts
    ]
    box = AnchoredOffsetbox(
        loc="lower left",
        child=HPacker(children=[*areas], pad=0, sep=6),
        frameon=False,
        bbox_to_anchor=(0.0, 1.0),
        bbox_transform=axes.transAxes,
        pad=0.2,
        borderpad=0,
    )
    axes.add_artist(box)


def _errors(axes: Axes, footage: Footage) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    curves, time_s = footage.curves, footage.rows.time_s
    shown: dict[str, tuple[FloatArray, Colour]] = {
        "tractor": (curves.tractor_error_m[:, 0], style.TRACTOR),
        "trailer": (curves.trailer_error_m[:, 0], style.TRAILER),
    }
    parts: list[tuple[str, Colour | None]] = [("off the reference [mm]:", None)]
    for name, (error_m, colour) in shown.items():
        if np.isfinite(error_m).any():
            axes.plot(time_s, np.maximum(1e3 * error_m, LEAST_MM), color=_hex(colour), lw=1.8)
            parts.append((name, colour))
    if len(parts) == 1:
        parts = [("speed of P [m/s]", style.TRACTOR)]
        speed = np.hypot(*footage.rows.q_rate[:, 0, :2].T)
        axes.plot(time_s, speed, color=_hex(style.TRACTOR), lw=1.8)
    else:
        axes.set_yscale("log")
        # within a decade Matplotlib would label its minor ticks, in a dark colour
        low, high = axes.get_ylim()
        steps = (1.0, 2.0, 3.0, 5.0) if high < 1e2 * low else (1.0,)
        axes.yaxis.set_major_locator(LogLocator(subs=steps, numticks=12))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    _title(axes, parts)


def _hitch(axes: Axes, footage: Footage) -> None:
    rows = footage.rows
    reference = np.degrees(rows.ref_q[:, 0, 3] - rows.ref_q[:, 0, 2])
    hitch = np.degrees(footage.curves.hitch_angle_rad[:, 0])
    parts: list[tuple[str, Colour | None]] = [("hitch angle [°]", style.TRAILER)]
    if np.isfinite(reference).any():
        turns = 360.0 * np.round((np.nanmedian(hitch) - np.nanmedian(reference)) / 360.0)
        axes.plot(rows.time_s, reference + turns, color=_hex(style.REFERENCE_BAND), lw=5, alpha=0.6)
        parts.append(("reference", style.REFERENCE_BAND))
    axes.plot(rows.time_s, hitch, color=_hex(style.TRAILER), lw=1.8)
    _title(axes, parts)


def _wheels(axes: Axes, footage: Footage) -> None:
    rows, limit = footage.rows, footage.scenario.robot.servo.speed_limit_rad_s
    for side, colour in enumerate((style.RIGHT, style.LEFT)):
        axes.plot(rows.time_s, rows.wheel_speed_rad_s[:, 0, side], color=_hex(colour), lw=1.8)
    fastest = float(np.abs(rows.wheel_speed_rad_s).max())
    parts: list[tuple[str, Colour | None]] = [("wheel speeds [rad/s]:", None)]
    parts += [("right", style.RIGHT), ("left", style.LEFT)]
    if fastest > 0.6 * limit:
        lowest = float(rows.wheel_speed_rad_s.min())
        for bound in (-limit, limit):
            if bound > 0.0 or lowest < -0.5 * limit:
                axes.axhline(bound, color=_hex(style.ALERT), lw=1.0, ls=(0, (4, 3)))
        parts.append(("limit", style.ALERT))
    _title(axes, parts)


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
