"""The camera's picture in a recording, with what the tracker looked for, found and believes."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import rerun as rr

from ttwmr_mj.recording import style
from ttwmr_mj.recording.layout import PICTURE
from ttwmr_mj.recording.series import StateLog, time_column
from ttwmr_mj.state import BoolArray, FloatArray
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.noise import thinned
from ttwmr_mj.vision.log import CameraRecord
from ttwmr_mj.vision.tracking.estimate import Sighting, Status

FRAME = "frame"  # beside what is drawn over it
JPEG_QUALITY = 60  # the sensor's noise makes pictures large: 20 KiB at 60, 34 KiB at 80
MOST_NAMED = 2  # labels that are not found: more names are wider than a small panel
ELLIPSE_SIGMAS = 3.0
ELLIPSE_SCALE = 50.0  # a standard deviation of 0.1 mm is 0.03 pixels: nothing to see at true size
ANGLE = np.linspace(0.0, 2.0 * np.pi, 33)
CIRCLE: FloatArray = np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=-1)
STATUS_LOOKS = {
    str(status): (label, colour)
    for status, label, colour in zip(
        Status,
        ("tracking", "blind", "lost"),
        (style.ESTIMATE, style.REFERENCE, style.ALERT),
        strict=True,
    )
}
# What never changes is said once: columns of colours cost more than the points. Lengths in px.
OVERLAY_LOOKS: dict[str, tuple[Any, dict[str, Any]]] = {
    "true": (rr.Points2D, {"colors": [style.TRUE_LABEL], "radii": [2.0]}),
    "found": (rr.Points2D, {"colors": [style.FOUND_LABEL], "radii": [3.5]}),
    "hidden": (
        rr.Points2D,
        {"colors": [style.ALERT], "radii": rr.Radius.ui_points([3.0]), "show_labels": True},
    ),
    "search": (rr.Boxes2D, {"colors": [style.REFERENCE]}),
    "estimate": (rr.LineStrips2D, {"colors": [style.ESTIMATE], "radii": [1.2]}),
    "covariance": (rr.LineStrips2D, {"colors": [style.COVARIANCE], "radii": [0.8]}),
}


class CameraView:
    """Everything under camera/ in one recording, and the tracker's state.

    Args:
        stream: of the recording.
        camera: the calibrated camera, which is what the estimate is drawn with.
        layout: the labels on the robot.
        step_px: of a picture's rows and columns, one in this many is kept. Computing and encoding
            the whole of a noisy picture takes as long as the rest of a control period.
    """

    def __init__(
        self, stream: rr.RecordingStream, camera: CameraModel, layout: LabelLayout, step_px: int = 1
    ) -> None:
        self._stream = stream
        self._step_px = step_px
        self._camera = camera
        self._layout = layout
        self._names = [name.replace("_", " ") for name in layout.names]
        self._status = StateLog(stream, "tracker", STATUS_LOOKS)
        for name, (archetype, looks) in OVERLAY_LOOKS.items():
            stream.log(f"{PICTURE}/{name}", archetype.from_fields(**looks), static=True)
        if step_px > 1:  # a pixel that is kept stands for those to its right and below it
            aside = 0.5 - 0.5 * step_px
            enlarged = rr.Transform3D(translation=[aside, aside, 0.0], scale=float(step_px))
            stream.log(f"{PICTURE}/{FRAME}", enlarged, static=True)

    def append(self, records: Sequence[CameraRecord]) -> None:
        """Log the next control periods, oldest first."""
        if not records:
            return
        times_s = np.array([r.time_s for r in records])
        self._status.append(times_s, [str(r.estimate.status) for r in records])
        # what was found is drawn into its own picture, not over that of another moment
        records = [r for r in records if r.frame is not None or r.sighting is None]
        self._pictures([(r.time_s, r.frame) for r in records if r.frame is not None])
        true = [(r.time_s, r.truth) for r in records if r.truth is not None]
        self._points("true", [t for t, _ in true], [_finite(truth.centres_px) for _, truth in true])
        self._sightings([(r.time_s, r.sighting) for r in records if r.sighting is not None])
        known = [r for r in records if np.isfinite(r.estimate.q).all()]
        self._hidden([r for r in known if r.sighting is not None])
        if known:
            q = np.stack([record.estimate.q for record in known])
            spread = np.stack([record.estimate.covariance[:2, :2] for record in known])
            self._lines("estimate", known, self._skeletons(q))
            self._lines("covariance", known, self._ellipses(q, spread))

    def _pictures(self, frames: Sequence[tuple[float, Frame]]) -> None:
        jpeg = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        pictures = [thinned(frame.pixels, self._step_px) for _, frame in frames]
        blobs = [cv2.imencode(".jpg", picture, jpeg)[1].tobytes() for picture in pictures]
        columns = rr.EncodedImage.columns(blob=blobs, media_type=["image/jpeg"] * len(blobs))
        self._send(FRAME, [time_s for time_s, _ in frames], columns)

    def _sightings(self, sightings: Sequence[tuple[float, Sighting]]) -> None:
        times_s = [time_s for time_s, _ in sightings]
        self._points("found", times_s, [_finite(sighting.found_px) for _, sighting in sightings])
        searched = [_finite(sighting.predicted_px) for _, sighting in sightings]
        half = [sighting.search_px for _, sighting in sightings]
        counts = [len(centres) for centres in searched]
        if counts:
            columns = rr.Boxes2D.columns(
                centers=np.concatenate(searched),
                half_sizes=np.repeat(half, counts)[:, None].repeat(2, axis=1),
            )
            self._send("search", times_s, columns.partition(counts))

    def _hidden(self, records: Sequence[CameraRecord]) -> None:
        """The labels that were not found, where the tracker takes them to be.

        The first of a picture names them all: names side by side would cover each other.
        """
        if not records:
            return
        found = [r.sighting.found_px for r in records if r.sighting is not None]
        missing = ~np.isfinite(np.stack(found)[..., 0])
        q = np.stack([record.estimate.q for record in records])
        places = self._camera.project(self._layout.centres_m(q))[missing]
        names = [text for row in missing for text in self._named(row)]
        columns = rr.Points2D.columns(positions=places, labels=names)
        times_s = [record.time_s for record in records]
        self._send("hidden", times_s, columns.partition(missing.sum(axis=1)))

    def _named(self, missing: BoolArray) -> list[str]:
        """A text for every label that is missing in a picture."""
        names = [self._names[label] for label in np.nonzero(missing)[0].tolist()]
        if len(names) > MOST_NAMED:
            names[0] = "no label found" if missing.all() else f"{len(names)} labels not found"
        else:
            names[:1] = [", ".join(names)] if names else []
        return [*names[:1], *[""] * (len(names) - 1)]

    def _points(self, name: str, times_s: list[float], points: Sequence[FloatArray]) -> None:
        if points:
            columns = rr.Points2D.columns(positions=np.concatenate(points))
            self._send(name, times_s, columns.partition([len(part) for part in points]))

    def _lines(self, name: str, records: Sequence[CameraRecord], strips: FloatArray) -> None:
        columns = rr.LineStrips2D.columns(strips=list(strips))
        self._send(name, [record.time_s for record in records], columns)

    def _send(self, name: str, times_s: list[float], columns: Any) -> None:
        if times_s:
            when = [time_column(np.array(times_s))]
            self._stream.send_columns(f"{PICTURE}/{name}", when, columns)

    def _skeletons(self, q: FloatArray) -> FloatArray:
        """(n, 2 + 3·trailers, 2) px: labels of the tractor, then P and those of its trailer, ..."""
        labels = self._layout.centres_m(q)
        pins = np.stack([self._layout.hitches_m(pose) for pose in q])
        height = np.full((len(q), 1), labels[0, :, 2].mean())
        line = [labels[:, :2]]
        for i in range(self._layout.trailers):
            pin = np.concatenate([pins[:, i], height], axis=1)
            line += [pin[:, None], labels[:, 2 * i + 2 : 2 * i + 4]]
        return self._camera.project(np.concatenate(line, axis=1))

    def _ellipses(self, q: FloatArray, covariance: FloatArray) -> FloatArray:
        """(n, 33, 2) px: 3 σ of P, drawn ELLIPSE_SCALE times its size."""
        variance, axes = np.linalg.eigh(covariance)
        reach = ELLIPSE_SCALE * ELLIPSE_SIGMAS * np.sqrt(np.maximum(variance, 0.0))
        around = (CIRCLE * reach[:, None]) @ axes.transpose(0, 2, 1)
        ring = np.empty((len(q), len(CIRCLE), 3))
        ring[..., :2] = q[:, None, :2] + around
        ring[..., 2] = self._layout.height_m.mean()
        return self._camera.project(ring)


def _finite(points: FloatArray) -> FloatArray:
    """The rows (m, 2) of points (labels, 2) that are defined."""
    return points[np.isfinite(points).all(axis=1)]
