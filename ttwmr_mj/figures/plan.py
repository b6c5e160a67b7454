"""A plan in one figure: the way of tractor and trailer, and how near it comes to its limits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.dynamics.kinematics import wheels_from_twist, workspace_rate
from ttwmr_mj.figures import style
from ttwmr_mj.figures.canvas import canvas, save
from ttwmr_mj.figures.silhouettes import apart, draw_direction, draw_silhouettes
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.curves import centre_of_oscillation
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE_IN = (5.0, 6.6)
POSES = 9
DASHES = ("-", "--", "-.", ":", (0, (1, 3)))  # of hitches, front to back


def write_plan_figure(
    path: Path,
    reference: ReferencePath,
    robot: RobotParameters,
    points_m: FloatArray,
    limits: Mapping[str, float],
    title: str,
) -> Path:
    """Draw it as .png, .svg or .pdf.

    Args:
        path: of the file.
        reference: the plan's motion, sampled evenly over one round or from start to end.
        robot: that it is for.
        points_m: (m, 2) that P passes through.
        limits: "wheel speed" [rad/s] and "hitch angle" [rad] that the plan may use.
        title: of the figure.
    """
    with canvas(SIZE_IN) as figure:
        grid = figure.add_gridspec(3, 1, height_ratios=[4.2, 1.0, 1.0])
        way = figure.add_subplot(grid[0])
        _draw_way(way, reference, robot, points_m)
        wheels = figure.add_subplot(grid[1])
        hitch = figure.add_subplot(grid[2], sharex=wheels)
        _draw_wheels(wheels, reference, robot, limits["wheel speed"])
        _draw_hitch(hitch, reference, limits["hitch angle"])
        _head(figure, way, title)
        return save(figure, path)


def _draw_way(
    axes: Axes, reference: ReferencePath, robot: RobotParameters, points_m: FloatArray
) -> None:
    q = reference.q[:, 0]
    axes.plot(*q[:, :2].T, color=style.TRACTOR, label="tractor (P)")
    axes.plot(*centre_of_oscillation(q, robot).T, color=style.TRAILER, label="trailer (F)")
    rows = np.unique(apart(q[:, :2], POSES))
    draw_silhouettes(axes, q[rows], robot)
    for row in rows[:-1]:
        draw_direction(axes, q[row:, :2])
    axes.plot(*points_m.T, "o", color=style.INK, markersize=4, zorder=5, label="points")
    for i, point in enumerate(points_m, start=1):
        axes.annotate(
            str(i), point, xytext=(5, 4), textcoords="offset points", zorder=6, weight="bold"
        )
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _draw_wheels(
    axes: Axes, reference: ReferencePath, robot: RobotParameters, limit: float
) -> None:
    twist = workspace_rate(reference.q, reference.q_rate)[..., :2]
    speeds = wheels_from_twist(twist, robot)[:, 0]
    for name, colour, values in zip(
        ("right", "left"), (style.RIGHT, style.LEFT), speeds.T, strict=True
    ):
        axes.plot(reference.time_s, values, color=colour, label=name)
    _limits(axes, limit, float(speeds.min()))
    axes.set_ylabel("wheels [rad/s]")
    axes.tick_params(labelbottom=False)
    axes.margins(x=0.01)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.05), borderaxespad=0.2)


def _draw_hitch(axes: Axes, reference: ReferencePath, limit: float) -> None:
    angle = np.degrees(np.diff(reference.theta[:, 0], axis=-1))
    for i, (values, dash) in enumerate(zip(angle.T, DASHES, strict=False), start=1):
        label = f"θ{i + 1} − θ{i}"
        axes.plot(reference.time_s, values, color=style.HITCH, linestyle=dash, label=label)
    _limits(axes, float(np.degrees(limit)), float(angle.min()))
    axes.set(xlabel="time [s]", ylabel="hitch [°]")
    axes.margins(x=0.01)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.05), borderaxespad=0.2)


def _limits(axes: Axes, limit: float, least: float) -> None:
    """The limit, and its negative where the values come near it."""
    for i, side in enumerate([limit] if least > -0.2 * limit else [limit, -limit]):
        axes.axhline(
            side, color=style.GREY, linestyle=(0, (4, 2)), label=None if i else "plan's limit"
        )


def _head(figure: Figure, way: Axes, title: str) -> None:
    figure.suptitle(title, weight="bold")
    way.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, borderaxespad=0.2)
