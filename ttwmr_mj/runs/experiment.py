"""A scenario made ready to run, in memory."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ttwmr_mj.controllers.base import Controller
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.references.shared.demand import Feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.results.verdict import Verdict
from ttwmr_mj.runs.closed_loop.loop import Outcome, Report
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.judgement.verdict import verdict_on
from ttwmr_mj.runs.pushes import Push
from ttwmr_mj.runs.simulations import Simulations
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Sensor
from ttwmr_mj.state import ArrayFields, FloatArray, RobotState


@dataclass(frozen=True, slots=True, eq=False)
class Result(ArrayFields):
    """A finished run of one or many simulations; equal to another whatever time each took.

    Attributes:
        scenario: what was run.
        trajectory: one row per control sample, up to the last one that any simulation reached;
            rows of a simulation after its end mean nothing.
        outcomes: how each simulation ended.
        wall_time_s: wall time by part of the loop: "plant", "sensing", "controller", "loop"
            (bookkeeping), "pace" (waiting, if the run has a pace), "report" (if there is one).
        control_time_s: wall time of every command that was asked for, the whole batch's.
        demands: what the reference asked of the robot; None without reference.
    """

    scenario: Scenario
    trajectory: Trajectory
    outcomes: tuple[Outcome, ...]
    wall_time_s: dict[str, float] = field(compare=False)
    control_time_s: FloatArray = field(compare=False)
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
    """One scenario made ready to run, once or several times side by side.

    Attributes:
        scenario: what is run.
        folder: where a custom controller is looked for first.
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
            nsim: simulations in the batch; the first is as if alone, the others differ from it by
                what is random.
            controller: drives instead of the scenario's own.

        Raises:
            InputError: it cannot be built.
        """
        self.scenario = scenario
        self.folder = (folder or Path()).absolute()  # whatever a law of the user's does
        self._simulations = Simulations(
            [scenario] * nsim, self.folder, draws=range(nsim), controller=controller
        )

    @property
    def nsim(self) -> int:
        """Simulations in the batch."""
        return self._simulations.nsim

    @property
    def reference(self) -> ReferencePath | None:
        """The sampled reference that the run is judged by, or None."""
        return self._simulations.references[0]

    @property
    def plant(self) -> Plant:
        """The plant, reset at every run."""
        return self._simulations.plant

    @property
    def sensor(self) -> Sensor | None:
        """Made anew at every run; None before the first."""
        return self._simulations.sensor

    def run(
        self,
        report: Report | None = None,
        initial: RobotState | None = None,
        pushes: tuple[Push, ...] | None = None,
        pace: Pace | None = None,
        *,
        frames_every: int = 1,
    ) -> Result:
        """Run from the initial state to the end, or until it fails.

        Args:
            report: called with the rows that are new, every now and then and at the end.
            initial: where they start, a state for each simulation; None: where the scenario says,
                all of them.
            pushes: on each simulation; None: what the scenario says, drawn by its seed.
            pace: how fast; None: as fast as it can.
            frames_every: of a camera, keep one frame in this many for the report; 0: none.

        Raises:
            InputError: the controller cannot start.
        """
        demands = self._simulations.demands[0]  # first: of an hour they take 80 MB for a moment
        loop = self._simulations.run(report, initial, pushes, pace, frames_every=frames_every)
        return Result(
            scenario=self.scenario,
            trajectory=loop.rows.rows(0, loop.done),
            outcomes=tuple(loop.ends[i] for i in range(self.nsim)),
            wall_time_s=dict(loop.watch.parts),
            control_time_s=np.array(loop.control_time_s),
            demands=demands,
        )
