"""A run in one figure, for a talk or a column of a paper: paths, errors, angles, wheels."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.figures import style
from ttwmr_mj.figures.canvas import canvas, save
from ttwmr_mj.figures.scales import plain_log
from ttwmr_mj.figures.silhouettes import apart, draw_direction, draw_silhouettes, last_round
from ttwmr_mj.results.curves import Curves, centre_of_oscillation, trailer_com
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, FloatArray, hitch_angles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 85.0 / 25.4  # a column
WIDTH_PX = 1600
PATHS_IN, PANEL_IN, HEAD_IN = 2.6, 1.02, 0.75  # heights
LETTERS = 50  # a line of the title
POSES = 6  # silhouettes along the path
LEAST_ERROR_MM = 1e-3
LOOKS: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "figure.titlesize": 8.0,
    "lines.linewidth": 1.1,
    "axes.linewidth": 0.6,
    "legend.handlelength": 1.2,
    "legend.columnspacing": 0.9,
    "legend.handletextpad": 0.4,
    "pdf.fonttype": 42,  # text stays text
}
Panel = Callable[["Axes", Trajectory, Curves, RobotParameters], None]


def write_summary(
    trajectory: Trajectory, robot: RobotParameters, folder: Path, title: Sequence[str]
) -> list[Path]:
    """Draw summary.png, .svg and .pdf; the same trajectory gives the same bytes.

    Args:
        trajectory: one simulation, of two rows and more.
        robot: the numbers of the robot.
        folder: where the files go.
        title: its lines, the first in bold.

    Returns:
        The files written; each is there whole or not at all.

    Raises:
        InputError: the trajectory is of several simulations.
        OSError: a file cannot be written.
    """
    run = trajectory.simulation()
    curves = Curves.of(run, robot)
    panels = _panels(run, curves)
    height_in = HEAD_IN + PATHS_IN + PANEL_IN * len(panels)
    with canvas((WIDTH_IN, height_in), LOOKS) as figure:
        grid = figure.add_gridspec(
            1 + len(panels), 1, height_ratios=[PATHS_IN, *[PANEL_IN] * len(panels)]
        )
        paths = figure.add_subplot(grid[0])
        _draw_paths(paths, run, curves, robot)
        rows: list[Axes] = []
        for i, draw in enumerate(panels, start=1):
            axes = figure.add_subplot(grid[i], sharex=rows[0] if rows else None)
            draw(axes, run, curves, robot)
            axes.margins(x=0.01)
            axes.tick_params(labelbottom=i == len(panels))
            rows.append(axes)
        rows[-1].set_xlabel("time [s]")
        figure.align_ylabels(rows)
        _head(figure, paths, title)
        figure.draw_without_rendering()  # one layout for all three files
        figure.set_layout_engine("none")
        dpi = WIDTH_PX / WIDTH_IN
        return [save(figure, folder / f"summary{end}", dpi) for end in (".png", ".svg", ".pdf")]


def _panels(run: Trajectory, curves: Curves) -> list[Panel]:
    """Those that have something to show."""
    known = np.isfinite(curves.tractor_error_m).any() or _estimated(run).any()
    return [*([_draw_errors] if known else []), _draw_angles, _draw_wheels]


def _head(figure: Figure, paths: Axes, title: Sequence[str]) -> None:
    bold, *rest = title
    lines = [line for part in rest for line in textwrap.wrap(part, LETTERS)]
    first = textwrap.wrap(bold, LETTERS - 4)
    # the bold lines hold the place of the others below them
    figure.suptitle("\n".join([*first, *lines]), x=0.02, ha="left", color="none", linespacing=1.25)
    handles, names = paths.get_legend_handles_labels()
    paths.legend(
        handles,
        names,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=len(names),
        borderaxespad=0.1,
    )
    line = 8.0 * 1.25 * 1.08 / 72.0 / figure.get_figheight()
    for i, text in enumerate([*first, *lines]):
        weight = "bold" if i < len(first) else "normal"
        figure.text(
            0.02, 1.0 - 0.04 / figure.get_figheight() - i * line, text, weight=weight, va="top"
        )


def _draw_paths(axes: Axes, run: Trajectory, curves: Curves, robot: RobotParameters) -> None:
    name, point, _ = _of_trailer(curves)
    p, trailer = run.q[:, 0, :2], point(run.q, robot)[:, 0]
    for wanted, width in ((run.ref_q[:, 0, :2], 4.0), (point(run.ref_q, robot)[:, 0], 2.5)):
        if np.isfinite(wanted).any():
            first = width == style.BAND["linewidth"]
            axes.plot(
                *wanted.T, **style.BAND | {"linewidth": width}, label="reference" if first else None
            )
    axes.plot(*p.T, color=style.TRACTOR, label="tractor (P)")
    whose = "trailer" if run.q.shape[-1] == THETA2 + 1 else "last trailer"
    axes.plot(*trailer.T, color=style.TRAILER, label=f"{whose} ({name})")
    alive = np.flatnonzero(np.isfinite(run.q[:, 0]).all(axis=1))
    alive = alive[last_round(run.q[alive, 0, :2]) :]  # of several rounds poses would pile up
    rows = alive[np.unique(apart(run.q[alive, 0, :2], POSES))]
    draw_silhouettes(axes, run.q[rows, 0], robot)
    for row in rows[:-1]:
        draw_direction(axes, run.q[row:, 0, :2])
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(axis="x", nbins=5)
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _of_trailer(curves: Curves) -> tuple[str, Callable[..., FloatArray], FloatArray]:
    """The point of the last trailer that the headline is about: its name, place and error."""
    if np.isfinite(curves.oscillation_error_m).any():
        return "F", centre_of_oscillation, curves.oscillation_error_m
    return "COM", trailer_com, curves.trailer_error_m


def _draw_errors(axes: Axes, run: Trajectory, curves: Curves, robot: RobotParameters) -> None:
    del robot
    miss = np.where(_estimated(run), np.hypot(*(run.est_q - run.q)[:, 0, :2].T), np.nan)
    for values, colour, name in (
        (miss, style.GREEN, "estimate of P"),
        (_of_trailer(curves)[2][:, 0], style.TRAILER, None),
        (curves.tractor_error_m[:, 0], style.TRACTOR, None),
    ):
        if np.isfinite(values).any():
            width = 0.6 if name else None
            shown = np.maximum(1e3 * values, LEAST_ERROR_MM)
            axes.plot(run.time_s, shown, color=colour, label=name, linewidth=width)
    axes.set_yscale("log")
    plain_log(axes.yaxis, axes.get_ylim())
    axes.set_ylabel("error [mm]")
    if axes.get_legend_handles_labels()[1]:
        _legend_above(axes)


def _draw_angles(axes: Axes, run: Trajectory, curves: Curves, robot: RobotParameters) -> None:
    """θ2, or of a train how far each hitch is bent: its trailers may point the same way."""
    del curves, robot
    if run.q.shape[-1] == THETA2 + 1:
        names, angles, wanted = ["θ2"], run.q[:, 0, THETA2:], run.ref_q[:, 0, THETA2:]
    else:
        angles, wanted = hitch_angles(run.q[:, 0]), hitch_angles(run.ref_q[:, 0])
        names = [f"θ{i + 2} − θ{i + 1}" for i in range(angles.shape[1])]
    for i, name in enumerate(names):
        if np.isfinite(wanted[:, i]).any():
            axes.plot(run.time_s, wanted[:, i], **style.BAND)
        shade = 1.0 - 0.6 * i / len(names)
        axes.plot(run.time_s, angles[:, i], color=style.TRAILER, alpha=shade, label=name)
    axes.set_ylabel("θ2 [rad]" if len(names) == 1 else "hitches [rad]")
    if len(names) > 1:
        _legend_above(axes)


def _draw_wheels(axes: Axes, run: Trajectory, curves: Curves, robot: RobotParameters) -> None:
    del curves
    speeds, limit = run.wheel_speed_rad_s[:, 0], robot.servo.speed_limit_rad_s
    for wheel, (name, colour) in enumerate((("right", style.RIGHT), ("left", style.LEFT))):
        axes.plot(run.time_s, speeds[:, wheel], color=colour, label=name, linewidth=0.9)
    sides = [limit] if np.nanmin(speeds) > -0.05 * limit else [limit, -limit]
    for i, side in enumerate(sides):
        looks: dict[str, Any] = {"color": style.GREY, "linestyle": (0, (4, 2)), "linewidth": 0.8}
        axes.axhline(side, label=None if i else "limit", **looks)
    axes.set_ylim(bottom=0.0 if len(sides) == 1 and np.nanmin(speeds) >= 0.0 else None)
    axes.set_ylabel("wheels [rad/s]")
    _legend_above(axes)


def _legend_above(axes: Axes) -> None:
    """In one line above a panel, where it covers no curve."""
    handles, names = axes.get_legend_handles_labels()
    axes.legend(
        handles,
        names,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(names),
        borderpad=0.0,
        borderaxespad=0.2,
    )


def _estimated(run: Trajectory) -> Any:
    """(n,) rows at which the law saw something else than the truth."""
    return (run.est_q[:, 0] != run.q[:, 0]).any(axis=1) & np.isfinite(run.est_q[:, 0]).all(axis=1)
