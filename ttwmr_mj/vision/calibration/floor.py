"""A camera's place in the world, from views of a board that lies flat on the floor.

Where it lies at the origin it defines the world, x along its long side and z up; several shots of
it there average out noise. Where it lies elsewhere is solved along with the camera, which one
small board would leave loose in tilt.
"""

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import least_squares

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.board import THICKNESS_M, BoardView
from ttwmr_mj.vision.camera.model import CameraModel

Pose = tuple[FloatArray, FloatArray]  # position (3,) of a board's face and its rotation (3, 3)
# of a view on the floor, times what all views leave over; noise alone reaches 1.5
MOST_MISFIT = 3.0


class Lying(NamedTuple):
    """A view of the board on the floor."""

    view: BoardView
    pose: FloatArray  # (6,) OpenCV's rotation vector and translation, of this view alone
    at_origin: bool  # or anywhere


def place(inner: CameraModel, lying: list[Lying], rms_px: float) -> tuple[CameraModel, float]:
    """The camera's pose in the world of the board at the origin, and what is left over [px].

    Args:
        inner: intrinsics and distortion.
        lying: the views on the floor, those at the origin first: one at least.
        rms_px: what the intrinsics leave over.

    Raises:
        InputError: the views contradict each other; it names those that do not fit the others, or
            where these are most of them, those that do.
    """
    camera, rms, misfit = _solved(inner, lying)
    # no floor and no board is flatter than the board is thick
    board_px = float(inner.focal_px.mean() * THICKNESS_M / np.linalg.norm(lying[0].pose[3:]))
    most_px = max(MOST_MISFIT * rms_px, board_px)
    if misfit.max() <= most_px:
        return camera, rms
    alike = _alike(inner, lying, most_px)
    names = [one.view.picture or "a view" for one in lying]
    if 2 * len(alike) >= len(lying):
        unlike = (name for i, name in enumerate(names) if i not in alike)
        others = f"they agree without {', '.join(unlike)}"
    elif len(alike) > 1:
        others = f"only {', '.join(names[i] for i in alike)} agree with each other"
    else:
        others = "none agrees with the rest"
    raise InputError.at(
        "calibration",
        f"the pictures of the floor contradict each other, one by {misfit.max():.1f} px; {others}",
        allowed=f"at most {most_px:.1f} px",
        hint="in origin/ it lies at one place, turned one way, and in flat/ flat on the floor; "
        "take the picture again, or move it to held/",
    )


def _alike(inner: CameraModel, lying: list[Lying], most_px: float) -> list[int]:
    """Which views agree, as many as are found, one at the origin among them; or none.

    Those at the origin are compared with each other, and each of the others with them: one
    solution of all spreads what is wrong in one over the rest.
    """

    def misfit(chosen: list[int]) -> FloatArray:
        return _solved(inner, [lying[i] for i in chosen])[2]

    origin = [i for i, one in enumerate(lying) if one.at_origin]
    fits = [[j for j in origin if _apart(inner, lying[i], lying[j]) <= most_px] for i in origin]
    most = max(map(len, fits))
    same = [one for i, one in enumerate(fits) if len(one) == most and one not in fits[:i]]
    alike = same[0]
    if 2 * most >= len(origin):  # otherwise no floor is known
        elsewhere = range(len(origin), len(lying))
        for one in same[:2]:  # halves
            flat = [i for i in elsewhere if misfit([*one, i]).max() <= most_px]
            alike = max(alike, [*one, *flat], key=len)
    while any(i in origin for i in alike):
        left_px = misfit(alike)
        if left_px.max() <= most_px:
            return alike
        alike = [i for i in alike if i != alike[int(left_px.argmax())]]
    return []


def _apart(inner: CameraModel, one: Lying, other: Lying) -> float:
    """By how much [px, rms] a board where the one lies is not what the other view shows."""
    points = np.insert(other.view.points_m, 2, 0.0, axis=1)
    error = _at(inner, one.pose).project(points) - other.view.pixels
    return float(np.sqrt((error**2).sum(axis=1).mean()))


def _solved(inner: CameraModel, lying: list[Lying]) -> tuple[CameraModel, float, FloatArray]:
    """The camera, the rms of all corners and that of each view (n,) [px]."""
    seen = np.concatenate([one.view.pixels for one in lying])
    origin = [one for one in lying if one.at_origin]
    flat = lying[len(origin) :]
    at_origin = [_points(one.view.points_m, 0.0, 0.0, 0.0) for one in origin]

    def residual(unknown: FloatArray) -> FloatArray:
        elsewhere = [
            _points(one.view.points_m, *pose)
            for one, pose in zip(flat, unknown[6:].reshape(-1, 3), strict=True)
        ]
        points = np.concatenate([*at_origin, *elsewhere])
        return np.asarray((_at(inner, unknown[:6]).project(points) - seen).ravel())

    start, first = origin[0].pose, rotation(origin[0].pose)
    guess = []
    for one in flat:
        x, y, _ = first.T @ (one.pose[3:] - start[3:])
        along = first.T @ rotation(one.pose)[:, 0]
        guess.append([x, y, np.arctan2(along[1], along[0])])
    unknown = np.concatenate([start, *guess])
    solution = least_squares(residual, unknown, method="lm", x_scale="jac")
    rms = float(np.sqrt(2.0 * solution.cost / len(seen)))
    squares = (solution.fun.reshape(-1, 2) ** 2).sum(axis=1)
    ends = np.cumsum([len(one.view.pixels) for one in lying])[:-1]
    misfit = np.array([np.sqrt(part.mean()) for part in np.split(squares, ends)])
    return _at(inner, solution.x[:6]), rms, misfit


def rotation(vector: FloatArray) -> FloatArray:
    """(3, 3) of OpenCV's rotation vector, or of a pose that begins with one."""
    return np.asarray(cv2.Rodrigues(vector[:3])[0], dtype=np.float64)


def flat_pose(x_m: float, y_m: float, angle_rad: float) -> Pose:
    """A board lying on the floor."""
    return np.array([x_m, y_m, THICKNESS_M]), rotation(np.array([0.0, 0.0, angle_rad]))


def _at(inner: CameraModel, pose: FloatArray) -> CameraModel:
    """The camera of which OpenCV says that the world's pose is this (6,)."""
    turned = rotation(pose)
    return replace(inner, rotation=turned, position_m=-turned.T @ pose[3:])


def _points(points_m: FloatArray, x_m: float, y_m: float, angle_rad: float) -> FloatArray:
    """World points (n, 3) of a board's face (n, 2) lying on the floor."""
    position, turned = flat_pose(x_m, y_m, angle_rad)
    return np.asarray(position + points_m @ turned[:, :2].T)
