"""The recording of a tracked video: the annotated picture beside the poses."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from ttwmr_mj.recording import layout, style
from ttwmr_mj.recording.camera_view import CameraView
from ttwmr_mj.recording.live import LiveView
from ttwmr_mj.recording.rrd_file import RrdFile
from ttwmr_mj.recording.series import Series, SeriesLog
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.log import CameraRecord

PLOTS: dict[str, tuple[str, Series]] = {
    "position": ("position of P [m]", Series(("x", "y"), (style.RIGHT, style.LEFT))),
    "angles": ("angles [rad]", Series(("θ1", "θ2"), (style.TRACTOR, style.TRAILER))),
    "uncertainty": ("uncertainty of P [mm]", Series(("P, 3 σ",), (style.COVARIANCE,))),
}


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
        super().__init__(path, name, _blueprint(name), live)
        self._view = CameraView(self._stream, camera, labels)
        self._series = SeriesLog(self._stream)

    def append(self, records: Sequence[CameraRecord]) -> None:
        """Record the next frames; what is appended is on disk when this returns."""
        self._check_open()
        self._view.append(records)
        known = [record for record in records if np.isfinite(record.estimate.q).all()]
        if known:
            times_s = np.array([record.time_s for record in known])
            values = _values(known)
            for plot, (_, series) in PLOTS.items():
                self._series.append(f"plots/{plot}", series, times_s, values[plot])
        self._stream.flush()


def _values(known: Sequence[CameraRecord]) -> dict[str, FloatArray]:
    """Plot → values (n, curves) of records in which the robot is known."""
    q = np.stack([record.estimate.q for record in known])
    covariance = np.stack([record.estimate.covariance for record in known])
    spread_mm = 3e3 * np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
    return {"position": q[:, :2], "angles": q[:, 2:], "uncertainty": spread_mm[:, None]}


def _blueprint(name: str) -> rrb.Blueprint:
    plots = (
        layout.plot_view(f"plots/{plot}", title, rrb.Corner2D.RightBottom)
        for plot, (title, _) in PLOTS.items()
    )
    beside = rrb.Vertical(*plots, layout.states_view("tracker"))
    return layout.page(rrb.Horizontal(layout.picture_view(name), beside, column_shares=[3, 2]))
