"""Frames of a video file or a camera's stream."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import cv2
import numpy as np

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.quiet import quiet

DEFAULT_RATE_HZ = 30.0  # where a stream does not report its rate
MOST_RATE_HZ = 1e5  # no camera's: a damaged header's


@contextmanager
def open_footage(source: str, camera: CameraModel) -> Iterator[Iterator[Frame]]:
    """The frames of a video file, or of a camera by its index; the calibration must fit them.

    Raises:
        InputError: it cannot be opened, or has another resolution than the calibrated camera.
    """
    if not source.isdecimal() and not Path(source).is_file():
        missing = Fault(problem="no such video file", hint="give a file or a camera's index")
        raise InputError(missing, file=source)
    with quiet():
        stream = cv2.VideoCapture(int(source) if source.isdecimal() else source)
    try:
        if not stream.isOpened():
            unreadable = Fault(
                problem="cannot be opened as a video; it may be damaged, or in a format that "
                "OpenCV does not read",
                hint="AVI with MJPG always works",
            )
            raise InputError(unreadable, file=source)
        width = int(stream.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(stream.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if (width, height) != (camera.width_px, camera.height_px):
            unlike = Fault(
                got=f"{width}×{height} px",
                problem=f"the camera was calibrated at {camera.width_px}×{camera.height_px} px",
                hint="calibrate at the video's resolution",
            )
            raise InputError(unlike, file=source)
        yield _frames(stream)
    finally:
        stream.release()


def _frames(stream: cv2.VideoCapture) -> Iterator[Frame]:
    """A stream's frames until one cannot be read; the first is at time zero."""
    rate = stream.get(cv2.CAP_PROP_FPS)
    rate_hz = rate if 0 < rate <= MOST_RATE_HZ else DEFAULT_RATE_HZ
    for number in count():
        with quiet():
            readable, image = stream.read()
        if not readable:
            return
        yield Frame(np.asarray(image, dtype=np.uint8), number / rate_hz, truth=None)
