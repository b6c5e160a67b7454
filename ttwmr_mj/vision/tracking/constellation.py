"""Which of many candidates are the robot's labels: those that stand to each other as on the robot.

A stray disc of a label's colour passes every test of colour and size; distances it fails.
"""

from collections.abc import Iterable, Sequence
from itertools import islice, product
from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.tracking.detection import Candidates
from ttwmr_mj.vision.tracking.pose import LabelPose, solve_pose

DISTANCE_TOLERANCE_M = 0.006  # between two labels of one body
RESIDUAL_TOLERANCE_M = 0.003  # of the whole set against a pose; a label's noise is 0.1 mm
MAX_SETS = 64  # examined for one frame and every body that is added
KEPT_SETS = 8  # of those that fit so far
Pair = tuple[int, int]  # candidates of a body's front and rear label; −1 for none


class Fit(NamedTuple):
    """A set of candidates that stand to each other as the first bodies' labels."""

    pose: LabelPose
    candidates: tuple[int, ...]  # each label's candidate, −1 without


def choose(
    candidates: Candidates, points_m: FloatArray, layout: LabelLayout
) -> tuple[LabelPose, FloatArray] | None:
    """The set of candidates that is the robot.

    Sets grow body by body from the tractor, whose hues no trailer has: a trailer hangs on the hitch
    of what tows it, so no other trailer's labels fit in its place.

    Args:
        candidates: what the detector found, n blobs.
        points_m: (n, 2) their x, y at the height of their label.
        layout: the labels on the robot.

    Returns:
        The pose, and (labels,) the index of each label's candidate, −1 without; None where no set
        fits that lacks at most one. More labels win, then the smaller residual.
    """
    bodies = range(1 + layout.trailers)
    whole, single = zip(
        *(_pairs(candidates, points_m, layout, body) for body in bodies), strict=True
    )
    lacking = ([*whole[:i], single[i], *whole[i + 1 :]] for i in reversed(bodies))
    fits = _grown(whole, points_m, layout) or [
        fit for choice in lacking for fit in _grown(choice, points_m, layout)
    ]
    best = min(fits, key=lambda fit: fit.pose.residual_m, default=None)
    return None if best is None else (best.pose, np.array(best.candidates))


def _pairs(
    candidates: Candidates, points_m: FloatArray, layout: LabelLayout, body: int
) -> tuple[list[Pair], list[Pair]]:
    """Candidates of a body's two labels as far apart as the labels, and candidates of one alone."""
    front, rear = np.flatnonzero(layout.body == body)
    fronts = np.flatnonzero(candidates.hue == layout.hue[front]).tolist()
    rears = np.flatnonzero(candidates.hue == layout.hue[rear]).tolist()
    apart = np.linalg.norm(layout.offset_m[front] - layout.offset_m[rear])
    pairs = [
        (i, j)
        for i, j in product(fronts, rears)
        if abs(np.linalg.norm(points_m[i] - points_m[j]) - apart) < DISTANCE_TOLERANCE_M
    ]
    return pairs, [*((i, -1) for i in fronts), *((-1, j) for j in rears)]


def _grown(choice: Sequence[list[Pair]], points_m: FloatArray, layout: LabelLayout) -> list[Fit]:
    """The sets that fit, of one pair of every body."""
    sets: Iterable[tuple[int, ...]] = choice[0]
    fits: list[Fit] = []
    for bodies, pairs in enumerate(choice[1:], start=2):
        known = layout.first(bodies)
        tried = ((*front, *pair) for front, pair in product(sets, pairs))
        fits = [
            fit
            for index in islice(tried, MAX_SETS)
            if len(set(index) - {-1}) == len(index) - index.count(-1)
            and (fit := _fit(index, points_m, known)) is not None
        ]
        fits = sorted(fits, key=lambda fit: fit.pose.residual_m)[:KEPT_SETS]
        sets = [fit.candidates for fit in fits]
    return fits


def _fit(index: tuple[int, ...], points_m: FloatArray, layout: LabelLayout) -> Fit | None:
    who = np.array(index)
    chosen = np.full((layout.count, 2), np.nan)
    chosen[who >= 0] = points_m[who[who >= 0]]
    pose = solve_pose(chosen, layout)
    fits = pose is not None and pose.residual_m <= RESIDUAL_TOLERANCE_M
    return Fit(pose, index) if pose is not None and fits else None
