"""One run from scenario to run folder: what `ttwmr run` does."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ttwmr_mj.results.parquet import write_parquet
from ttwmr_mj.results.trajectory import Trajectory, physics_rate_table
from ttwmr_mj.runs.closed_loop.loop import Outcome
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.closed_loop.stopwatch import Stopwatch
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.files.folder import write_manifest, write_resolved
from ttwmr_mj.runs.judgement.verdict import demands_of
from ttwmr_mj.runs.metrics import metrics_of, write_result
from ttwmr_mj.runs.process.signals import held_back
from ttwmr_mj.runs.records import Progress, Records, frames_every
from ttwmr_mj.runs.report import details_text, figure_title, result_text
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import RobotState

if TYPE_CHECKING:
    from ttwmr_mj.plants.contact import ContactPlant
    from ttwmr_mj.recording.stream.live import LiveView

LOOP_PARTS = ("plant", "sensing", "controller", "loop")
PHYSICS_FILE = "physics.parquet"


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
    write_resolved(folder, experiment.scenario, experiment.folder)
    write_manifest(folder, experiment.scenario, command_line or [])
    contact = _physics_rate_plant(experiment)
    if contact:
        contact.keep_physics_rate()
    with ExitStack() as ending, Records(experiment, folder, pace, live, progress) as records:
        watch.lap("setup")
        result = experiment.run(
            records.report, pace=pace, frames_every=frames_every(experiment.scenario)
        )
        ending.enter_context(held_back())  # until metrics.json says that the run is whole
        records.wait()
        result = _finished(experiment, records, result, pace, replayed)
        watch.lap("recording")
        shares = _shares(watch, result)
        if replayed is not None:
            write_resolved(folder, result.scenario, experiment.folder)
        if contact:
            _write_physics(contact, folder)
        metrics = metrics_of(result, result.scenario, sum(shares.values()))
        write_result(folder, result.trajectory, metrics)
        records.rows.delete()
        watch.lap("files")
    if len(result.trajectory) > 1:
        _draw(result.trajectory, result.scenario, metrics, folder)
    watch.lap("figures")
    return Run(folder, result.outcomes[0], metrics, {**watch.parts, **shares}, pace.told())


def _write_physics(contact: ContactPlant, folder: Path) -> None:
    time_s, states, wheels = contact.physics_rate_states()
    state = RobotState(states.q[0], states.q_rate[0])
    write_parquet(physics_rate_table(time_s, state, wheels[0]), folder / PHYSICS_FILE)


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


def _finished(
    experiment: Experiment,
    records: Records,
    result: Result,
    pace: Pace,
    replayed: Callable[[Result], Scenario] | None,
) -> Result:
    """Complete the recording; the result, of the scenario that the files tell."""
    if replayed is not None:
        scenario = replayed(result)
        asked = demands_of(scenario, experiment.reference)
        result = replace(result, scenario=scenario, demands=asked)
    metrics = metrics_of(result, result.scenario, sum(result.wall_time_s.values()))
    records.finish(result_text(result.scenario, metrics, pace.told()), details_text(metrics))
    return result
