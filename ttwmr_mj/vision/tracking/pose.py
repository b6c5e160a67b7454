"""The robot's pose from the labels of one frame: both halves share P.

Least squares over x, y, θ1, θ2 with the labels' places on the halves as known. Two labels of one
half and one of the other are enough.
"""

from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import THETA1, BoolArray, FloatArray
from ttwmr_mj.vision.camera.labels import BODY, COUNT, TRACTOR, TRAILER, LabelLayout

ITERATIONS = 3  # Gauss-Newton from a start that is exact without noise
MIN_LABELS = 3  # six numbers for the four of q


class LabelPose(NamedTuple):
    """A pose read from labels."""

    q: FloatArray  # (4,) x, y [m], θ1, θ2 [rad] in (−π, π]
    residual_m: float  # root mean square distance between labels found and where the pose puts them


def solve_pose(points_m: FloatArray, layout: LabelLayout) -> LabelPose | None:
    """The pose that explains label centres best.

    Args:
        points_m: (4, 2) x, y of the labels at their height; NaN where not found.
        layout: the labels on the robot.

    Returns:
        None with fewer than three labels: two of one half and one of the other.
    """
    found = np.isfinite(points_m[:, 0])
    if found.sum() < MIN_LABELS:
        return None
    q = _start(points_m, found, layout)
    seen = points_m[found].ravel()
    rows = np.repeat(found, 2)
    for _ in range(ITERATIONS):
        jacobian = label_jacobian(q, layout)[rows]
        residual = seen - layout.centres_m(q)[found, :2].ravel()
        step, *_ = np.linalg.lstsq(jacobian, residual, rcond=None)
        q = q + step
    residual = seen - layout.centres_m(q)[found, :2].ravel()
    q[THETA1:] = np.arctan2(np.sin(q[THETA1:]), np.cos(q[THETA1:]))
    return LabelPose(q, float(np.sqrt(residual @ residual / found.sum())))


def label_jacobian(q: FloatArray, layout: LabelLayout) -> FloatArray:
    """(8, 4) derivatives of the labels' x, y, label after label, by q (4,)."""
    jacobian = np.zeros((2 * COUNT, 4))
    jacobian[0::2, 0] = jacobian[1::2, 1] = 1.0
    cos, sin = np.cos(q[THETA1:])[BODY], np.sin(q[THETA1:])[BODY]
    x, y = layout.offset_m.T
    rows = np.arange(COUNT)
    jacobian[2 * rows, THETA1 + BODY] = -sin * x - cos * y
    jacobian[2 * rows + 1, THETA1 + BODY] = cos * x - sin * y
    return jacobian


def _start(points_m: FloatArray, found: BoolArray, layout: LabelLayout) -> FloatArray:
    """A first pose from the halves with two labels, completed by the others."""
    halves = [np.flatnonzero(found & (half == BODY)) for half in (TRACTOR, TRAILER)]
    angle = np.zeros(2)
    origins = []
    for half, labels in enumerate(halves):
        if len(labels) == 2:
            front, rear = labels
            angle[half] = _direction(points_m[front] - points_m[rear]) - _direction(
                layout.offset_m[front] - layout.offset_m[rear]
            )
            offset = layout.offset_m[labels].mean(axis=0)
            origins.append(points_m[labels].mean(axis=0) - _rotated(offset, angle[half]))
    origin = np.mean(origins, axis=0)
    for half, labels in enumerate(halves):
        if len(labels) == 1:
            label = int(labels[0])
            angle[half] = _direction(points_m[label] - origin) - _direction(layout.offset_m[label])
    return np.concatenate([origin, angle])


def _direction(vector: FloatArray) -> float:
    return float(np.arctan2(vector[1], vector[0]))


def _rotated(vector: FloatArray, angle_rad: float) -> FloatArray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])
