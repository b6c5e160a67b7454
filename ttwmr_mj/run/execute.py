"""One run from scenario to run folder: what `ttwmr run` does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ttwmr_mj.files import write_json, write_parquet
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.results.trajectory import Trajectory, physics_rate_table
from ttwmr_mj.run.background import Background
from ttwmr_mj.run.experiment import Experiment, Result
from ttwmr_mj.run.folder import write_manifest, write_resolved
from ttwmr_mj.run.loop import Outcome
from ttwmr_mj.run.stopwatch import Stopwatch
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import RobotState

if TYPE_CHECKING:
    from ttwmr_mj.plants.contact import ContactPlant
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
    """

    folder: Path
    outcome: Outcome
    metrics: dict[str, Any]
    wall_time_s: dict[str, float]


def run_scenario(
    scenario: Scenario,
    folder: Path,
    *,
    scenario_folder: Path | None = None,
    command_line: list[str] | None = None,
    progress: Progress | None = None,
) -> Run:
    """Run a scenario and write its run folder.

    Args:
        scenario: what to run.
        folder: an existing folder for the files.
        scenario_folder: where a custom controller is looked for first.
        command_line: for the manifest.
        progress: called now and then with the simulated time [s].

    Raises:
        InputError: the scenario cannot be built.
    """
    watch = Stopwatch()
    experiment = Experiment(scenario, scenario_folder)
    write_resolved(folder, scenario)
    write_manifest(folder, scenario, command_line or [])
    contact = _physics_rate_plant(experiment)
    if contact:
        contact.keep_physics_rate()
    watch.lap("setup")
    frames = _frame_export(scenario, folder)
    if scenario.output.recording:
        result = _recorded(experiment, folder, frames, progress)
    else:
        with Background() as background:
            result = experiment.run(_reporter(experiment, background, None, frames, progress))
    if frames is not None:
        frames.finish()
    watch.lap("recording")
    shares = _shares(watch, result)
    metrics = metrics_of(result, scenario, sum(shares.values()))
    write_json(folder / "metrics.json", metrics)
    write_parquet(result.trajectory.to_table(), folder / "trajectory.parquet")
    if contact:
        time_s, states, wheels = contact.physics_rate_states()
        state = RobotState(states.q[0], states.q_rate[0])
        write_parquet(physics_rate_table(time_s, state, wheels[0]), folder / PHYSICS_FILE)
    watch.lap("files")
    if scenario.output.figures and len(result.trajectory) > 1:
        from ttwmr_mj.figures.run import write_run_figures

        write_run_figures(result.trajectory, scenario.robot, folder / "figures", scenario.name)
    watch.lap("figures")
    return Run(folder, result.outcomes[0], metrics, {**watch.parts, **shares})


def _physics_rate_plant(experiment: Experiment) -> ContactPlant | None:
    """The plant, if its every step is wanted; the loader refuses the wish on the analytic one."""
    if not experiment.scenario.output.physics_rate:
        return None
    from ttwmr_mj.plants.contact import ContactPlant

    return experiment.plant if isinstance(experiment.plant, ContactPlant) else None


def _shares(watch: Stopwatch, result: Result) -> dict[str, float]:
    """Wall time up to now by part; what the loop did not take of "recording" is recording."""
    loop = {part: result.wall_time_s.get(part, 0.0) for part in LOOP_PARTS}
    recording_s = watch.parts["recording"] - sum(loop.values())
    return {"setup": watch.parts["setup"], **loop, "recording": recording_s}


def metrics_of(result: Result, scenario: Scenario, wall_time_s: float) -> dict[str, Any]:
    """metrics.json: status first, then the numbers."""
    outcome = result.outcomes[0]
    numbers: Metrics = score(result.trajectory, scenario.robot)[0]
    return {
        "status": outcome.status,
        "reason": outcome.reason,
        "end_time_s": outcome.time_s,
        **numbers,
        "control_time_per_sample_us": _control_time_us(result),
        **_control_overruns(result, scenario.control.sampling_time_s),
        "wall_time_s": wall_time_s,
        "real_time_factor": outcome.time_s / wall_time_s,
    }


def _control_time_us(result: Result) -> float:
    """Mean wall time of the controller per control sample [µs]."""
    return 1e6 * result.wall_time_s.get("controller", 0.0) / max(len(result.trajectory), 1)


def _control_overruns(result: Result, period_s: float) -> dict[str, Any]:
    """Commands that took longer than a period, on this machine under its load, and the slowest.

    On a real robot they would have come too late. Here they are used all the same, so that results
    do not depend on the machine.
    """
    took = result.control_time_s
    return {
        "control_overruns": int((took > period_s).sum()),
        "control_slowest_s": float(took.max()) if took.size else None,
    }


def _reporter(
    experiment: Experiment,
    background: Background,
    recorder: RunRecorder | None,
    frames: FrameExport | None,
    progress: Progress | None,
) -> Callable[[Trajectory], None]:
    """What is done with the new rows of a run, and with the frames of its camera."""

    def report(rows: Trajectory) -> None:
        camera = None
        if experiment.scenario.sensing.kind == "camera":
            camera = cast("CameraSensor", experiment.sensor)
        records = [] if camera is None else camera.drain_log()

        def record() -> None:
            if recorder is not None:
                recorder.append(rows)
                if camera is not None:
                    recorder.append_camera(camera.trackers[0].camera, camera.layout, records)
            if frames is not None:
                frames.add(records)

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


def _recorded(
    experiment: Experiment, folder: Path, frames: FrameExport | None, progress: Progress | None
) -> Result:
    """Run with a recorder open; the recording is readable whatever happens."""
    from ttwmr_mj.recording.run_recorder import RunRecorder

    scenario = experiment.scenario
    with (
        RunRecorder(
            folder / "run.rrd",
            model=_drawable_model(experiment),
            robot=scenario.robot,
            reference=experiment.reference,
            name=scenario.name,
            summary_markdown=summary(scenario),
            camera=scenario.sensing.kind == "camera",
        ) as recorder,
        Background() as background,
    ):
        result = experiment.run(_reporter(experiment, background, recorder, frames, progress))
        background.wait()
        wall_time_s = sum(result.wall_time_s.values())
        recorder.finish(result_text(scenario, metrics_of(result, scenario, wall_time_s)))
    return result


def _drawable_model(experiment: Experiment) -> Any:
    """The MjModel to draw: the plant's own, or one of the same robot for the analytic plant."""
    if hasattr(experiment.plant, "model"):
        return experiment.plant.model
    from ttwmr_mj.plants.mjcf import build_model

    return build_model(experiment.scenario.robot, experiment.scenario.plant.contact)


def summary(scenario: Scenario) -> str:
    """What was asked, for the recording's text panel."""
    start, plant = scenario.initial, scenario.plant
    rows = {
        "plant": plant.kind,
        "controller": scenario.controller.kind,
        "reference": scenario.reference.kind,
        "start": start.kind,
        "servo": scenario.robot.servo.preset,
        "control period": f"{scenario.control.sampling_time_s * 1e3:g} ms",
        "duration": f"{scenario.duration_s:g} s",
        "seed": str(scenario.seed),
    }
    table = "\n".join(f"| {key} | {value} |" for key, value in rows.items())
    return (
        f"# {scenario.name}\n\n{scenario.description}\n\n| setting | value |\n|---|---|\n{table}\n"
    )


RESULT_ROWS = (
    ("tractor_rmse_m", "P, rms error", 1e3, "mm"),
    ("steady_tractor_rmse_m", "P, rms error, 2nd half", 1e3, "mm"),
    ("tractor_final_error_m", "P, final error", 1e3, "mm"),
    ("steady_trailer_rmse_m", "trailer COM, rms error, 2nd half", 1e3, "mm"),
    ("steady_theta1_rmse_rad", "θ1, rms error, 2nd half", 1e3, "mrad"),
    ("steady_theta2_rmse_rad", "θ2, rms error, 2nd half", 1e3, "mrad"),
    ("settling_time_s", "settled (1 cm) after", 1.0, "s"),
    ("wheel_speed_max_rad_s", "fastest wheel", 1.0, "rad/s"),
    ("saturated_share", "saturated samples", 100.0, "%"),
    ("near_singular_share", "near-singular samples", 100.0, "%"),
    ("control_overruns", "commands later than a period", 1.0, ""),
    ("control_slowest_s", "slowest command", 1e3, "ms"),
)


def in_unit(value: float | None, scale: float, unit: str) -> str:
    """A metric for reading: three digits and its unit, or the word undefined."""
    return "undefined" if value is None else f"{value * scale:.3g} {unit}".rstrip()


def result_text(scenario: Scenario, metrics: dict[str, Any]) -> str:
    """What it was and how it ended, for the recording's text panel."""
    what = f"{scenario.plant.kind} · {scenario.controller.kind} · seed {scenario.seed}"
    status = metrics["status"] + (f": {metrics['reason']}" if metrics["reason"] else "")
    lines = [
        f"| {label} | {in_unit(metrics[key], scale, unit)} |"
        for key, label, scale, unit in RESULT_ROWS
    ]
    return f"**{status}** · {what}\n\n| result | value |\n|---|---|\n" + "\n".join(lines) + "\n"
