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
        InputError: the views contradict each other; it names those that do not fit the others.
    """
    camera, rms, misfit = _solved(inner, lying)
    # no floor and no board is flatter than the board is thick
    board_px = float(inner.focal_px.mean() * THICKNESS_M / np.linalg.norm(lying[0].pose[3:]))
    most_px = max(MOST_MISFIT * rms_px, board_px)
    if misfit.max() <= most_px:
        return camera, rms
    unlike = _unlike(inner, lying, most_px)
    names = ", ".join(one.view.picture or "a view" for one in unlike)
    others = (
        "none agrees with the rest" if len(unlike) == len(lying) else f"they agree without {names}"
    )
    raise InputError.at(
        "calibration",
        f"the pictures of the floor contradict each other, one by {misfit.max():.1f} px; {others}",
        allowed=f"at most {most_px:.1f} px",
        hint="in origin/ it lies at one place, turned one way, and in flat/ flat on the floor; "
        "take the picture again, or move it to held/",
    )


def _unlike(inner: CameraModel, lying: list[Lying], most_px: float) -> list[Lying]:
    """Views without which the others agree: each time the one whose absence helps most."""
    left, out = lying, []
    while _solved(inner, left)[2].max() > most_px:
        rests = [[*left[:i], *left[i + 1 :]] for i in range(len(left))]
        rests = [rest for rest in rests if any(one.at_origin for one in rest)]
        if not rests:  # not even a single one is what a board would look like
            return lying
        best = min(rests, key=lambda rest: _solved(inner, rest)[1])
        out += [one for one in left if all(one is not other for other in best)]
        left = best
    return out


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
