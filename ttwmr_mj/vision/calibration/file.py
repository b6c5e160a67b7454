"""Calibrations as OpenCV FileStorage YAML: what cv2 and other tools read, checked on the way in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import write_text
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.calibrate import Calibration
from ttwmr_mj.vision.camera.model import CameraModel

SHAPES: dict[str, tuple[int, ...]] = {
    "image_width": (),
    "image_height": (),
    "camera_matrix": (3, 3),
    "distortion_coefficients": (1, 5),
    "rotation_world_to_camera": (3, 3),
    "camera_position_m": (1, 3),
    "reprojection_rms_px": (),
    "floor_rms_px": (),
    "views": (),
}
COUNTS = ("image_width", "image_height", "views")
ORTHONORMAL_TOLERANCE = 1e-6  # a file with seven digits passes
FIX = "write a fresh one with `ttwmr calibrate`"


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration.

    Raises:
        InputError: the file cannot be written.
    """
    camera = calibration.camera
    values: tuple[Any, ...] = (
        camera.width_px,
        camera.height_px,
        camera.matrix,
        camera.distortion.reshape(1, -1),
        camera.rotation,
        camera.position_m.reshape(1, -1),
        calibration.reprojection_rms_px,
        calibration.floor_rms_px,
        calibration.views,
    )
    mode = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
    storage = cv2.FileStorage("", mode)
    for key, value in zip(SHAPES, values, strict=True):
        storage.write(key, value)
    try:
        write_text(path, storage.releaseAndGetString())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def load_calibration(path: Path, size_px: tuple[int, int] | None = None) -> Calibration:
    """Read a calibration and check it.

    Args:
        path: an OpenCV FileStorage YAML with the keys that `save_calibration` writes.
        size_px: width and height of the images it is wanted for; None accepts any.

    Raises:
        InputError: missing, unreadable, incomplete or impossible content, or another resolution.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such calibration file; {FIX}")
    try:
        text = path.read_text(encoding="utf-8")
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        calibration = _read(storage, path)
    # OpenCV's binding raises the one or the other
    except (OSError, ValueError, cv2.error, SystemError) as error:
        raise InputError(f"{path}: cannot be read as OpenCV YAML; {FIX}") from error
    camera = calibration.camera
    if size_px is not None and size_px != (camera.width_px, camera.height_px):
        raise InputError(
            f"{path}: calibrated at {camera.width_px}×{camera.height_px} px, but the images have "
            f"{size_px[0]}×{size_px[1]}; calibrate at the resolution that is used"
        )
    return calibration


def _read(storage: cv2.FileStorage, path: Path) -> Calibration:
    value = {key: _value(storage.getNode(key), key, path) for key in SHAPES}
    matrix, rotation = value["camera_matrix"], value["rotation_world_to_camera"]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=ORTHONORMAL_TOLERANCE):
        raise _fault(path, "rotation_world_to_camera", problem="is not a rotation")
    if min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise _fault(path, "camera_matrix", problem="has a focal length that is not positive")
    camera = CameraModel(
        width_px=int(value["image_width"]),
        height_px=int(value["image_height"]),
        focal_px=matrix[[0, 1], [0, 1]],
        principal_px=matrix[:2, 2].copy(),
        distortion=value["distortion_coefficients"].ravel(),
        rotation=rotation,
        position_m=value["camera_position_m"].ravel(),
    )
    rms, floor = float(value["reprojection_rms_px"]), float(value["floor_rms_px"])
    return Calibration(camera, rms, floor, int(value["views"]))


def _value(node: cv2.FileNode, key: str, path: Path) -> FloatArray:
    """A number or matrix of the shape that the key must have, finite."""
    if node.empty():
        raise _fault(path, key, problem="is missing")
    number = node.isReal() or node.isInt()
    content = node.real() if number else node.mat() if node.isMap() else None
    if content is None or np.shape(content) != SHAPES[key] or not np.isfinite(content).all():
        got = "no number or matrix" if content is None else f"shape {np.shape(content)}"
        allowed = f"finite numbers of shape {SHAPES[key]}"
        raise _fault(path, key, got=got, allowed=allowed)
    if key in COUNTS and not (content >= 1 and float(content).is_integer()):
        raise _fault(path, key, got=f"{content:g}", allowed="a whole number from 1")
    return np.array(content, dtype=np.float64)


def _fault(path: Path, key: str, **words: Any) -> InputError:
    return InputError(Fault(key=(key,), hint=FIX, **words), file=str(path))
