"""One run, one .rrd file that a killed process leaves readable."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.recording import style
from ttwmr_mj.recording.blueprint import blueprint
from ttwmr_mj.recording.layout import DETAILS
from ttwmr_mj.recording.plots import Plots
from ttwmr_mj.recording.scene import key
from ttwmr_mj.recording.scene.floor import floor_corners
from ttwmr_mj.recording.scene.key import Entry, draw_key
from ttwmr_mj.recording.scene.robot import Scene, force_scale_m_n
from ttwmr_mj.recording.series import StateLog
from ttwmr_mj.recording.stream.rrd_file import RrdFile
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from ttwmr_mj.recording.camera_view import CameraView
    from ttwmr_mj.recording.stream.live import LiveView
    from ttwmr_mj.vision.camera.labels import LabelLayout
    from ttwmr_mj.vision.camera.model import CameraModel
    from ttwmr_mj.vision.log import CameraRecord

PICTURE_STEP_PX = 2  # 320 × 240 pixels of 640 × 480: about as many as its place on the screen
PACE_LOOKS = {"kept": ("kept", style.IDLE), "behind": ("behind the clock", style.ALERT)}


class RunRecorder(RrdFile):
    """Writes one simulation of a run for the Rerun viewer.

    A context manager; every appended row is on disk when `append` returns, and leaving the context
    by any way closes the file.

    Args:
        path: the .rrd file, overwritten; its folder exists.
        model: the robot to draw, also for runs of the analytic plant.
        robot: the numbers of that robot.
        reference: the whole reference to draw as a path; None draws none.
        name: of the recording, as the viewer lists it.
        summary_markdown: what is known before the run (scenario, seed, ...).
        camera: whether a camera's view will be added (`append_camera`).
        paced: whether it will be said where the run fell behind (`append_pace`).
        live: shows the run while it is recorded.
        footer: as of `RrdFile`.

    Raises:
        InputError: the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        *,
        model: mujoco.MjModel,
        robot: RobotParameters,
        reference: ReferencePath | None,
        name: str,
        summary_markdown: str,
        camera: bool = False,
        paced: bool = False,
        live: LiveView | None = None,
        footer: bool = True,
    ) -> None:
        floor_m = floor_corners(reference)
        self._layout = partial(
            blueprint,
            name,
            reference,
            floor_m,
            camera=camera,
            paced=paced,
            looks_scale=robot.looks_scale,
        )
        super().__init__(path, name, None, live, footer=footer)
        self._robot = robot
        self._summary = summary_markdown
        self._signals: tuple[str, ...] | None = None  # known with the first rows
        self._stream.send_property("scenario", rr.AnyValues(name=name))
        self._report(summary_markdown)
        self._report(summary_markdown, DETAILS)
        self._last_s: float | None = None
        draw_key(self._stream, _key(robot, reference, camera))
        self._scene = Scene(self._stream, model, robot, reference, floor_m)
        self._plots = Plots(self._stream)
        self._camera: CameraView | None = None
        self._pace = StateLog(self._stream, "pace", PACE_LOOKS) if paced else None

    def append(self, rows: Trajectory) -> None:
        """Record the next rows, in the order of time: a second of them, or a whole run at once.

        Rows from the first on whose state is not finite are left out: there is no robot to draw.
        Every signal of the control law gets a plot.

        Raises:
            InputError: the rows are of several simulations.
            ValueError: the recording is closed.
        """
        self._check_open()
        alive = np.isfinite(rows.simulation().q[:, 0]).all(axis=1)
        rows = rows if alive.all() else rows.rows(0, int(alive.argmin()))
        if not len(rows):
            return
        curves = Curves.of(rows, self._robot)
        self._scene.append(rows, curves)
        if (signals := tuple(rows.signals)) != self._signals:
            self._signals = signals
            self._show(self._layout(signals=signals))
        self._plots.append(rows, curves)
        self._last_s = float(rows.time_s[-1])
        self.flush()

    def append_pace(self, time_s: FloatArray, behind: Sequence[bool]) -> None:
        """Record at which of the next samples a run that is held to the clock came too late.

        Args:
            time_s: (n,) of the samples.
            behind: for each.
        """
        self._check_open()
        assert self._pace is not None
        self._pace.append(time_s, ["behind" if late else "kept" for late in behind])

    def append_camera(
        self, camera: CameraModel, layout: LabelLayout, records: Sequence[CameraRecord]
    ) -> None:
        """Record what a camera saw since the last call.

        Args:
            camera: the calibrated camera.
            layout: the labels on the robot.
            records: one per control period, oldest first.
        """
        self._check_open()
        if self._camera is None:
            from ttwmr_mj.recording.camera_view import CameraView

            self._camera = CameraView(self._stream, camera, layout, step_px=PICTURE_STEP_PX)
        self._camera.append(records)
        self.flush()

    def finish(self, result_markdown: str, details_markdown: str = "") -> None:
        """Show how the run ended, and every plot over the range that its values took.

        Args:
            result_markdown: in place of the summary.
            details_markdown: the numbers, above the summary in a tab of their own.
        """
        self._check_open()
        self._report(result_markdown)
        self._report(f"{details_markdown}\n\n{self._summary}", DETAILS)
        if self._last_s is None:
            self._show(self._layout())
        else:
            times_s, ranges = (0.0, self._last_s), self._plots.ranges
            signals = self._signals or ()
            self._show(self._layout(signals=signals, ranges=ranges, times_s=times_s))


def _key(robot: RobotParameters, reference: ReferencePath | None, camera: bool) -> list[Entry]:
    """What is drawn in the scene."""
    entries = [key.REFERENCE] if reference is not None else []
    entries += [key.TRACTOR, key.TRAILER]
    entries += [key.MISS] if reference is not None else []
    entries += [key.ESTIMATE] if camera else []
    return [*entries, (f"force, {1e3 * force_scale_m_n(robot):g} mm/N", style.FORCE, 1.6)]
