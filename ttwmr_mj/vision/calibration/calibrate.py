"""From views of a ChArUco board to a camera's intrinsics, distortion and place in the world.

Intrinsics come from all views (OpenCV). The place comes from the views of the board lying flat.
Where it lies at the origin it defines the world, x along its long side and z up; several shots of
it there average out noise. Where it lies elsewhere is solved along with the camera, which one
small board would leave loose in tilt.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import cv2
import numpy as np
from scipy.optimize import least_squares

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.board import (
    SQUARES,
    THICKNESS_M,
    BoardCamera,
    BoardView,
    find_board,
)
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.lens import CAMERA
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions

MIN_VIEWS = 8  # OpenCV solves fewer, to no purpose
HELD_GRID = (4, 3)  # columns and rows of places in the picture where boards are held
HELD_VIEWS = 24  # two at each place, at many tilts and distances
ORIGIN_VIEWS = 6  # the same pose, against noise
# x, y, angle: towards the corners of the picture, which hold the camera's tilt
FLAT_POSES = ((0.6, 0.4, 0.5), (-0.6, 0.4, -0.4), (-0.6, -0.4, 2.8), (0.6, -0.4, 3.5))
TILT_RAD = (0.15, 0.6)  # less says little of the focal length, more hides markers
HEIGHT_M = (0.5, 1.2)  # of held boards above the floor
PERIOD_S = 0.5  # between two rendered views, while gains drift
Pose = tuple[FloatArray, FloatArray]  # position (3,) of a board's face and its rotation (3, 3)


@dataclass(frozen=True, slots=True)
class Calibration:
    """What the loop knows about its camera."""

    camera: CameraModel  # geometry, distortion and pose
    reprojection_rms_px: float  # how well the board's corners are explained, intrinsics
    floor_rms_px: float  # the same for the flat views and the camera's place
    views: int  # number of views with a board


def calibrate(
    held: list[BoardView],
    origin: list[BoardView],
    flat: list[BoardView],
    width_px: int,
    height_px: int,
) -> Calibration:
    """Solve for the camera that took images of this size.

    Args:
        held: views of the board at all tilts; together they should reach every part of the picture.
        origin: flat on the floor at the world's origin, long side along x.
        flat: flat on the floor, anywhere.
        width_px: columns of the images.
        height_px: rows of the images.

    Raises:
        InputError: too few views, none at the origin, or views that determine no camera.
    """
    everything = [*held, *origin, *flat]
    if len(everything) < MIN_VIEWS or not origin:
        raise InputError.at(
            "calibration",
            f"the board was found in {len(everything)} views, {len(origin)} of them at the "
            f"origin; at least {MIN_VIEWS} and 1 are needed",
            hint=f"show the whole ChArUco board ({SQUARES[0]}×{SQUARES[1]} squares, DICT_4X4_50), "
            "sharp and well lit",
        )
    points = [np.insert(view.points_m, 2, 0.0, axis=1).astype(np.float32) for view in everything]
    pixels = [view.pixels.astype(np.float32) for view in everything]
    try:
        rms, matrix, distortion, *poses = cv2.calibrateCamera(
            points, pixels, (width_px, height_px), None, None, flags=cv2.CALIB_FIX_K3
        )
    except cv2.error as error:
        raise InputError.at(
            "calibration",
            f"the views do not determine a camera ({error.err})",
            hint="tilt the board in more of them",
        ) from error
    solved = np.asarray(matrix, dtype=np.float64)
    inner = CameraModel(
        width_px=width_px,
        height_px=height_px,
        focal_px=solved[[0, 1], [0, 1]],
        principal_px=solved[:2, 2].copy(),
        distortion=np.asarray(distortion, dtype=np.float64).ravel()[:5],
        rotation=np.eye(3),
        position_m=np.zeros(3),
    )
    lying = np.concatenate(poses, axis=1)[len(held) :, :, 0]
    camera, floor_rms = _place(inner, origin, flat, lying)
    return Calibration(camera, float(rms), floor_rms, len(everything))


def calibrate_virtual(
    options: CameraOptions, rng: np.random.Generator, key: str = CAMERA
) -> Calibration:
    """Calibrate the simulated camera by showing it a board, as one would the real one.

    Args:
        options: the camera.
        rng: source of the noise in its pictures, and of how the board is held.
        key: where a scenario has this camera.

    Raises:
        InputError: it sees too little of the board, as with too much noise.
        MachineError: no OpenGL.
    """
    camera = BoardCamera(options, rng, key)
    moments = count(0.0, PERIOD_S)

    def views(poses: list[Pose]) -> list[BoardView]:
        return find_boards(camera.take(*pose, next(moments)) for pose in poses)

    held = views(_held_poses(camera.true, rng))
    origin = views([_flat_pose(0.0, 0.0, 0.0)] * ORIGIN_VIEWS)
    flat = views([_flat_pose(*pose) for pose in FLAT_POSES])
    camera.close()
    try:
        return calibrate(held, origin, flat, options.width_px, options.height_px)
    except InputError as error:
        found = len(held) + len(origin) + len(flat)
        raise InputError.at(
            key,
            "before a run the camera is calibrated with a board of 0.56 m × 0.40 m held about the "
            f"origin, and in {found} of {HELD_VIEWS + ORIGIN_VIEWS + len(FLAT_POSES)} pictures it "
            "sees enough of it",
            got=_unusual(options),
            allowed="a camera that sees the board whole, sharp and with some 20 px to a square",
            hint="change these values, or name a calibration in sensing.calibration_path",
        ) from error


def _unusual(options: CameraOptions) -> str:
    """What a camera has else than the laboratory's or a perfect one, whichever is nearer to it."""
    given = _flat(options)
    others = (_flat(base) for base in (LAB_CAMERA, CameraOptions()))
    unlike = ([key for key in given if given[key] != other[key]] for other in others)
    return ", ".join(f"{key} = {given[key]}" for key in min(unlike, key=len))


def _flat(options: CameraOptions) -> dict[str, Any]:
    """The numbers of camera, lens and noise by their keys: all that a calibration sees."""
    told: dict[str, Any] = {}
    for name, value in options.model_dump(exclude={"faults", "exposure", "supersampling"}).items():
        inner = value if isinstance(value, dict) else {"": value}
        told |= {f"{name}.{key}".rstrip("."): one for key, one in inner.items()}
    return told


def find_boards(images: Iterable[Image]) -> list[BoardView]:
    """The views of those images that show the board."""
    views = map(find_board, images)
    return [view for view in views if view is not None]


def _place(
    inner: CameraModel, origin: list[BoardView], flat: list[BoardView], poses: FloatArray
) -> tuple[CameraModel, float]:
    """The camera's pose in the world of the board at the origin, and what is left over [px].

    Args:
        inner: intrinsics and distortion.
        origin: views of the board at the origin.
        flat: views of it elsewhere on the floor.
        poses: (n, 6) OpenCV's rotation vector and translation of all these, solved one by one.
    """
    seen = np.concatenate([view.pixels for view in [*origin, *flat]])
    at_origin = [_lying(view.points_m, 0.0, 0.0, 0.0) for view in origin]

    def residual(unknown: FloatArray) -> FloatArray:
        elsewhere = [
            _lying(view.points_m, *pose)
            for view, pose in zip(flat, unknown[6:].reshape(-1, 3), strict=True)
        ]
        points = np.concatenate([*at_origin, *elsewhere])
        return np.asarray((_at(inner, unknown[:6]).project(points) - seen).ravel())

    start, first = poses[0], _rotation(poses[0])
    guess = []
    for pose in poses[len(origin) :]:
        x, y, _ = first.T @ (pose[3:] - start[3:])
        along = first.T @ _rotation(pose)[:, 0]
        guess.append([x, y, np.arctan2(along[1], along[0])])
    unknown = np.concatenate([start, *guess])
    solution = least_squares(residual, unknown, method="lm", x_scale="jac")
    rms = float(np.sqrt(2.0 * solution.cost / len(seen)))
    return _at(inner, solution.x[:6]), rms


def _rotation(pose: FloatArray) -> FloatArray:
    """(3, 3) of a pose that begins with OpenCV's rotation vector."""
    return np.asarray(cv2.Rodrigues(pose[:3])[0], dtype=np.float64)


def _at(inner: CameraModel, pose: FloatArray) -> CameraModel:
    """The camera of which OpenCV says that the world's pose is this (6,)."""
    rotation = _rotation(pose)
    return replace(inner, rotation=rotation, position_m=-rotation.T @ pose[3:])


def _lying(points_m: FloatArray, x_m: float, y_m: float, angle_rad: float) -> FloatArray:
    """World points (n, 3) of a board's face (n, 2) lying on the floor."""
    position, rotation = _flat_pose(x_m, y_m, angle_rad)
    return np.asarray(position + points_m @ rotation[:, :2].T)


def _flat_pose(x_m: float, y_m: float, angle_rad: float) -> Pose:
    """A board lying on the floor."""
    return np.array([x_m, y_m, THICKNESS_M]), _rotation(np.array([0.0, 0.0, angle_rad]))


def _held_poses(camera: CameraModel, rng: np.random.Generator) -> list[Pose]:
    """Poses that carry the board's middle over a grid of the picture, tilted at random."""
    columns, rows = HELD_GRID
    size, poses = (camera.width_px, camera.height_px), []
    for i in range(HELD_VIEWS):
        column, row = i % columns, (i // columns) % rows
        share = np.array([0.18 + 0.64 * column / (columns - 1), 0.2 + 0.6 * row / (rows - 1)])
        height = rng.uniform(*HEIGHT_M)
        middle = camera.to_plane(share * size, height)
        spin, lean = rng.uniform(-0.5, 0.5), rng.uniform(-np.pi, np.pi)
        tilt = rng.uniform(*TILT_RAD) * np.array([np.cos(lean), np.sin(lean), 0.0])
        rotation = _rotation(tilt) @ _rotation(np.array([0.0, 0.0, spin]))
        poses.append((np.array([*middle, height]), rotation))
    return poses
