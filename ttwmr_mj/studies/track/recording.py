"""The recording of a tracked video: the annotated picture beside the poses."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from ttwmr_mj.recording import layout, style
from ttwmr_mj.recording.camera_view import ELLIPSE_SCALE, CameraView
from ttwmr_mj.recording.layout import Range
from ttwmr_mj.recording.scene.key import Entry, draw_key
from ttwmr_mj.recording.series import Series, SeriesLog, widened
from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.recording.stream.rrd_file import RrdFile
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.log import CameraRecord

Plots = Mapping[str, tuple[str, Series]]  # by name: title and curves
KEY: tuple[Entry, ...] = (
    ("label found", style.FOUND_LABEL, 3.5),
    ("searched for", style.REFERENCE, 1.2),
    ("estimated robot", style.ESTIMATE, 1.2),
    (f"P, 3 σ × {ELLIPSE_SCALE:g}", style.COVARIANCE, 1.2),
)


class TrackRecorder(RrdFile):
    """Writes tracked frames for the Rerun viewer; a context manager.

    Args:
        path: the .rrd file, overwritten; its folder exists.
        name: of the recording.
        camera: the calibrated camera.
        labels: on the robot.
        live: shows it while it is written.

    Raises:
        InputError: the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        camera: CameraModel,
        labels: LabelLayout,
        live: LiveView | None = None,
    ) -> None:
        self._plots = _plots(labels.trailers)
        super().__init__(path, name, _blueprint(name, self._plots), live)
        self._view = CameraView(self._stream, camera, labels)
        self._series = SeriesLog(self._stream)
        self._name = name
        self._ranges: dict[str, Range] = {}
        self._times_s: Range | None = None
        draw_key(self._stream, KEY)

    def append(self, records: Sequence[CameraRecord]) -> None:
        """Record the next frames; what is appended is on disk when this returns."""
        self._check_open()
        self._view.append(records)
        known = [record for record in records if np.isfinite(record.estimate.q).all()]
        if known:
            times_s = np.array([record.time_s for record in known])
            values = _values(known)
            for plot, (_, series) in self._plots.items():
                self._series.append(f"plots/{plot}", series, times_s, values[plot])
                self._ranges[plot] = widened(self._ranges.get(plot), values[plot])
            self._times_s = widened(self._times_s, times_s)
        self.flush()

    def close(self) -> None:
        """Show every plot over the range that its values took, and complete the file."""
        if self._open and self._times_s is not None:
            self._show(_blueprint(self._name, self._plots, self._ranges, self._times_s))
        super().close()


def _plots(trailers: int) -> Plots:
    angles = tuple(f"θ{i}" for i in range(1, trailers + 2))
    colours = (style.TRACTOR, *(style.TRAILER for _ in range(trailers)))
    return {
        "position": ("position of P [mm]", Series(("x", "y"), (style.RIGHT, style.LEFT))),
        "angles": ("angles [rad]", Series(angles, colours)),
        "uncertainty": ("uncertainty of P [mm]", Series(("P, 3 σ",), (style.COVARIANCE,))),
    }


def _values(known: Sequence[CameraRecord]) -> dict[str, FloatArray]:
    """Plot → values (n, curves) of records in which the robot is known."""
    q = np.stack([record.estimate.q for record in known])
    covariance = np.stack([record.estimate.covariance for record in known])
    spread_mm = 3e3 * np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
    return {"position": 1e3 * q[:, :2], "angles": q[:, 2:], "uncertainty": spread_mm[:, None]}


def _blueprint(
    name: str, plots: Plots, ranges: Mapping[str, Range] | None = None, times_s: Range | None = None
) -> rrb.Blueprint:
    views = (
        layout.plot_view(
            f"plots/{plot}",
            title,
            rrb.Corner2D.RightTop if len(series.names) > 1 else None,
            values=(ranges or {}).get(plot),
            times_s=times_s,
        )
        for plot, (title, series) in plots.items()
    )
    states = layout.states_view("tracker", ("tracker",), times_s)
    beside = rrb.Vertical(*views, states, row_shares=[6, 4, 3, 2])
    picture = rrb.Vertical(layout.picture_view(name), layout.key_view(), row_shares=[18, 1])
    return layout.page(rrb.Horizontal(picture, beside, column_shares=[3, 2]))
