"""The recording of a tracked video: the annotated picture beside the poses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ttwmr_mj.recording import style
from ttwmr_mj.recording.blueprint import PICTURE, WHOLE_RUN
from ttwmr_mj.recording.camera_view import CameraView
from ttwmr_mj.recording.rrd_file import RrdFile
from ttwmr_mj.recording.timeline import TIMELINE, time_column
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.log import CameraRecord

# entity → title, names, colours, columns of q
PLOTS = {
    "position": ("position of P [m]", ("x", "y"), (style.RIGHT, style.LEFT), (0, 1)),
    "angles": ("angles [rad]", ("θ1", "θ2"), (style.TRACTOR, style.TRAILER), (2, 3)),
}
SPREAD = "uncertainty"


class TrackRecorder(RrdFile):
    """Writes tracked frames for the Rerun viewer; a context manager.

    Args:
        path: the .rrd file, overwritten; its folder exists.
        name: of the recording.
        camera: the calibrated camera.
        layout: the labels on the robot.

    Raises:
        InputError: the file cannot be created.
    """

    def __init__(self, path: Path, name: str, camera: CameraModel, layout: LabelLayout) -> None:
        super().__init__(path, name, _blueprint(name))
        self._view = CameraView(self._stream, camera, layout)
        for plot, (_, names, colours, _) in PLOTS.items():
            looks = rr.SeriesLines(names=names, colors=colours)
            self._stream.log(f"plots/{plot}", looks, static=True)
        looks = rr.SeriesLines(names=["P, 3 σ"], colors=[style.COVARIANCE])
        self._stream.log(f"plots/{SPREAD}", looks, static=True)

    def append(self, records: Sequence[CameraRecord]) -> None:
        """Record the next frames; what is appended is on disk when this returns."""
        self._check_open()
        self._view.append(records)
        known = [record for record in records if np.isfinite(record.estimate.q).all()]
        if known:
            now = time_column(np.array([record.time_s for record in known]))
            q = np.stack([record.estimate.q for record in known])
            for plot, (_, _, _, columns) in PLOTS.items():
                values = rr.Scalars.columns(scalars=q[:, columns])
                self._stream.send_columns(f"plots/{plot}", [now], values)
            covariance = np.stack([record.estimate.covariance for record in known])
            spread = 3e3 * np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
            values = rr.Scalars.columns(scalars=spread[:, None])
            self._stream.send_columns(f"plots/{SPREAD}", [now], values)
        self._stream.flush()


def _blueprint(name: str) -> rrb.Blueprint:
    titles = {plot: looks[0] for plot, looks in PLOTS.items()} | {SPREAD: "uncertainty of P [mm]"}
    plots = (
        rrb.TimeSeriesView(origin=f"plots/{plot}", name=title, axis_x=WHOLE_RUN)
        for plot, title in titles.items()
    )
    tracker = rrb.StateTimelineView(origin="flags", name="tracker", time_view=WHOLE_RUN)
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial2DView(origin=PICTURE, name=name, background=(24, 26, 30)),
            rrb.Vertical(*plots, tracker),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
