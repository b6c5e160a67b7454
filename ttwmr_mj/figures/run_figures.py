"""The figures of a run as files, PNG and SVG; beside the studies' own, the only matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRACTOR, TRAILER = "#0072B2", "#C2478A"
RIGHT, LEFT = "#0072B2", "#D55E00"
REFERENCE: dict[str, Any] = {"color": "#222222", "linestyle": (0, (4, 2)), "linewidth": 1.0}
SIZE_IN = (4.8, 3.0)
DPI = 150
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "ttwmr",  # else ids in the SVG are random
}


def write_run_figures(
    trajectory: Trajectory, robot: RobotParameters, folder: Path, title: str
) -> list[Path]:
    """Draw the first simulation: paths, x, y, θ1, θ2, wheel speeds, errors, hitch angle.

    The same trajectory gives the same bytes. A file is there whole or not at all.

    Args:
        trajectory: the run; what its reference leaves undefined is not drawn.
        robot: its trailer says where the COM is.
        folder: where the files go; made if missing.
        title: of every figure.

    Returns:
        The files written, NAME.png (150 dpi) and NAME.svg for each figure.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    curves = Curves.of(trajectory, robot)
    written: list[Path] = []
    with mpl.rc_context():
        mpl.rcdefaults()  # whatever the user's matplotlibrc says
        mpl.rcParams.update(STYLE)
        for name, draw in FIGURES.items():
            figure = Figure(figsize=SIZE_IN, layout="constrained")
            FigureCanvasAgg(figure)
            draw(figure, trajectory, curves)
            figure.suptitle(title, fontsize=9.0)
            written += [_save(figure, folder / f"{name}{ending}") for ending in (".png", ".svg")]
    return written


def _save(figure: Figure, path: Path) -> Path:
    """Write under another name first, so that nobody sees half a file."""
    draft = path.with_name(f".{path.name}.part")
    metadata = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    try:
        figure.savefig(draft, format=path.suffix[1:], dpi=DPI, metadata=metadata)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
    return path


def _draw_paths(figure: Figure, run: Trajectory, curves: Curves) -> None:
    figure.set_size_inches(4.8, 4.2)
    axes = figure.subplots()
    p, com = run.q[:, 0, :2], curves.trailer_com_m[:, 0]
    axes.plot(*p.T, color=TRACTOR, label="P (tractor)")
    axes.plot(*com.T, color=TRAILER, label="COM of the trailer")
    for reference, label in (
        (run.ref_q[:, 0, :2], "references"),
        (curves.ref_trailer_com_m[:, 0], None),
    ):
        if _defined(reference):
            axes.plot(*reference.T, **REFERENCE, label=label)
    for start, colour in ((p[0], TRACTOR), (com[0], TRAILER)):
        axes.plot(*start, "o", color=colour, markeredgecolor="white", markersize=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    _legend(figure)


def _draw_coordinate(column: int, label: str, colour: str) -> Callable[..., None]:
    def draw(figure: Figure, run: Trajectory, curves: Curves) -> None:
        del curves
        axes = _time_axes(figure, label)
        axes.plot(run.time_s, run.q[:, 0, column], color=colour, label="true")
        if _defined(run.ref_q[:, 0, column]):
            axes.plot(run.time_s, run.ref_q[:, 0, column], **REFERENCE, label="reference")
        _legend(figure)

    return draw


def _draw_wheel_speeds(figure: Figure, run: Trajectory, curves: Curves) -> None:
    del curves
    axes = _time_axes(figure, "wheel speed [rad/s]")
    for wheel, (name, colour) in enumerate((("right", RIGHT), ("left", LEFT))):
        command, speed = run.wheel_command_rad_s[:, 0, wheel], run.wheel_speed_rad_s[:, 0, wheel]
        axes.step(
            run.time_s,
            command,
            where="post",
            color=colour,
            alpha=0.35,
            linewidth=3.0,
            label=f"{name}, commanded",
        )
        axes.plot(run.time_s, speed, color=colour, linewidth=1.0, label=f"{name}, real")
    _legend(figure, columns=2)


def _draw_errors(figure: Figure, run: Trajectory, curves: Curves) -> None:
    panels = [
        ("P error\n[mm]", 1e3 * curves.tractor_error_m[:, 0], TRACTOR),
        ("θ1 error\n[°]", np.degrees(curves.theta_error_rad[:, 0, 0]), TRACTOR),
        ("trailer COM\nerror [mm]", 1e3 * curves.trailer_error_m[:, 0], TRAILER),
    ]
    panels = [panel for panel in panels if _defined(panel[1])]
    if not panels:
        figure.text(0.5, 0.5, "the run has no reference", ha="center", va="center")
        return
    figure.set_size_inches(4.8, 0.6 + 1.4 * len(panels))
    rows = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for axes, (label, error, colour) in zip(rows, panels, strict=True):
        axes.plot(run.time_s, error, color=colour)
        axes.set_ylabel(label)
        axes.margins(x=0.01)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()


def _draw_hitch_angle(figure: Figure, run: Trajectory, curves: Curves) -> None:
    axes = _time_axes(figure, "hitch angle θ2 − θ1 [°]")
    axes.plot(run.time_s, np.degrees(curves.hitch_angle_rad[:, 0]), color=TRAILER)


FIGURES: dict[str, Callable[[Figure, Trajectory, Curves], None]] = {
    "paths": _draw_paths,
    "x": _draw_coordinate(0, "x of P [m]", TRACTOR),
    "y": _draw_coordinate(1, "y of P [m]", TRACTOR),
    "theta1": _draw_coordinate(2, "θ1 of the tractor [rad]", TRACTOR),
    "theta2": _draw_coordinate(3, "θ2 of the trailer [rad]", TRAILER),
    "wheel_speeds": _draw_wheel_speeds,
    "errors": _draw_errors,
    "hitch_angle": _draw_hitch_angle,
}


def _time_axes(figure: Figure, label: str) -> Axes:
    axes = figure.subplots()
    axes.set(xlabel="time [s]", ylabel=label)
    axes.margins(x=0.01)
    return axes


def _legend(figure: Figure, columns: int = 3) -> None:
    """Names below the axes, where they hide nothing."""
    figure.legend(loc="outside lower center", ncols=columns)


def _defined(values: FloatArray) -> bool:
    """Whether there is anything to draw: any finite value."""
    return bool(np.isfinite(values).any())
