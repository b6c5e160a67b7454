"""What a run leaves while it goes on: rows, recording and frames, written beside the loop."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

from ttwmr_mj.results.row_stream import ROWS_FILE, RowStream
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.closed_loop.pace import Pace, behind
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.process.background import Background
from ttwmr_mj.runs.report import summary
from ttwmr_mj.scenario.schema import Scenario

if TYPE_CHECKING:
    from ttwmr_mj.recording.run_recorder import RunRecorder
    from ttwmr_mj.recording.stream.live import LiveView
    from ttwmr_mj.vision.coco import FrameExport
    from ttwmr_mj.vision.sensor import CameraSensor

RECORDING_FILE = "run.rrd"
LONG_S = 120.0  # runs beyond it are recorded without a table of contents, which takes memory
# of a camera, one in this many is shown, 10 a second, as computing and encoding them takes time
PICTURES_EVERY = 3
Progress = Callable[[float], None]


def frames_every(scenario: Scenario) -> int:
    """A run keeps one frame of its camera in this many, for its files; 0: none."""
    if scenario.output.save_frames:
        return 1
    return PICTURES_EVERY if scenario.output.recording else 0


class Records:
    """Hears the rows of a run and writes them; a context manager that closes all files.

    Attributes:
        rows: every row so far, readable whatever becomes of the process.
    """

    def __init__(
        self,
        experiment: Experiment,
        folder: Path,
        pace: Pace,
        live: LiveView | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Arguments as of `execute.run_experiment`."""
        self.rows = RowStream(folder / ROWS_FILE)
        self._recording = folder / RECORDING_FILE
        self._experiment, self._pace, self._progress = experiment, pace, progress
        self._open = partial(_recorder, experiment, folder, pace, live)
        self._recorder: RunRecorder | None = None
        self._frames = _frame_export(experiment.scenario, folder)
        self._background = Background()
        self._closing = ExitStack()
        self._reported = 0

    def __enter__(self) -> Self:
        self._closing.callback(self._close)
        self._closing.enter_context(self._background)
        if self._experiment.scenario.output.recording:  # beside the loop: it takes some 50 ms
            self._background.do(self._open_recorder)
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        with suppress(OSError) if kind else nullcontext():  # the first fault is told
            self._closing.__exit__(kind, *rest)

    def report(self, rows: Trajectory) -> None:
        """Take the new rows of the run, and the frames of its camera."""
        late = behind(self._pace.lag_s[self._reported : self._reported + len(rows)])
        self._reported += len(rows)
        camera = None
        if self._experiment.scenario.sensing.kind == "camera":
            camera = cast("CameraSensor", self._experiment.sensor)
        records = [] if camera is None else camera.drain_log()

        def record() -> None:
            self.rows.append(rows)
            if self._recorder is not None:
                self._recorder.append(rows)
                if late:
                    self._recorder.append_pace(rows.time_s, late)
                if camera is not None:
                    seen_by = camera.trackers[0].camera
                    self._recorder.append_camera(seen_by, camera.layout, records)
            if self._frames is not None and camera is not None:
                self._frames.add(camera.layout, records)

        self._background.do(record)
        if self._progress is not None and len(rows):
            self._progress(float(rows.time_s[-1]))

    def wait(self) -> None:
        """Wait until all that was reported is written; re-raises what went wrong."""
        self._background.wait()

    def finish(self, result_markdown: str, details_markdown: str) -> None:
        """Tell how the run ended; the recording is complete then, and so are the frames."""
        if self._recorder is not None:
            self._recorder.finish(result_markdown, details_markdown)
            self._recorder.close()
        if self._frames is not None:
            self._frames.finish()

    def _open_recorder(self) -> None:
        self._recorder = self._open()

    def _close(self) -> None:
        self.rows.close()
        if self._recorder is not None:
            self._recorder.close()
        if not self._reported:  # a recording without a row is none
            self._recording.unlink(missing_ok=True)


def _frame_export(scenario: Scenario, folder: Path) -> FrameExport | None:
    """Where the camera's frames go, if they are wanted; the loader refuses the wish without one."""
    if not scenario.output.save_frames:
        return None
    from ttwmr_mj.vision.coco import FrameExport

    return FrameExport(folder / "frames")


def _recorder(
    experiment: Experiment, folder: Path, pace: Pace, live: LiveView | None
) -> RunRecorder:
    """The recording of this run, open and still without rows."""
    from ttwmr_mj.recording.run_recorder import RunRecorder

    scenario = experiment.scenario
    return RunRecorder(
        folder / RECORDING_FILE,
        model=_drawable_model(experiment),
        robot=scenario.robot,
        reference=experiment.reference,
        name=scenario.name,
        summary_markdown=summary(scenario),
        camera=scenario.sensing.kind == "camera",
        paced=bool(pace.speed),
        live=live,
        footer=live is None and scenario.duration_s <= LONG_S,
    )


def _drawable_model(experiment: Experiment) -> Any:
    """The MjModel to draw: the plant's own, or one of the same robot for the analytic plant."""
    if hasattr(experiment.plant, "model"):
        return experiment.plant.model
    from ttwmr_mj.plants.model.mjcf import build_model

    return build_model(experiment.scenario.robot, experiment.scenario.plant.contact)
