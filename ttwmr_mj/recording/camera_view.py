"""The camera's picture in a recording, with what the tracker looked for, found and believes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
import rerun as rr

from ttwmr_mj.recording import style
from ttwmr_mj.recording.blueprint import PICTURE
from ttwmr_mj.recording.timeline import time_column
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.log import CameraRecord
from ttwmr_mj.vision.tracking.estimate import Status

TRACKER = "flags/tracker"
JPEG_QUALITY = 60  # the sensor's noise makes pictures large: 20 KiB at 60, 34 KiB at 80
ELLIPSE_SIGMAS = 3.0
ELLIPSE_SCALE = 50.0  # a standard deviation of 0.1 mm is 0.03 pixels: nothing to see at true size
CIRCLE: FloatArray = np.stack(
    [np.cos(np.linspace(0, 2 * np.pi, 33)), np.sin(np.linspace(0, 2 * np.pi, 33))], axis=-1
)


class CameraView:
    """Everything under camera/ in one recording, and the tracker's state.

    Args:
        stream: of the recording.
        camera: the calibrated camera, which is what the estimate is drawn with.
        layout: the labels on the robot.
        show_every: of so many frames one is kept as a picture; what was found, of all.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        camera: CameraModel,
        layout: LabelLayout,
        show_every: int = 1,
    ) -> None:
        self._stream = stream
        self._camera = camera
        self._layout = layout
        self._status: str | None = None
        self._show_every = show_every
        self._arrived = 0
        looks = rr.StateConfiguration(
            values=[str(status) for status in Status],
            labels=[" ", "blind", "lost"],
            colors=[style.ESTIMATE, style.REFERENCE, style.ALERT],
        )
        stream.log(TRACKER, looks, static=True)
        # what never changes is said once: columns of colours cost more than the points
        self._look("true", rr.Points2D, style.TRUE_LABEL, 2.0)
        self._look("found", rr.Points2D, style.FOUND_LABEL, 3.5)
        self._look("search", rr.Boxes2D, style.REFERENCE, None)
        self._look("estimate", rr.LineStrips2D, style.ESTIMATE, 1.2)
        self._look("covariance", rr.LineStrips2D, style.COVARIANCE, 0.8)

    def _look(
        self,
        name: str,
        archetype: type[rr.Points2D] | type[rr.Boxes2D] | type[rr.LineStrips2D],
        colour: style.Colour,
        radius_px: float | None,
    ) -> None:
        radii = None if radius_px is None else [radius_px]
        look = archetype.from_fields(colors=[colour], radii=radii)
        self._stream.log(f"{PICTURE}/{name}", look, static=True)

    def append(self, records: Sequence[CameraRecord]) -> None:
        """Log the next control periods, oldest first."""
        if not records:
            return
        arrived = [record for record in records if record.frame is not None]
        self._pictures(self._to_show(arrived))
        self._truths(arrived)
        self._sightings([record for record in records if record.sighting is not None])
        known = [record for record in records if np.isfinite(record.estimate.q).all()]
        if known:
            self._estimates(known)
        self._states(records)

    def _to_show(self, records: Sequence[CameraRecord]) -> list[CameraRecord]:
        """The records whose frames are shown."""
        first = -self._arrived % self._show_every
        self._arrived += len(records)
        return list(records[first :: self._show_every])

    def _pictures(self, records: Sequence[CameraRecord]) -> None:
        if not records:
            return
        jpeg = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        blobs = [
            cv2.imencode(".jpg", record.frame.image, jpeg)[1].tobytes()
            for record in records
            if record.frame is not None
        ]
        columns = rr.EncodedImage.columns(blob=blobs, media_type=["image/jpeg"] * len(blobs))
        self._stream.send_columns(PICTURE, [_times(records)], columns)

    def _truths(self, records: Sequence[CameraRecord]) -> None:
        """Where the labels really are, of simulated frames."""
        truths = [
            _finite(record.frame.truth.centres_px)
            for record in records
            if record.frame is not None and record.frame.truth is not None
        ]
        if truths and len(truths) == len(records):
            self._points("true", records, truths)

    def _sightings(self, records: Sequence[CameraRecord]) -> None:
        if not records:
            return
        sightings = [record.sighting for record in records if record.sighting is not None]
        found = [_finite(sighting.found_px) for sighting in sightings]
        self._points("found", records, found)
        searched = [_finite(sighting.predicted_px) for sighting in sightings]
        half = [
            np.full_like(centres, sighting.search_px)
            for centres, sighting in zip(searched, sightings, strict=True)
        ]
        columns = rr.Boxes2D.columns(
            centers=np.concatenate(searched), half_sizes=np.concatenate(half)
        )
        counts = [len(centres) for centres in searched]
        path = f"{PICTURE}/search"
        self._stream.send_columns(path, [_times(records)], columns.partition(counts))

    def _points(
        self, name: str, records: Sequence[CameraRecord], points: Sequence[FloatArray]
    ) -> None:
        columns = rr.Points2D.columns(positions=np.concatenate(points))
        parts = columns.partition([len(part) for part in points])
        self._stream.send_columns(f"{PICTURE}/{name}", [_times(records)], parts)

    def _estimates(self, records: Sequence[CameraRecord]) -> None:
        """The estimated halves as lines through P, and P's covariance, enlarged."""
        self._lines("estimate", records, self._skeleton)
        self._lines("covariance", records, self._ellipse)

    def _lines(
        self,
        name: str,
        records: Sequence[CameraRecord],
        draw: Callable[[CameraRecord], FloatArray],
    ) -> None:
        columns = rr.LineStrips2D.columns(strips=[draw(record) for record in records])
        self._stream.send_columns(f"{PICTURE}/{name}", [_times(records)], columns)

    def _skeleton(self, record: CameraRecord) -> FloatArray:
        """(5, 2) px: front of the tractor, its rear, P, front of the trailer, its rear."""
        labels = self._layout.centres_m(record.estimate.q)
        hitch = np.append(record.estimate.q[:2], labels[:, 2].mean())
        line = np.stack([labels[0], labels[1], hitch, labels[2], labels[3]])
        return self._camera.project(line)

    def _ellipse(self, record: CameraRecord) -> FloatArray:
        """(33, 2) px: 3 σ of P, drawn ELLIPSE_SCALE times its size."""
        variance, axes = np.linalg.eigh(record.estimate.covariance[:2, :2])
        reach = ELLIPSE_SCALE * ELLIPSE_SIGMAS * np.sqrt(np.maximum(variance, 0.0))
        ring = record.estimate.q[:2] + (CIRCLE * reach) @ axes.T
        height = np.full((len(ring), 1), float(self._layout.height_m.mean()))
        return self._camera.project(np.concatenate([ring, height], axis=1))

    def _states(self, records: Sequence[CameraRecord]) -> None:
        """The tracker's state where it changes."""
        changes: list[tuple[float, str]] = []
        for record in records:
            status = str(record.estimate.status)
            if status != self._status:
                changes.append((record.time_s, status))
                self._status = status
        if changes:
            times = time_column(np.array([time_s for time_s, _ in changes]))
            states = rr.StateChange.columns(state=[status for _, status in changes])
            self._stream.send_columns(TRACKER, [times], states)


def _times(records: Sequence[CameraRecord]) -> rr.TimeColumn:
    return time_column(np.array([record.time_s for record in records]))


def _finite(points: FloatArray) -> FloatArray:
    """The rows (m, 2) of points (4, 2) that are defined."""
    return points[np.isfinite(points).all(axis=1)]
