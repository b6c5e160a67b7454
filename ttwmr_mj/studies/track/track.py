"""What `ttwmr track` does: from a video or camera to poses.parquet and track.rrd."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from ttwmr_mj.errors import Fault, InputError, RunError, whole
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.results.parquet import write_parquet
from ttwmr_mj.results.trajectory import q_names, rate_names
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.labels import LabelLayout, label_fault, read_layout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.footage import open_footage
from ttwmr_mj.vision.log import CameraRecord
from ttwmr_mj.vision.tracking.options import FREE_MOTION
from ttwmr_mj.vision.tracking.tracker import Tracker

BATCH = 30  # frames worked in between two writes: a second
LIVE_BATCH = 3
NARROWEST_LABEL_PX = 1.0  # what is found in a picture has a pixel at least


@dataclass(frozen=True, slots=True)
class Track:
    """What tracking left behind."""

    folder: Path  # with poses.parquet and track.rrd
    frames: int  # number of frames
    tracked: int  # in how many of them the robot was found and the estimate valid


def track(
    source: str,
    calibration_path: Path,
    folder: Path,
    robot: RobotParameters,
    *,
    max_frames: int | None = None,
    progress: Callable[[float], None] | None = None,
    live: LiveView | None = None,
    pace: Pace | None = None,
) -> Track:
    """Track the robot through a video or a camera's stream.

    poses.parquet has a row per frame: time_s, x_m … theta2_rad (and so on for more trailers), their
    rates and standard deviations (NaN before the robot was first seen), labels_found, valid.

    Args:
        source: a video file, a folder of pictures or a camera's index.
        calibration_path: a file of `ttwmr calibrate`.
        folder: for the files; it exists.
        robot: the robot in the pictures.
        max_frames: stop after this many; None: at the end.
        progress: called with the number of frames done.
        live: shows the recording while it is written.
        pace: how fast a file is tracked; None: as fast as it can. A camera has its own pace.

    Raises:
        InputError: the video or the calibration cannot be used.
        RunError: the source breaks off before its end; what there is of it is tracked.
        KeyboardInterrupt: it was stopped; the frames until then are tracked. A camera's stream ends
            so, without an error.
    """
    from ttwmr_mj.studies.track.recording import TrackRecorder

    layout = read_layout(build_model(robot, ContactOptions()))
    camera = _camera(calibration_path, layout)
    tracker = Tracker(camera, layout, robot, FREE_MOTION)
    rows: list[tuple[float, ...]] = []
    stopped, pace = False, pace or Pace()
    faults: list[RunError] = []
    batch = BATCH if live is None else LIVE_BATCH
    with (
        pace.heeding_stops(),
        open_footage(source, camera) as frames,
        TrackRecorder(folder / "track.rrd", source, camera, layout, live) as recorder,
    ):
        whole = islice(_until(faults, frames), max_frames)
        wanted = (frame for frame in whole if pace.hold(frame.time_s))
        try:
            while records := [_tracked(tracker, frame) for frame in islice(wanted, batch)]:
                recorder.append(records)
                rows.extend(map(_row, records))
                if progress is not None:
                    progress(float(len(rows)))
        except KeyboardInterrupt:
            stopped = True
    done = _kept(rows, folder, source, stopped)
    if faults:
        raise RunError(f"{faults[0]}; what was tracked is in {folder}") from faults[0]
    return done


def _until(faults: list[RunError], frames: Iterator[Frame]) -> Iterator[Frame]:
    """Frames until they break off, and then why: what was read before is tracked to its end."""
    try:
        yield from frames
    except RunError as fault:
        faults.append(fault)


def _camera(calibration_path: Path, layout: LabelLayout) -> CameraModel:
    """The camera of a calibration; an InputError where it cannot see the labels."""
    camera = load_calibration(calibration_path).camera
    if fault := label_fault(camera, layout, NARROWEST_LABEL_PX):
        raise InputError(fault, file=str(calibration_path))
    return camera


def _kept(rows: list[tuple[float, ...]], folder: Path, source: str, stopped: bool) -> Track:
    """What there is of a source that was tracked to its end, or to where it was stopped."""
    if rows:
        _write(rows, folder / "poses.parquet")
    else:
        (folder / "track.rrd").unlink()  # it has no frame
    # of a camera's stream this is the end
    if stopped and not (rows and whole(source) is not None):
        raise KeyboardInterrupt
    if not rows:
        problem = "no frame could be read; it may be empty or damaged"
        raise InputError(Fault(problem=problem), file=source)
    return Track(folder, len(rows), sum(int(row[-1]) for row in rows))


def _tracked(tracker: Tracker, frame: Frame) -> CameraRecord:
    sighting = tracker.see(frame.image, frame.time_s)
    return CameraRecord(frame.time_s, frame, None, sighting, tracker.estimate(frame.time_s))


def _row(record: CameraRecord) -> tuple[float, ...]:
    estimate = record.estimate
    spread = np.sqrt(np.maximum(estimate.covariance.diagonal(), 0.0))
    numbers = [record.time_s, *estimate.q, *estimate.q_rate, *spread]
    return (*map(float, numbers), float(estimate.labels), float(estimate.valid))


def _write(rows: list[tuple[float, ...]], path: Path) -> None:
    import pyarrow as pa

    columns = np.array(rows).T
    q = q_names((len(columns) - 3) // 3)
    spread = [re.sub("(?=_[^_]+$)", "_std", name) for name in q]
    names = ("time_s", *q, *rate_names(len(q)), *spread, "labels_found", "valid")
    write_parquet(pa.table(dict(zip(names, columns, strict=True))), path)
