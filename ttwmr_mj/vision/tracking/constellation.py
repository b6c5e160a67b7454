"""Which of many candidates are the robot's labels: those that stand to each other as on the robot.

A stray disc of a label's colour passes every test of colour and size; distances it fails.
"""

from collections.abc import Iterable
from itertools import islice, product

import numpy as np

from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import COUNT, LabelLayout
from ttwmr_mj.vision.tracking.detection import Candidates
from ttwmr_mj.vision.tracking.pose import LabelPose, solve_pose

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
    (pairs, singles), (trailer_pairs, trailer_singles) = (
        _halves(candidates, points_m, layout, *labels) for labels in PAIRS
    )
    partial = [*product(pairs, trailer_singles), *product(singles, trailer_pairs)]
    return _best(product(pairs, trailer_pairs), points_m, layout) or _best(
        partial, points_m, layout
    )


def _halves(
    candidates: Candidates, points_m: FloatArray, layout: LabelLayout, front: int, rear: int
) -> tuple[list[Pair], list[Pair]]:
    """Candidates of a half's two labels as far apart as the labels, and candidates of one alone."""
    fronts = np.flatnonzero(candidates.label == front).tolist()
    rears = np.flatnonzero(candidates.label == rear).tolist()
    apart = np.linalg.norm(layout.offset_m[front] - layout.offset_m[rear])
    pairs = [
        (i, j)
        for i, j in product(fronts, rears)
        if abs(np.linalg.norm(points_m[i] - points_m[j]) - apart) < DISTANCE_TOLERANCE_M
    ]
    return pairs, [*((i, -1) for i in fronts), *((-1, j) for j in rears)]


def _best(
    sets: Iterable[tuple[Pair, ...]], points_m: FloatArray, layout: LabelLayout
) -> tuple[LabelPose, FloatArray] | None:
    fits = []
    for tractor, trailer in islice(sets, MAX_SETS):
        index = np.array([*tractor, *trailer])
        chosen = np.full((COUNT, 2), np.nan)
        chosen[index >= 0] = points_m[index[index >= 0]]
        pose = solve_pose(chosen, layout)
        if pose is not None and pose.residual_m <= RESIDUAL_TOLERANCE_M:
            fits.append((pose, index))
    return min(fits, key=lambda fit: fit[0].residual_m, default=None)
