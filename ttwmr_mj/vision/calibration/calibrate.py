"""From views of a ChArUco board to a camera's intrinsics, distortion and place in the world.

Intrinsics come from all views (OpenCV), the place from those of the board lying flat. Boards that
are parallel to each other tell nothing of the focal length: nearer with a shorter lens they look
the same, and the corners are explained as well.
"""

from dataclasses import dataclass
from itertools import count
from typing import Any

import cv2
import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.board import SQUARES, BoardCamera, BoardView, find_board
from ttwmr_mj.vision.calibration.check import camera_fault
from ttwmr_mj.vision.calibration.floor import Lying, Pose, flat_pose, place, rotation
from ttwmr_mj.vision.camera.lens import CAMERA
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions
from ttwmr_mj.vision.threads import one_thread

MIN_VIEWS = 8  # OpenCV solves fewer, to no purpose
# of the boards' normals, rms. At 4° and with 0.3 px of noise in the corners of 24 views the focal
# length is 3 % off; parallel boards reach 2.5° by such noise, and boards tilted every way 11°
MIN_SPREAD_RAD = np.radians(4.0)
# standard deviation of a focal length, in focal lengths. With 0.5 px of noise it is 8 to 40 % for
# parallel boards that reach 4° by it, and 6 % for eight boards tilted every way
MOST_FOCAL_DEVIATION = 0.07
# of the picture's width and height. With half of it the corners are up to 8 px off at 0.05 px of
# noise, with 0.8 of it 2 px
MIN_REACH = 0.6
TILT = "tilt the board in more of them, by some 20 to 30°, to all sides in turn"
HELD_GRID = (4, 3)  # columns and rows of places in the picture where boards are held
HELD_VIEWS = 24  # two at each place, at many tilts and distances
ORIGIN_VIEWS = 6  # the same pose, against noise
# x, y, angle: towards the corners of the picture, which hold the camera's tilt
FLAT_POSES = ((0.6, 0.4, 0.5), (-0.6, 0.4, -0.4), (-0.6, -0.4, 2.8), (0.6, -0.4, 3.5))
TILT_RAD = (0.15, 0.6)  # less says little of the focal length, more hides markers
HEIGHT_M = (0.5, 1.2)  # of held boards above the floor
PERIOD_S = 0.5  # between two rendered views, while gains drift


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
        InputError: too few views, none at the origin, views that determine no camera or one that
            cannot be, or pictures of the floor that contradict each other.
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
    rms, inner, poses = _intrinsics(everything, width_px, height_px)
    lying = [
        Lying(view, pose, at_origin=i < len(origin))
        for i, (view, pose) in enumerate(zip([*origin, *flat], poses[len(held) :], strict=True))
    ]
    camera, floor_rms = place(inner, lying, rms)
    if fault := camera_fault(camera):
        raise InputError.at(
            "calibration",
            f"the views determine a camera that cannot be: {fault}",
            hint="give the pictures as the camera took them, neither stretched nor cut, with a "
            "board near each border and corner",
        )
    return Calibration(camera, rms, floor_rms, len(everything))


def _intrinsics(
    views: list[BoardView], width_px: int, height_px: int
) -> tuple[float, CameraModel, FloatArray]:
    """What is left over [px], the camera, at the origin, and the boards' poses (n, 6) before it.

    Raises:
        InputError: they determine no camera.
    """
    points = [np.insert(view.points_m, 2, 0.0, axis=1).astype(np.float32) for view in views]
    pixels = [view.pixels.astype(np.float32) for view in views]
    size_px, unknown = (width_px, height_px), (np.eye(3), np.zeros(5))
    try:
        with one_thread():
            rms, matrix, distortion, turns, shifts, deviation, *_ = cv2.calibrateCameraExtended(
                points, pixels, size_px, *unknown, flags=cv2.CALIB_FIX_K3
            )
    except cv2.error as error:
        raise InputError.at(
            "calibration",
            f"OpenCV cannot solve for a camera from the {len(views)} views",
            hint="show more of the board in each: six corners or more, in two rows and columns",
        ) from error
    poses = np.concatenate([turns, shifts], axis=1)[:, :, 0]
    _refuse_alike(poses)
    focal_px, focal_deviation_px = np.diag(matrix)[:2], np.ravel(deviation)[:2]
    _refuse_loose(float((focal_deviation_px / focal_px).max()))
    _refuse_narrow(np.ptp(np.concatenate(pixels), axis=0) / size_px)
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
    return float(rms), inner, poses


def _refuse_narrow(reach: FloatArray) -> None:
    """Beyond the boards' corners (2,), in widths and heights of the picture, distortion is free."""
    if (reach < MIN_REACH).any():
        across, down = (f"{share:.0%}" for share in reach)
        raise _undetermined(
            f"at its borders: the boards reach over {across} of its width and {down} of its "
            f"height, and {MIN_REACH:.0%} are needed",
            "hold the board near each border and corner of the picture",
        )


def _refuse_alike(poses: FloatArray) -> None:
    normals = np.array([rotation(pose)[:, 2] for pose in poses])
    # how far they reach out of the plane that holds most of them
    spread = float(np.linalg.norm(normals, ord=-2) / np.sqrt(len(normals)))
    if not spread >= np.sin(MIN_SPREAD_RAD):
        raise _undetermined(
            "as the boards in them are parallel, or tilted about one axis only: across it they "
            f"differ by {np.degrees(np.arcsin(spread)):.1f}°, and "
            f"{np.degrees(MIN_SPREAD_RAD):g}° are needed"
        )


def _refuse_loose(focal_deviation: float) -> None:
    """Noise in the corners passes for tilt; its share of a focal length tells them apart."""
    if not focal_deviation <= MOST_FOCAL_DEVIATION:
        raise _undetermined(
            f"well: its focal length has a standard deviation of {focal_deviation:.1%}, and "
            f"{MOST_FOCAL_DEVIATION:.0%} at most is allowed",
            f"{TILT}, or take more of them, sharper",
        )


def _undetermined(why: str, hint: str = TILT) -> InputError:
    return InputError.at("calibration", f"the views do not determine a camera {why}", hint=hint)


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
        seen = (find_board(camera.take(*pose, next(moments))) for pose in poses)
        return [view for view in seen if view is not None]

    held = views(_held_poses(camera.true, rng))
    origin = views([flat_pose(0.0, 0.0, 0.0)] * ORIGIN_VIEWS)
    flat = views([flat_pose(*pose) for pose in FLAT_POSES])
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
        turned = rotation(tilt) @ rotation(np.array([0.0, 0.0, spin]))
        poses.append((np.array([*middle, height]), turned))
    return poses
