"""The plots of a run that the article shows of its own, one quantity each, PNG and SVG."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.figures import style
from ttwmr_mj.figures.canvas import legend_below, stacked, time_axes, write_figures
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_run_figures(
    trajectory: Trajectory, robot: RobotParameters, folder: Path, title: str
) -> list[Path]:
    """Draw paths, x, y, θ1, θ2, wheel speeds, errors, hitch angle and the law's signals.

    The same trajectory gives the same bytes. A file is there whole or not at all.

    Args:
        trajectory: one simulation; what its reference leaves undefined is not drawn.
        robot: its trailer says where the COM is.
        folder: where the files go; made if missing.
        title: of every figure.

    Returns:
        The files written, NAME.png (150 dpi) and NAME.svg for each figure.

    Raises:
        InputError: the trajectory is of several simulations.
        OSError: the folder or a file cannot be written.
    """
    run = trajectory.simulation()
    curves = Curves.of(run, robot)
    drawings = {name: partial(draw, run=run, curves=curves) for name, draw in FIGURES.items()}
    if run.signals:
        drawings["signals"] = partial(_draw_signals, run=run)
    return write_figures(drawings, folder, title)


def _draw_paths(figure: Figure, run: Trajectory, curves: Curves) -> None:
    figure.set_size_inches(style.PATHS_SIZE_IN)
    axes = figure.subplots()
    p, com = run.q[:, 0, :2], curves.trailer_com_m[:, 0]
    axes.plot(*p.T, color=style.TRACTOR, label="P (tractor)")
    axes.plot(*com.T, color=style.TRAILER, label="COM of the trailer")
    for reference, label in (
        (run.ref_q[:, 0, :2], "references"),
        (curves.ref_trailer_com_m[:, 0], None),
    ):
        if _defined(reference):
            axes.plot(*reference.T, **style.BAND, label=label)
    for start, colour in ((p[0], style.TRACTOR), (com[0], style.TRAILER)):
        axes.plot(*start, "o", color=colour, markeredgecolor="white", markersize=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    legend_below(figure)


def _draw_coordinate(column: int, label: str, colour: str) -> Callable[..., None]:
    def draw(figure: Figure, run: Trajectory, curves: Curves) -> None:
        del curves
        axes = time_axes(figure, label)
        axes.plot(run.time_s, run.q[:, 0, column], color=colour, label="true")
        if _defined(run.ref_q[:, 0, column]):
            axes.plot(run.time_s, run.ref_q[:, 0, column], **style.BAND, label="reference")
        legend_below(figure)

    return draw


def _draw_wheel_speeds(figure: Figure, run: Trajectory, curves: Curves) -> None:
    del curves
    axes = time_axes(figure, "wheel speed [rad/s]")
    # commands as wide pale steps under the thin line of what happened
    command: dict[str, Any] = {"where": "post", "alpha": 0.35, "linewidth": 3.0}
    for wheel, (name, colour) in enumerate((("right", style.RIGHT), ("left", style.LEFT))):
        wanted, speed = run.wheel_command_rad_s[:, 0, wheel], run.wheel_speed_rad_s[:, 0, wheel]
        axes.step(run.time_s, wanted, color=colour, label=f"{name}, commanded", **command)
        axes.plot(run.time_s, speed, color=colour, linewidth=1.0, label=f"{name}, real")
    legend_below(figure, columns=2)


def _draw_errors(figure: Figure, run: Trajectory, curves: Curves) -> None:
    panels = [
        ("P error\n[mm]", 1e3 * curves.tractor_error_m[:, 0], style.TRACTOR),
        ("θ1 error\n[°]", np.degrees(curves.theta_error_rad[:, 0, 0]), style.TRACTOR),
        ("trailer COM\nerror [mm]", 1e3 * curves.trailer_error_m[:, 0], style.TRAILER),
    ]
    panels = [panel for panel in panels if _defined(panel[1])]
    if not panels:
        figure.text(0.5, 0.5, "the run has no reference", ha="center", va="center")
        return
    _stacked(figure, run, panels)


def _draw_hitch_angle(figure: Figure, run: Trajectory, curves: Curves) -> None:
    axes = time_axes(figure, "hitch angle θ2 − θ1 [°]")
    axes.plot(run.time_s, np.degrees(curves.hitch_angle_rad[:, 0]), color=style.TRAILER)


def _draw_signals(figure: Figure, run: Trajectory) -> None:
    panels = [(name, values[:, 0], style.TRACTOR) for name, values in run.signals.items()]
    _stacked(figure, run, panels)
    for axes in figure.axes:  # names too long to stand upright beside a panel
        axes.set_title(axes.get_ylabel(), loc="left")
        axes.set_ylabel("")


FIGURES: dict[str, Callable[..., None]] = {
    "paths": _draw_paths,
    "x": _draw_coordinate(0, "x of P [m]", style.TRACTOR),
    "y": _draw_coordinate(1, "y of P [m]", style.TRACTOR),
    "theta1": _draw_coordinate(2, "θ1 of the tractor [rad]", style.TRACTOR),
    "theta2": _draw_coordinate(3, "θ2 of the trailer [rad]", style.TRAILER),
    "wheel_speeds": _draw_wheel_speeds,
    "errors": _draw_errors,
    "hitch_angle": _draw_hitch_angle,
}


def _stacked(figure: Figure, run: Trajectory, panels: list[tuple[str, FloatArray, str]]) -> None:
    """Curves one below the other, in a figure as high as they need."""
    figure.set_size_inches(style.SIZE_IN[0], 0.6 + 1.4 * len(panels))
    stacked(figure, run.time_s, panels)


def _defined(values: FloatArray) -> bool:
    """Whether there is anything to draw: any finite value."""
    return bool(np.isfinite(values).any())
