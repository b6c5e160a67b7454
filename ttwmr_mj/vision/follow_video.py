"""The chain on a real recording or camera: frames in, where the robot is out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.log import CameraRecord
from ttwmr_mj.vision.tracking.options import TrackerOptions
from ttwmr_mj.vision.tracking.tracker import Tracker

# nobody tells what the wheels of a filmed robot were told: anything they can do must be expected
FREE_MOTION = TrackerOptions(
    label_noise_px=0.15, speed_noise_m_s=0.2, turn_noise_rad_s=2.0, noise_time_s=0.5
)
DEFAULT_RATE_HZ = 30.0  # where a stream does not tell


@dataclass(frozen=True, slots=True)
class Footage:
    """An opened stream of frames.

    Attributes:
        name: for messages.
        rate_hz: frames per second.
        stream: OpenCV's.
    """

    name: str
    rate_hz: float
    stream: cv2.VideoCapture


@contextmanager
def open_footage(source: str, camera: CameraModel) -> Iterator[Footage]:
    """Open a video file, or a camera by its index, and check that the calibration fits it.

    Raises:
        InputError: it cannot be opened or read, or has another resolution.
    """
    if not source.isdecimal() and not Path(source).is_file():
        raise InputError(f"{source}: no such video file; give a file or a camera's index")
    stream = cv2.VideoCapture(int(source) if source.isdecimal() else source)
    try:
        if not stream.isOpened():
            raise InputError(
                f"{source}: cannot be opened as a video; is it damaged, or in a format that "
                "OpenCV does not read? AVI with MJPG always works"
            )
        width = int(stream.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(stream.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if (width, height) != (camera.width_px, camera.height_px):
            raise InputError(
                f"{source}: has {width}×{height} px, but the camera was calibrated at "
                f"{camera.width_px}×{camera.height_px}; calibrate at the video's resolution"
            )
        rate = stream.get(cv2.CAP_PROP_FPS)
        yield Footage(source, rate if rate > 0 else DEFAULT_RATE_HZ, stream)
    finally:
        stream.release()


def follow(
    footage: Footage, tracker: Tracker, *, max_frames: int | None = None
) -> Iterator[CameraRecord]:
    """Track the robot through every frame, as they come.

    Args:
        footage: where the frames come from.
        tracker: of its camera; FREE_MOTION suits where no commands are known.
        max_frames: stop after so many; None: at the end.

    Raises:
        InputError: not a single frame can be read.
    """
    count = 0
    while max_frames is None or count < max_frames:
        readable, image = footage.stream.read()
        if not readable:
            break
        time_s = count / footage.rate_hz
        frame = Frame(image=np.asarray(image, dtype=np.uint8), time_s=time_s, truth=None)
        sighting = tracker.see(frame.image, time_s)
        yield CameraRecord(time_s, frame, sighting, tracker.estimate(time_s))
        count += 1
    if count == 0:
        raise InputError(f"{footage.name}: no frame can be read; the video is empty or damaged")
