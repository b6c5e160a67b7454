"""Calibrations as OpenCV FileStorage YAML: what cv2 and other tools read, checked on the way in."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.calibrate import Calibration
from ttwmr_mj.vision.camera.model import CameraModel

ORTHONORMAL_TOLERANCE = 1e-6
FIX = "write a fresh one with `ttwmr calibrate`"


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration.

    Raises:
        InputError: the file cannot be written.
    """
    camera = calibration.camera
    storage = None
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_FORMAT_YAML)
        if not storage.isOpened():
            raise InputError(f"{path}: cannot be written; does its folder exist?")
        storage.write("image_width", camera.width_px)
        storage.write("image_height", camera.height_px)
        storage.write("camera_matrix", camera.matrix)
        storage.write("distortion_coefficients", camera.distortion.reshape(1, -1))
        storage.write("rotation_world_to_camera", camera.rotation)
        storage.write("camera_position_m", camera.position_m.reshape(1, -1))
        storage.write("reprojection_rms_px", calibration.reprojection_rms_px)
        storage.write("floor_rms_px", calibration.floor_rms_px)
        storage.write("views", calibration.views)
    except cv2.error as error:
        raise InputError(f"{path}: cannot be written: {error.err}") from error
    finally:
        if storage is not None:
            storage.release()


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
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    except (cv2.error, SystemError) as error:
        raise InputError(f"{path}: cannot be read as OpenCV YAML; {FIX}") from error
    try:
        if not storage.isOpened():
            raise InputError(f"{path}: cannot be read as OpenCV YAML; {FIX}")
        calibration = _read(storage, path)
    except cv2.error as error:
        raise InputError(f"{path}: damaged: {error.err}; {FIX}") from error
    finally:
        storage.release()
    camera = calibration.camera
    if size_px is not None and size_px != (camera.width_px, camera.height_px):
        raise InputError(
            f"{path}: calibrated at {camera.width_px}×{camera.height_px} px, but the images have "
            f"{size_px[0]}×{size_px[1]}; calibrate at the resolution that is used"
        )
    return calibration


def _read(storage: cv2.FileStorage, path: Path) -> Calibration:
    matrix = _matrix(storage, path, "camera_matrix", (3, 3))
    rotation = _matrix(storage, path, "rotation_world_to_camera", (3, 3))
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=ORTHONORMAL_TOLERANCE):
        raise InputError(f"{path}: rotation_world_to_camera is no rotation; {FIX}")
    if min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise InputError(f"{path}: camera_matrix has a focal length that is not positive; {FIX}")
    camera = CameraModel(
        width_px=_whole(storage, path, "image_width"),
        height_px=_whole(storage, path, "image_height"),
        focal_px=matrix[[0, 1], [0, 1]].copy(),
        principal_px=matrix[:2, 2].copy(),
        distortion=_matrix(storage, path, "distortion_coefficients", (1, 5)).ravel(),
        rotation=rotation,
        position_m=_matrix(storage, path, "camera_position_m", (1, 3)).ravel(),
    )
    rms, floor = (_number(storage, path, key) for key in ("reprojection_rms_px", "floor_rms_px"))
    return Calibration(camera, rms, floor, _whole(storage, path, "views"))


def _node(storage: cv2.FileStorage, path: Path, key: str) -> cv2.FileNode:
    node = storage.getNode(key)
    if node.empty():
        raise InputError(f"{path}: lacks the key {key}; {FIX}")
    return node


def _matrix(storage: cv2.FileStorage, path: Path, key: str, shape: tuple[int, int]) -> FloatArray:
    value = _node(storage, path, key).mat()
    if value is None or np.shape(value) != shape or not np.isfinite(value).all():
        got = "no matrix" if value is None else f"shape {np.shape(value)}"
        raise InputError(
            f"{path}: {key} has {got} or values that are not finite, allowed: a finite matrix of "
            f"shape {shape}; {FIX}"
        )
    return np.array(value, dtype=np.float64)


def _number(storage: cv2.FileStorage, path: Path, key: str) -> float:
    node = _node(storage, path, key)
    if not (node.isReal() or node.isInt()) or not np.isfinite(node.real()):
        raise InputError(f"{path}: {key} is not a finite number; {FIX}")
    return float(node.real())


def _whole(storage: cv2.FileStorage, path: Path, key: str) -> int:
    number = _number(storage, path, key)
    if number != int(number) or number < 1:
        raise InputError(f"{path}: {key} = {number:g}, allowed: a whole number from 1; {FIX}")
    return int(number)
