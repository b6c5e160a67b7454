"""Calibrations as OpenCV FileStorage YAML: what cv2 and other tools read, checked on the way in."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import write_text
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.calibrate import Calibration
from ttwmr_mj.vision.calibration.check import camera_fault
from ttwmr_mj.vision.camera.model import CameraModel

# key → shape of what it holds, and what that is
CONTENT: dict[str, tuple[tuple[int, ...], Callable[[Calibration], Any]]] = {
    "image_width": ((), lambda saved: saved.camera.width_px),
    "image_height": ((), lambda saved: saved.camera.height_px),
    "camera_matrix": ((3, 3), lambda saved: saved.camera.matrix),
    "distortion_coefficients": ((1, 5), lambda saved: saved.camera.distortion[None]),
    "rotation_world_to_camera": ((3, 3), lambda saved: saved.camera.rotation),
    "camera_position_m": ((1, 3), lambda saved: saved.camera.position_m[None]),
    "reprojection_rms_px": ((), lambda saved: saved.reprojection_rms_px),
    "floor_rms_px": ((), lambda saved: saved.floor_rms_px),
    "views": ((), lambda saved: saved.views),
}
MATRIX = re.compile(
    r"!!opencv-matrix\s+rows: (\d{1,3})\s+cols: (\d{1,3})\s+dt: [df]\s+data: \[([-+.,\w\s]*)\]"
)
MOST_LETTERS = 10_000
MOST = 1e9  # of any number
MOST_SIZE_PX = 100_000
COUNTS = ("image_width", "image_height", "views")
ZERO_PX = 1e-6  # what counts as zero, and as one, in a camera matrix
FIX = "write a fresh one with `ttwmr calibrate`"


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration.

    Raises:
        OSError: the file cannot be written.
    """
    mode = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
    storage = cv2.FileStorage("", mode)
    for key, (_, content) in CONTENT.items():
        storage.write(key, content(calibration))
    write_text(path, storage.releaseAndGetString())


def load_calibration(path: Path) -> Calibration:
    """Read a calibration and check it.

    Args:
        path: an OpenCV FileStorage YAML with the keys that `save_calibration` writes.

    Raises:
        InputError: missing, unreadable, incomplete or impossible content.
    """
    if not path.is_file():
        raise InputError(Fault(problem="no such calibration file", hint=FIX), file=str(path))
    try:
        text = path.read_text(encoding="utf-8")
        _refuse_unlike(text)
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        return _read(storage, path)
    # OpenCV's binding raises the one or the other
    except (OSError, ValueError, cv2.error, SystemError) as error:
        why = f": {error}" if type(error) is ValueError else ""  # in words of ours
        unreadable = Fault(problem=f"cannot be read as OpenCV YAML{why}", hint=FIX)
        raise InputError(unreadable, file=str(path)) from error


def _refuse_unlike(text: str) -> None:
    """OpenCV's reader trusts what a matrix says of its size, and other YAML it takes as it comes.

    Raises:
        ValueError: the text is not of the kind that `save_calibration` writes.
    """
    matrices = MATRIX.findall(text)
    if len(matrices) != text.count("!") // 2 or len(text) > MOST_LETTERS:
        raise ValueError("something else than small matrices of numbers")
    if any(int(rows) * int(cols) != len(data.split(",")) for rows, cols, data in matrices):
        raise ValueError("a matrix that does not have as many numbers as it says")


def _read(storage: cv2.FileStorage, path: Path) -> Calibration:
    _refuse_twice(storage, path)
    value = {key: _value(storage.getNode(key), key, path) for key in CONTENT}
    matrix = value["camera_matrix"]
    camera = CameraModel(
        width_px=int(value["image_width"]),
        height_px=int(value["image_height"]),
        focal_px=matrix[[0, 1], [0, 1]],
        principal_px=matrix[:2, 2].copy(),
        distortion=value["distortion_coefficients"].ravel(),
        rotation=value["rotation_world_to_camera"],
        position_m=value["camera_position_m"].ravel(),
    )
    if fault := camera_fault(camera):
        raise InputError(replace(fault, hint=FIX), file=str(path))
    _refuse_wrong_numbers(value, path)
    rms, floor = float(value["reprojection_rms_px"]), float(value["floor_rms_px"])
    return Calibration(camera, rms, floor, int(value["views"]))


def _refuse_twice(storage: cv2.FileStorage, path: Path) -> None:
    """OpenCV takes the first of several values of a key, in whatever document of the file."""
    documents = takewhile(lambda root: not root.empty(), map(storage.root, count()))
    keys = [key for root in documents for key in root.keys()]  # noqa: SIM118  # no dictionary
    for key in CONTENT:
        if keys.count(key) > 1:
            raise _fault(path, key, problem=f"is there {keys.count(key)} times", allowed="once")


def _refuse_wrong_numbers(value: dict[str, FloatArray], path: Path) -> None:
    """A camera matrix is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; what else it held would be lost."""
    matrix = value["camera_matrix"]
    (fx, _, cx), (_, fy, cy), _ = matrix
    form = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if (np.abs(matrix - form) > ZERO_PX).any():
        allowed = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
        raise _fault(path, "camera_matrix", got=str(matrix.tolist()), allowed=allowed)
    for rms in ("reprojection_rms_px", "floor_rms_px"):
        if value[rms] < 0.0:
            raise _fault(path, rms, got=f"{value[rms]:g}", allowed="0 or more")


def _value(node: cv2.FileNode, key: str, path: Path) -> FloatArray:
    """A number or matrix of the shape that the key must have, finite."""
    if node.empty():
        raise _fault(path, key, problem="is missing")
    shape, _ = CONTENT[key]
    number = node.isReal() or node.isInt()
    content = node.real() if number else node.mat() if node.isMap() else None
    sane = content is not None and bool((np.abs(content) <= MOST).all())
    if content is None or np.shape(content) != shape or not sane:
        got = "neither a number nor a matrix" if content is None else f"shape {np.shape(content)}"
        allowed = f"finite numbers of shape {shape}" if shape else "a finite number"
        allowed += f" up to {MOST:g}"
        raise _fault(path, key, got=got, allowed=allowed)
    most = MOST if key == "views" else MOST_SIZE_PX
    if key in COUNTS and not (1 <= content <= most and float(content).is_integer()):
        allowed = f"a whole number from 1 to {most:g}"
        raise _fault(path, key, got=f"{content:g}", allowed=allowed)
    return np.array(content, dtype=np.float64)


def _fault(path: Path, key: str, **words: Any) -> InputError:
    return InputError(Fault(key=(key,), hint=FIX, **words), file=str(path))
