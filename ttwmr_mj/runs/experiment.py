"""A scenario made ready to run, in memory."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ttwmr_mj.controllers.base import Controller, Task
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.references.shared.feasibility import Feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.results.verdict import Verdict
from ttwmr_mj.runs import build
from ttwmr_mj.runs.actuation import Actuation
from ttwmr_mj.runs.loop import Loop, Outcome, Report
from ttwmr_mj.runs.pace import Pace
from ttwmr_mj.runs.pushes import Push
from ttwmr_mj.runs.verdict import demands_of, verdict_on
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Sensor
from ttwmr_mj.state import FloatArray, RobotState


@dataclass(frozen=True, slots=True)
class Result:
    """A finished run of one or many simulations.

    Attributes:
        scenario: what was run.
        trajectory: one row per control sample, up to the last one that any simulation reached;
            rows of a simulation after its end mean nothing.
        outcomes: how each simulation ended.
        wall_time_s: wall time by part of the loop: "plant", "sensing", "controller", "loop"
            (bookkeeping), "report".
        control_time_s: (n,) wall time of every command, the whole batch's.
        demands: what the reference asked of the robot; None without reference.
    """

    scenario: Scenario
    trajectory: Trajectory
    outcomes: tuple[Outcome, ...]
    wall_time_s: dict[str, float]
    control_time_s: FloatArray
    demands: Feasibility | None

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Whether each simulation did its job."""
        return tuple(
            verdict_on(
                self.scenario,
                self.trajectory.simulation(i),
                self.demands,
                outcome.status,
                outcome.reason,
            )
            for i, outcome in enumerate(self.outcomes)
        )


class Experiment:
    """One scenario made ready to run: reference, plant and controller.

    Attributes:
        scenario: what to run.
        nsim: simulations in the batch; they differ by their sensor noise only.
        reference: the sampled reference that the run is judged by, or None.
        plant: the plant, reset at every run.
        sensor: made anew at every run; None before the first.
    """

    def __init__(
        self,
        scenario: Scenario,
        folder: Path | None = None,
        nsim: int = 1,
        controller: Controller | None = None,
    ) -> None:
        """Build it.

        Args:
            scenario: what to run.
            folder: where a custom controller is looked for first.
            nsim: simulations in the batch.
            controller: drives instead of the scenario's own.

        Raises:
            InputError: it cannot be built.
        """
        self.scenario = scenario
        self.nsim = nsim
        self.reference: ReferencePath | None = build.sample_reference(scenario)
        self.plant: Plant = build.make_plant(scenario, nsim)
        self.sensor: Sensor | None = None
        self._folder = folder or Path()
        self._told = build.believed_reference(scenario)
        own = build.make_controller(scenario, self._told, self._folder)
        self._controller = controller or own

    def run(
        self,
        report: Report | None = None,
        initial: RobotState | None = None,
        pushes: tuple[Push, ...] | None = None,
        pace: Pace | None = None,
    ) -> Result:
        """Run from the initial state to the end, or until it fails.

        Args:
            initial: where every simulation starts; None: where the scenario says, all of them.
            report: called with the rows that are new, every now and then and at the end.
            pushes: on each simulation; None: what the scenario says, drawn by its seed.
            pace: how fast; None: as fast as it can.

        Raises:
            InputError: the controller cannot start.
        """
        scenario, plant = self.scenario, self.plant
        rng = build.generators(scenario.seed, ("sensor", "controller", "commands"))
        self.sensor = build.make_sensor(scenario, plant, rng["sensor"], self._folder)
        if report:
            self.sensor.keep_log()
        plant.reset(initial or build.initial_state(scenario, self.reference, self.nsim))
        loop = Loop(
            scenario,
            plant,
            self.sensor,
            self._controller,
            self._blank_rows(),
            report,
            Actuation(
                scenario.control, scenario.steps_per_period, rng["commands"].spawn(self.nsim)
            ),
            Push.of_scenario(scenario, self.nsim) if pushes is None else pushes,
            pace or Pace(),
        )
        task = Task(
            scenario.believed_robot,
            self._told,
            scenario.control.sampling_time_s,
            self.nsim,
            rng["controller"],
            scenario.believed_ground,
            scenario.believed_command_latency_s,
        )
        loop.run(task)
        return Result(
            scenario=scenario,
            trajectory=loop.rows.rows(0, loop.done),
            outcomes=tuple(loop.ends[i] for i in range(self.nsim)),
            wall_time_s=dict(loop.watch.parts),
            control_time_s=np.array(loop.control_time_s),
            demands=demands_of(scenario, self.reference),
        )

    def _blank_rows(self) -> Trajectory:
        """Rows for the whole run with times and reference filled in."""
        count = self.scenario.periods + 1
        time_s = self.scenario.control.sampling_time_s * np.arange(count, dtype=np.float64)
        nq = self.plant.joint_positions().shape[-1]
        ncontact = self.plant.contact_readings().shape[1]
        trailers = len(self.scenario.robot.trailers)
        rows = Trajectory.empty(time_s, self.nsim, nq, ncontact, trailers=trailers)
        if self.reference is not None:
            rows.ref_q[:] = self.reference.q[:count]
            rows.ref_q_rate[:] = self.reference.q_rate[:count]
        return rows
