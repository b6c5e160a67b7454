"""The robot seen from above, at a few times along its way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.figures import style
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_silhouettes(axes: Axes, q: FloatArray, robot: RobotParameters) -> None:
    """The robot at poses (n, 3 + trailers), later ones darker."""
    from ttwmr_mj.plants.model.contact_options import ContactOptions
    from ttwmr_mj.plants.model.mjcf import build_model
    from ttwmr_mj.plants.model.outline import silhouettes

    shapes = silhouettes(build_model(robot, ContactOptions()), q)
    shades = np.linspace(0.25, 0.75, len(q))
    for name, corners in shapes.items():
        colour = style.TRACTOR if name == "tractor" else style.TRAILER
        for shade, corner in zip(shades, corners, strict=True):
            axes.fill(*corner.T, color=colour, alpha=shade, linewidth=0.4, zorder=3)


def draw_direction(axes: Axes, path: FloatArray, length_m: float = 0.12) -> None:
    """An arrow head on the path (n, 2), a little ahead of its start."""
    gone = np.hypot(*(path - path[0]).T)
    ahead = np.flatnonzero(gone > length_m)
    if ahead.size:
        at = int(ahead[0])
        axes.annotate(
            "",
            xy=path[at],
            xytext=path[max(at - max(at // 8, 1), 0)],
            arrowprops={"arrowstyle": "-|>", "color": style.TRACTOR, "linewidth": 1.1},
        )


def last_round(points_m: FloatArray) -> int:
    """The row from which a path (n, 2) goes its last round: so long a way as around its ellipse."""
    along = _along(points_m)
    round_m = 0.5 * np.pi * float(np.ptp(points_m, axis=0).sum())  # exact for a circle
    return int(np.searchsorted(along, max(0.0, along[-1] - round_m)))


def apart(points_m: FloatArray, count: int) -> FloatArray:
    """Rows that split a path (n, 2) into pieces of equal length, its first and last among them."""
    along = _along(points_m)
    rows = np.searchsorted(along, np.linspace(0.0, along[-1], count))
    return np.asarray(np.minimum(rows, len(points_m) - 1))


def _along(points_m: FloatArray) -> FloatArray:
    """(n,) the way along a path (n, 2) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points_m, axis=0).T))])
