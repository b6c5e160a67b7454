"""The robot's pose from the labels of one frame: its bodies share their hitches.

Least squares over q with the labels' places on the bodies as known. Two labels of one body and one
of every other are enough.
"""

from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import THETA1, BoolArray, FloatArray
from ttwmr_mj.vision.camera.labels import LabelLayout

AHEAD: FloatArray = np.array([1.0, 0.0])
ITERATIONS = 3  # Gauss-Newton from a start that is exact without noise


class LabelPose(NamedTuple):
    """A pose read from labels."""

    q: FloatArray  # (3 + n,) x, y [m], θ1, θ2, … [rad] in (−π, π]
    residual_m: float  # root mean square distance between labels found and where the pose puts them


def solve_pose(points_m: FloatArray, layout: LabelLayout) -> LabelPose | None:
    """The pose that explains label centres best.

    Args:
        points_m: (labels, 2) x, y of the labels at their height; NaN where not found.
        layout: the labels on the robot.

    Returns:
        None unless all bodies show a label, and one of them both.
    """
    found = np.isfinite(points_m[:, 0])
    shown = np.bincount(layout.body[found], minlength=1 + layout.trailers)
    if shown.min() < 1 or shown.max() < 2:
        return None
    q = _start(points_m, found, layout)
    seen = points_m[found].ravel()
    rows = np.repeat(found, 2)
    for _ in range(ITERATIONS):
        jacobian = layout.jacobian(q)[rows]
        residual = seen - layout.centres_m(q)[found, :2].ravel()
        step, *_ = np.linalg.lstsq(jacobian, residual, rcond=None)
        q = q + step
    residual = seen - layout.centres_m(q)[found, :2].ravel()
    q[THETA1:] = np.arctan2(np.sin(q[THETA1:]), np.cos(q[THETA1:]))
    return LabelPose(q, float(np.sqrt(residual @ residual / found.sum())))


def _start(points_m: FloatArray, found: BoolArray, layout: LabelLayout) -> FloatArray:
    """A first pose: bodies with two labels place their hitches, and hitches the other bodies."""
    angle = np.zeros(1 + layout.trailers)
    # where bodies see hitch i, which joins body i and body i + 1; hitch 0 is P
    pins: list[list[FloatArray]] = [[] for _ in range(layout.trailers)]
    pending = []
    for body in range(len(angle)):
        labels = np.flatnonzero(found & (body == layout.body))
        if len(labels) < 2:
            pending.append(body)
            continue
        front, rear = labels
        angle[body] = _direction(points_m[front] - points_m[rear]) - _direction(
            layout.offset_m[front] - layout.offset_m[rear]
        )
        offset = layout.offset_m[labels].mean(axis=0)
        origin = points_m[labels].mean(axis=0) - _rotated(offset, angle[body])
        for hitch, x in _hitches(body, layout):
            pins[hitch].append(origin + x * _rotated(AHEAD, angle[body]))
    while pending:
        body, hitch, x = next(
            (body, hitch, x)
            for body in pending
            for hitch, x in _hitches(body, layout)
            if pins[hitch]
        )
        pending.remove(body)
        (label,) = np.flatnonzero(found & (body == layout.body))
        pivot = np.mean(pins[hitch], axis=0)
        arm = layout.offset_m[label] - x * AHEAD
        angle[body] = _direction(points_m[label] - pivot) - _direction(arm)
        for other, further in _hitches(body, layout):
            if other != hitch:
                pins[other].append(pivot + (further - x) * _rotated(AHEAD, angle[body]))
    return np.concatenate([np.mean(pins[0], axis=0), angle])


def _hitches(body: int, layout: LabelLayout) -> list[tuple[int, float]]:
    """The hitches of a body, each with its x in the body's frame."""
    if body == 0:
        return [(0, 0.0)]
    rear = [(body, -float(layout.reach_m[body - 1]))] if body < layout.trailers else []
    return [(body - 1, 0.0), *rear]


def _direction(vector: FloatArray) -> float:
    return float(np.arctan2(vector[1], vector[0]))


def _rotated(vector: FloatArray, angle_rad: float) -> FloatArray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])
