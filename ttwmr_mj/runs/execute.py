"""One run from scenario to run folder: what `ttwmr run` does."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ttwmr_mj.files import write_parquet
from ttwmr_mj.results.trajectory import Trajectory, physics_rate_table
from ttwmr_mj.runs.background import Background
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.folder import write_manifest, write_resolved
from ttwmr_mj.runs.loop import Outcome
from ttwmr_mj.runs.metrics import metrics_of, write_result
from ttwmr_mj.runs.pace import Pace, behind
from ttwmr_mj.runs.report import details_text, figure_title, result_text, summary
from ttwmr_mj.runs.stopwatch import Stopwatch
from ttwmr_mj.runs.verdict import demands_of
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import RobotState

if TYPE_CHECKING:
    from ttwmr_mj.plants.contact import ContactPlant
    from ttwmr_mj.recording.live import LiveView
    from ttwmr_mj.recording.run_recorder import RunRecorder
    from ttwmr_mj.vision.coco import FrameExport
    from ttwmr_mj.vision.sensor import CameraSensor

LOOP_PARTS = ("plant", "sensing", "controller", "loop")
PHYSICS_FILE = "physics.parquet"
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Run:
    """What a run left behind.

    Attributes:
        folder: the run folder.
        outcome: how it ended.
        metrics: as in metrics.json.
        wall_time_s: by part: "setup", those of LOOP_PARTS, "recording", "files", "figures".
        pace: how the pace was kept, in words; empty where there was none to keep.
    """

    folder: Path
    outcome: Outcome
    metrics: dict[str, Any]
    wall_time_s: dict[str, float]
    pace: str = ""


def run_scenario(
    scenario: Scenario,
    folder: Path,
    *,
    scenario_folder: Path | None = None,
    command_line: list[str] | None = None,
    progress: Progress | None = None,
    live: LiveView | None = None,
    pace: Pace | None = None,
) -> Run:
    """Run a scenario and write its run folder.

    Args:
        scenario: what to run.
        folder: an existing folder for the files.
        scenario_folder: where a custom controller is looked for first.
        command_line: for the manifest.
        progress: called now and then with the simulated time [s].
        live: shows the recording while it is written.
        pace: how fast; None: as fast as it can.

    Raises:
        InputError: the scenario cannot be built.
    """
    given, folder = folder, folder.absolute()  # a law of the user's may change the directory
    experiment = Experiment(scenario, scenario_folder)
    done = run_experiment(
        experiment, folder, command_line=command_line, progress=progress, live=live, pace=pace
    )
    return replace(done, folder=given)


def run_experiment(
    experiment: Experiment,
    folder: Path,
    *,
    command_line: list[str] | None = None,
    progress: Progress | None = None,
    live: LiveView | None = None,
    pace: Pace | None = None,
    replayed: Callable[[Result], Scenario] | None = None,
) -> Run:
    """Run what has been built; arguments as of `run_scenario`.

    Args:
        experiment: not yet run.
        folder: an existing folder for the files.
        command_line: for the manifest.
        progress: called now and then with the simulated time [s].
        live: shows the recording while it is written.
        pace: how fast; None: as fast as it can.
        replayed: the scenario that the files tell, once it is known how the run went; None: the
            experiment's own.
    """
    pace = pace or Pace()
    watch = Stopwatch()
    scenario = experiment.scenario
    write_resolved(folder, scenario, experiment.folder)
    write_manifest(folder, scenario, command_line or [])
    contact = _physics_rate_plant(experiment)
    if contact:
        contact.keep_physics_rate()
    watch.lap("setup")
    frames = _frame_export(scenario, folder)
    result = _simulate(experiment, folder, frames, progress, live, pace, replayed)
    if replayed is not None:
        scenario = result.scenario
        write_resolved(folder, scenario, experiment.folder)
    if frames is not None:
        frames.finish()
    watch.lap("recording")
    shares = _shares(watch, result)
    metrics = metrics_of(result, scenario, sum(shares.values()))
    write_result(folder, result.trajectory, metrics)
    if contact:
        time_s, states, wheels = contact.physics_rate_states()
        state = RobotState(states.q[0], states.q_rate[0])
        write_parquet(physics_rate_table(time_s, state, wheels[0]), folder / PHYSICS_FILE)
    watch.lap("files")
    if len(result.trajectory) > 1:
        _draw(result.trajectory, scenario, metrics, folder)
    watch.lap("figures")
    return Run(folder, result.outcomes[0], metrics, {**watch.parts, **shares}, pace.told())


def _draw(
    trajectory: Trajectory, scenario: Scenario, metrics: dict[str, Any], folder: Path
) -> None:
    """The figures that are wanted."""
    if scenario.output.figures:
        from ttwmr_mj.figures.summary import write_summary

        write_summary(trajectory, scenario.robot, folder, figure_title(scenario, metrics))
    if scenario.output.paper_plots:
        from ttwmr_mj.figures.run import write_run_figures

        write_run_figures(trajectory, scenario.robot, folder / "figures", scenario.name)


def _physics_rate_plant(experiment: Experiment) -> ContactPlant | None:
    """The plant, if its every step is wanted; the loader refuses the wish on the analytic one."""
    if not experiment.scenario.output.physics_rate:
        return None
    from ttwmr_mj.plants.contact import ContactPlant

    return experiment.plant if isinstance(experiment.plant, ContactPlant) else None


def _shares(watch: Stopwatch, result: Result) -> dict[str, float]:
    """Wall time up to now by part; what the loop did not take of "recording" is recording.

    What a run waited to keep its pace is in none.
    """
    loop = {part: result.wall_time_s.get(part, 0.0) for part in LOOP_PARTS}
    waited_s = result.wall_time_s.get("pace", 0.0)
    recording_s = watch.parts["recording"] - sum(loop.values()) - waited_s
    return {"setup": watch.parts["setup"], **loop, "recording": recording_s}


def _simulate(
    experiment: Experiment,
    folder: Path,
    frames: FrameExport | None,
    progress: Progress | None,
    live: LiveView | None,
    pace: Pace,
    replayed: Callable[[Result], Scenario] | None,
) -> Result:
    """Run, with a recorder open if one is wanted: the recording is readable whatever happens."""
    scenario = experiment.scenario
    with ExitStack() as stack:
        recorders: list[RunRecorder] = []  # one, once it is open, or none

        def close() -> None:
            for recorder in recorders:
                recorder.close()

        stack.callback(close)
        background = stack.enter_context(Background())
        if scenario.output.recording:  # opened beside the loop, which takes some 50 ms
            background.do(lambda: recorders.append(_recorder(experiment, folder, pace, live)))
        report = _reporter(experiment, background, recorders, frames, progress, pace)
        result = experiment.run(report, pace=pace)
        background.wait()
        if replayed is not None:
            scenario = replayed(result)
            asked = demands_of(scenario, experiment.reference)
            result = replace(result, scenario=scenario, demands=asked)
        for recorder in recorders:
            wall_time_s = sum(result.wall_time_s.values())
            metrics = metrics_of(result, scenario, wall_time_s)
            recorder.finish(result_text(scenario, metrics, pace.told()), details_text(metrics))
    return result


def _reporter(
    experiment: Experiment,
    background: Background,
    recorders: list[RunRecorder],
    frames: FrameExport | None,
    progress: Progress | None,
    pace: Pace,
) -> Callable[[Trajectory], None]:
    """What is done with the new rows of a run, and with the frames of its camera."""
    reported = 0

    def report(rows: Trajectory) -> None:
        nonlocal reported
        late = behind(pace.lag_s[reported : reported + len(rows)])
        reported += len(rows)
        camera = None
        if experiment.scenario.sensing.kind == "camera":
            camera = cast("CameraSensor", experiment.sensor)
        records = [] if camera is None else camera.drain_log()

        def record() -> None:
            for recorder in recorders:
                recorder.append(rows)
                if late:
                    recorder.append_pace(rows.time_s, late)
                if camera is not None:
                    recorder.append_camera(camera.trackers[0].camera, camera.layout, records)
            if frames is not None and camera is not None:
                frames.add(camera.layout, records)

        background.do(record)
        if progress is not None and len(rows):
            progress(float(rows.time_s[-1]))

    return report


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
        folder / "run.rrd",
        model=_drawable_model(experiment),
        robot=scenario.robot,
        reference=experiment.reference,
        name=scenario.name,
        summary_markdown=summary(scenario),
        camera=scenario.sensing.kind == "camera",
        paced=bool(pace.speed),
        live=live,
    )


def _drawable_model(experiment: Experiment) -> Any:
    """The MjModel to draw: the plant's own, or one of the same robot for the analytic plant."""
    if hasattr(experiment.plant, "model"):
        return experiment.plant.model
    from ttwmr_mj.plants.mjcf import build_model

    return build_model(experiment.scenario.robot, experiment.scenario.plant.contact)
