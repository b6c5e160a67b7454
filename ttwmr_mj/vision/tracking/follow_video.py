"""The chain on a real recording or camera: frames in, poses, annotated video and recording out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.plants.mjcf import build_model
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.vision.calibration.calibrate import Calibration
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.labels import LabelLayout, read_layout
from ttwmr_mj.vision.log import CameraRecord
from ttwmr_mj.vision.options import TrackerOptions
from ttwmr_mj.vision.tracking.tracker import Tracker

# nobody tells what the wheels of a filmed robot were told: anything they can do must be expected
FREE_MOTION = TrackerOptions(
    label_noise_px=0.15, speed_noise_m_s=0.2, turn_noise_rad_s=2.0, noise_time_s=0.5
)
DEFAULT_RATE_HZ = 30.0  # where a stream does not tell
BATCH = 30  # records handed over at once
Consumer = Callable[[list[CameraRecord]], None]


@dataclass(frozen=True, slots=True)
class Footage:
    """An opened stream of frames.

    Attributes:
        name: for messages.
        rate_hz: frames per second.
        frames: how many there are; None for a camera.
        stream: OpenCV's.
    """

    name: str
    rate_hz: float
    frames: int | None
    stream: cv2.VideoCapture


@contextmanager
def open_footage(source: str, calibration: Calibration) -> Iterator[Footage]:
    """Open a video file, or a camera by its index, and check that the calibration fits it.

    Raises:
        InputError: it cannot be opened or read, or has another resolution.
    """
    camera_index = int(source) if source.isdecimal() else None
    if camera_index is None and not Path(source).is_file():
        raise InputError(f"{source}: no such video file; give a file or a camera's index")
    stream = cv2.VideoCapture(camera_index if camera_index is not None else source)
    try:
        if not stream.isOpened():
            raise InputError(
                f"{source}: cannot be opened as a video; is it damaged, or in a format that "
                "OpenCV does not read? AVI with MJPG always works"
            )
        size = (
            int(stream.get(cv2.CAP_PROP_FRAME_WIDTH)),
            int(stream.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        )
        wanted = (calibration.camera.width_px, calibration.camera.height_px)
        if size != wanted:
            raise InputError(
                f"{source}: has {size[0]}×{size[1]} px, but the camera was calibrated at "
                f"{wanted[0]}×{wanted[1]}; calibrate at the video's resolution"
            )
        rate = stream.get(cv2.CAP_PROP_FPS)
        count = int(stream.get(cv2.CAP_PROP_FRAME_COUNT)) if camera_index is None else None
        yield Footage(source, rate if rate > 0 else DEFAULT_RATE_HZ, count, stream)
    finally:
        stream.release()


def robot_layout(robot: RobotParameters) -> LabelLayout:
    """Where this robot carries its labels."""
    return read_layout(build_model(robot, ContactOptions()))


def follow(
    footage: Footage,
    calibration: Calibration,
    robot: RobotParameters,
    consume: Consumer,
    *,
    max_frames: int | None = None,
    options: TrackerOptions = FREE_MOTION,
) -> int:
    """Track the robot through every frame.

    Args:
        footage: where the frames come from.
        calibration: of its camera.
        robot: in the pictures.
        consume: gets the records in order, some at a time.
        max_frames: stop after so many; None: at the end.
        options: of the tracker.

    Returns:
        Number of frames.

    Raises:
        InputError: not a single frame could be read.
    """
    tracker = Tracker(calibration.camera, robot_layout(robot), robot, options)
    records: list[CameraRecord] = []
    count = 0
    while max_frames is None or count < max_frames:
        readable, image = footage.stream.read()
        if not readable:
            break
        time_s = count / footage.rate_hz
        frame = Frame(image=np.asarray(image, dtype=np.uint8), time_s=time_s, truth=None)
        sighting = tracker.see(frame.image, time_s)
        records.append(CameraRecord(time_s, frame, sighting, tracker.estimate(time_s)))
        count += 1
        if len(records) >= BATCH:
            consume(records)
            records = []
    if records:
        consume(records)
    if count == 0:
        raise InputError(f"{footage.name}: no frame can be read; the video is empty or damaged")
    return count
