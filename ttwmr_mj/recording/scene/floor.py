"""The floor of the laboratory: a light plate with a grid, under the whole reference."""

import numpy as np
import rerun as rr

from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.recording import style
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import FloatArray

LAB_CORNERS_M = np.array([[-0.95, -0.71], [0.95, 0.71]])  # what the overhead camera sees
MARGIN_M = 0.4
GRID_M = 0.1
CELL_M = 0.02  # of the mesh that stands for uneven ground
SHADING = 0.35  # of the light, on the steepest slope
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


def relief_shapes(relief: Relief, corners_m: FloatArray) -> tuple[rr.Mesh3D, rr.LineStrips3D]:
    """Uneven ground, shaded by its slope, and the grid's lines laid over it."""
    low, high = corners_m
    xs, ys = (np.arange(low[i], high[i] + 0.5 * CELL_M, CELL_M) for i in range(2))
    x, y = np.meshgrid(xs, ys)
    points = lift(np.column_stack([x.ravel(), y.ravel()]), 0.0, relief)
    height = points[:, 2].reshape(x.shape)
    by_y, by_x = np.gradient(height, CELL_M)
    normals = np.stack([-by_x, -by_y, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    # light from the west, its contrast stretched: slopes of a few per cent show
    shade = np.clip(1.0 - SHADING * by_x / max(float(np.abs(by_x).max()), 1e-9), 0.0, 1.1)
    colours = np.clip(shade[..., None] * np.array(style.FLOOR), 0, 255).astype(np.uint8)
    first = (np.arange(len(ys) - 1)[:, None] * len(xs) + np.arange(len(xs) - 1)).ravel()
    lower = np.column_stack([first, first + 1, first + len(xs)])
    upper = np.column_stack([first + 1, first + len(xs) + 1, first + len(xs)])
    mesh = rr.Mesh3D(
        vertex_positions=points,
        vertex_normals=normals.reshape(-1, 3),
        vertex_colors=colours.reshape(-1, 3),
        triangle_indices=np.vstack([lower, upper]),
    )
    marks = [np.arange(np.ceil(low[i] / GRID_M), high[i] / GRID_M) * GRID_M for i in range(2)]
    lines = [np.column_stack([np.full_like(ys, mark), ys]) for mark in marks[0]]
    lines += [np.column_stack([xs, np.full_like(xs, mark)]) for mark in marks[1]]
    grid = rr.LineStrips3D(
        [lift(line, GRID_HEIGHT_M, relief) for line in lines],
        colors=[style.GRID],
        radii=rr.Radius.ui_points([0.5]),
    )
    return mesh, grid


def lift(points_m: FloatArray, height_m: float, relief: Relief | None = None) -> FloatArray:
    """(n, 3) points at a height over the floor, or over uneven ground, from (n, 2)."""
    height = np.full(len(points_m), height_m)
    if relief is not None and not relief.flat:
        height += relief.at(points_m)
    return np.column_stack([points_m, height])
