"""Which of many candidates are the robot's labels: those that stand to each other as on the robot.

A stray disc of a label's colour passes every test of colour and size; distances it fails.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice, product

import numpy as np

from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import COUNT, LabelLayout
from ttwmr_mj.vision.tracking.detection import Candidates
from ttwmr_mj.vision.tracking.pose import MIN_LABELS, LabelPose, solve_pose

DISTANCE_TOLERANCE_M = 0.006  # between two labels of one half
RESIDUAL_TOLERANCE_M = 0.003  # of the whole set against a pose; a label's noise is 0.1 mm
MAX_SETS = 64  # examined for one frame
Pair = tuple[int, int]  # candidates of a half's front and rear label; −1 for none
PAIRS = ((0, 1), (2, 3))  # the labels of each half


def choose(
    candidates: Candidates, points_m: FloatArray, layout: LabelLayout
) -> tuple[LabelPose, FloatArray] | None:
    """The set of candidates that is the robot.

    Args:
        candidates: what the detector found, n blobs.
        points_m: (n, 2) their x, y at the height of their label.
        layout: the labels on the robot.

    Returns:
        The pose, and (4,) the index of each label's candidate, −1 without; None where no set of at
        least three fits. More labels win, then the smaller residual.
    """
    pairs = [_pairs(candidates, points_m, layout, half) for half in (0, 1)]
    singles = [
        [(int(i), -1) for i in np.flatnonzero(candidates.label == front)]
        + [(-1, int(i)) for i in np.flatnonzero(candidates.label == rear)]
        for front, rear in PAIRS
    ]
    full = product(pairs[0], pairs[1])
    best = _best(full, points_m, layout)
    if best is None:
        partial = [*product(pairs[0], singles[1]), *product(singles[0], pairs[1])]
        best = _best(partial, points_m, layout)
    return best


def _pairs(
    candidates: Candidates, points_m: FloatArray, layout: LabelLayout, half: int
) -> list[Pair]:
    """Candidates of a half's two labels that are as far apart as the labels."""
    front, rear = PAIRS[half]
    apart = float(np.linalg.norm(layout.offset_m[front] - layout.offset_m[rear]))
    fronts = np.flatnonzero(candidates.label == front)
    rears = np.flatnonzero(candidates.label == rear)
    gap = np.linalg.norm(points_m[fronts, None] - points_m[None, rears], axis=-1)
    rows, columns = np.nonzero(np.abs(gap - apart) < DISTANCE_TOLERANCE_M)
    return [(int(i), int(j)) for i, j in zip(fronts[rows], rears[columns], strict=True)]


def _best(
    sets: Iterable[tuple[Pair, Pair]], points_m: FloatArray, layout: LabelLayout
) -> tuple[LabelPose, FloatArray] | None:
    best: tuple[LabelPose, FloatArray] | None = None
    for tractor, trailer in islice(sets, MAX_SETS):
        index = np.array([*tractor, *trailer])
        if (index >= 0).sum() < MIN_LABELS:
            continue
        chosen = np.full((COUNT, 2), np.nan)
        chosen[index >= 0] = points_m[index[index >= 0]]
        pose = solve_pose(chosen, layout)
        if pose is None or pose.residual_m > RESIDUAL_TOLERANCE_M:
            continue
        if best is None or pose.residual_m < best[0].residual_m:
            best = pose, index
    return best
