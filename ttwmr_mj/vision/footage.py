"""Frames of a video file, of a folder of pictures, or of a camera's stream."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from pydantic import BaseModel, FailFast, Field, ValidationError

from ttwmr_mj.errors import Fault, InputError, Keys, RunError, whole
from ttwmr_mj.pixels import quiet
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.pictures import SUFFIXES, picture_files, read_picture, refuse_missing

DEFAULT_RATE_HZ = 30.0  # where a stream does not report its rate, and of pictures without times
MOST_RATE_HZ = 1e5  # no camera's: a damaged header's
MOST_S = 1e6  # eleven days
MISCOUNTED, MISCOUNTED_FRAMES = 2e-3, 2.0  # of a video's frames and length: containers round
MOST_BYTES = 100_000_000  # of annotations: those of 50,000 frames

NO_VIDEO = Fault(
    problem="cannot be opened as a video; it may be damaged, or in a format that OpenCV does not "
    "read",
    hint="AVI with MJPG always works",
)
NO_CAMERA = Fault(
    problem="no camera of this index can be opened; there may be none, it may be in use, or you "
    "may lack the permission to use it",
    hint="the first camera is 0; write ./ before the name of a file that is a number",
)


class _Picture(BaseModel):
    """What annotations.json says of a picture."""

    file_name: Annotated[str, Field(pattern=r"^[^/\\]+$")]  # none that leaves the folder
    time_s: Annotated[float, Field(ge=-MOST_S, le=MOST_S)]  # of the first a little below zero


class _Annotations(BaseModel):
    """The part of a COCO data set that is needed."""

    images: Annotated[list[_Picture], FailFast()]  # of a damaged one not a million faults


@contextmanager
def open_footage(source: str, camera: CameraModel) -> Iterator[Iterator[Frame]]:
    """The frames of a source; the calibration must fit them.

    Where they break off before the source's end, they raise a RunError that says why.

    Args:
        source: a video file; a folder of pictures, that of `--save-frames` with their times, any
            other by name, 30 a second; or a camera's index.
        camera: as it was calibrated.

    Raises:
        InputError: it cannot be opened, or has another resolution than the calibrated camera; from
            the frames, too, where there is no first one to be had.
    """
    if Path(source).is_dir():
        yield _pictures(Path(source), camera)
        return
    index = whole(source)
    if index is None and not Path(source).is_file():
        missing = Fault(
            problem="no such video file or folder",
            hint="give a video file, a folder of pictures or a camera's index",
        )
        raise InputError(missing, file=source)
    with quiet():
        # in full: OpenCV takes what stands before a colon for a network's protocol
        name = str(Path(source).absolute()) if index is None else index
        stream = cv2.VideoCapture(name)
    try:
        if not stream.isOpened():
            raise InputError(NO_VIDEO if index is None else NO_CAMERA, file=source)
        width = int(stream.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(stream.get(cv2.CAP_PROP_FRAME_HEIGHT))
        _refuse_unlike(width, height, camera, source)
        yield _frames(stream, source)
    finally:
        stream.release()


def _refuse_unlike(width: int, height: int, camera: CameraModel, file: str) -> None:
    if (width, height) != (camera.width_px, camera.height_px):
        unlike = Fault(
            got=f"{width}×{height} px",
            problem=f"the camera was calibrated at {camera.width_px}×{camera.height_px} px",
            hint="calibrate at the resolution that is used",
        )
        raise InputError(unlike, file=file)


def _frames(stream: cv2.VideoCapture, source: str) -> Iterator[Frame]:
    """A stream's frames until one cannot be read; the first is at time zero.

    Each is at the time that the stream tells of it, which need not be evenly spaced; where it tells
    none, or one that does not follow the last, as long after the last as its rate says.

    Raises:
        RunError: that was not the end.
    """
    rate = stream.get(cv2.CAP_PROP_FPS)
    period_s = 1.0 / (rate if 0 < rate <= MOST_RATE_HZ else DEFAULT_RATE_HZ)
    promised = stream.get(cv2.CAP_PROP_FRAME_COUNT)
    promised = promised if 0 < promised < MOST_RATE_HZ * MOST_S else 0.0
    time_s, start_s, count = -period_s, None, 0
    while True:
        with quiet():
            readable, image = stream.read()
            told_s = 1e-3 * stream.get(cv2.CAP_PROP_POS_MSEC)
        if not readable:
            break
        start_s = told_s if start_s is None else start_s
        after_s = told_s - start_s - time_s
        time_s += after_s if 1.0 / MOST_RATE_HZ <= after_s <= MOST_S else period_s
        count += 1
        yield Frame(np.asarray(image, dtype=np.uint8), time_s, truth=None)
    # of uneven rate there are fewer frames than many containers promise, but not less time
    reached = max(count, time_s / period_s + 1.0)
    if count and reached < (1.0 - MISCOUNTED) * promised - MISCOUNTED_FRAMES:
        ends = f"{time_s + period_s:.1f} of {promised * period_s:.1f} s"
        raise RunError(f"{source}: ended after {count} frames, {ends}: damaged or cut off")


def _pictures(folder: Path, camera: CameraModel) -> Iterator[Frame]:
    """A folder's pictures, each at its time.

    Raises:
        InputError: one is missing, or the first is none, or of another size.
        RunError: so is one after it.
    """
    annotations = folder / "annotations.json"
    if annotations.exists():
        listed = _read_annotations(annotations)
        timed = [(folder / "images" / picture.file_name, picture.time_s) for picture in listed]
    else:
        timed = [(path, i / DEFAULT_RATE_HZ) for i, path in enumerate(picture_files(folder))]
        if not timed:
            empty = Fault(problem="no picture in this folder", allowed=", ".join(SUFFIXES))
            raise InputError(empty, file=str(folder))
    for path, _ in timed:  # before hours of work
        refuse_missing(path)
    for i, (path, time_s) in enumerate(timed):
        try:
            image = read_picture(path)
            _refuse_unlike(image.shape[1], image.shape[0], camera, str(path))
        except InputError as error:
            if i == 0:
                raise
            raise RunError(
                f"{error}; ended before it, after {i} of {len(timed)} pictures"
            ) from error
        yield Frame(image, time_s, truth=None)


def _read_annotations(path: Path) -> list[_Picture]:
    """What is said of the pictures, in the order of their times.

    Raises:
        InputError: it is none of ours, or two pictures have the same time.
    """
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            raise ValueError(f"it is no file, or larger than {MOST_BYTES:,} bytes")
        listed = _Annotations.model_validate_json(path.read_bytes()).images
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise _none_of_ours(path, first["msg"], first["loc"]) from error
    except (ValueError, OSError) as error:
        raise _none_of_ours(path, str(error)) from error
    listed.sort(key=lambda picture: picture.time_s)
    for one, other in pairwise(listed):
        if not other.time_s - one.time_s >= 1.0 / MOST_RATE_HZ:
            same = f"{one.file_name} and {other.file_name} are both at {one.time_s:g} s"
            raise _none_of_ours(path, same, ("images", "time_s"))
    return listed


def _none_of_ours(path: Path, problem: str, key: Keys = ()) -> InputError:
    unlike = Fault(
        key=key,
        problem=f"it is not what `ttwmr run --save-frames` writes, images with a file_name and a "
        f"time_s each: {problem}",
        hint="remove the file; the pictures are then taken by name, 30 a second",
    )
    return InputError(unlike, file=str(path))
