"""The floor of the laboratory: a light plate with a grid, under the whole reference."""

import numpy as np
import rerun as rr

from ttwmr_mj.recording import style
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import FloatArray

LAB_CORNERS_M = np.array([[-0.95, -0.71], [0.95, 0.71]])  # what the overhead camera sees
MARGIN_M = 0.4
GRID_M = 0.1
MOST_LINES = 1000  # of the grid in each direction; on a larger floor they lie further apart
# What lies on the floor lies apart, else it flickers through each other.
GRID_HEIGHT_M, PLACE_HEIGHT_M, BAND_HEIGHT_M, BORDER_HEIGHT_M = 3e-4, 8e-4, 1.2e-3, 1.6e-3
TRAILER_HEIGHT_M, TRACTOR_HEIGHT_M = 2.1e-3, 2.6e-3  # of the driven paths


def floor_corners(reference: ReferencePath | None) -> FloatArray:
    """(2, 2) lower and upper corner [m] of a floor under the reference, at least the lab's."""
    low, high = LAB_CORNERS_M
    if reference is not None:
        path = reference.position_m[:, 0]
        low = np.minimum(low, path.min(axis=0) - MARGIN_M)
        high = np.maximum(high, path.max(axis=0) + MARGIN_M)
    return np.stack([low, high])


def floor_shapes(corners_m: FloatArray) -> tuple[rr.Boxes3D, rr.LineStrips3D]:
    """A thin plate, its top at z = 0, and a line on it every `GRID_M`, or every 10, 100 or more."""
    low, high = corners_m
    larger = float((high - low).max()) / (GRID_M * MOST_LINES)
    apart = GRID_M * 10.0 ** max(np.ceil(np.log10(larger)), 0.0)
    plate = rr.Boxes3D(
        mins=[[*low, -0.01]], sizes=[[*(high - low), 0.01]], colors=[style.FLOOR], fill_mode="solid"
    )
    xs, ys = (np.arange(np.ceil(low[i] / apart), high[i] / apart) * apart for i in range(2))
    lines = [[(x, low[1]), (x, high[1])] for x in xs] + [[(low[0], y), (high[0], y)] for y in ys]
    grid = rr.LineStrips3D(
        [lift(np.array(line), GRID_HEIGHT_M) for line in lines],
        colors=[style.GRID],
        radii=rr.Radius.ui_points([0.5]),
    )
    return plate, grid


def lift(points_m: FloatArray, height_m: float) -> FloatArray:
    """(n, 3) points at a height over the floor, from (n, 2)."""
    return np.column_stack([points_m, np.full(len(points_m), height_m)])
