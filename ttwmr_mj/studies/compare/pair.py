"""The two runs of a comparison, and scenarios that do not mean the same on both plants."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from ttwmr_mj.errors import Fault, InputError, require, shown
from ttwmr_mj.files import named
from ttwmr_mj.plants.model.names import contacts
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.results.verdict import Verdict
from ttwmr_mj.runs.closed_loop.loop import Report
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.judgement.verdict import demands_of, verdict_on
from ttwmr_mj.scenario.checks import unknown_to_the_models
from ttwmr_mj.scenario.given import require_scenario
from ttwmr_mj.scenario.motion import sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.timing import physics_step_faults
from ttwmr_mj.studies.compare import motion
from ttwmr_mj.studies.compare.measures.deviation import Deviation, Numbers
from ttwmr_mj.studies.compare.measures.residuals import Residuals
from ttwmr_mj.studies.compare.variants import on_plant

Mode = Literal["open_loop", "closed_loop"]
Watch = Callable[[Trajectory, Trajectory], None]


@dataclass(frozen=True, slots=True)
class Pair:
    """The two runs that are compared, and what follows from them alone."""

    contact: motion.ContactRun
    analytic: Trajectory
    deviation: Deviation
    residuals: Residuals

    @property
    def numbers(self) -> Numbers:
        """All numbers a tolerance may be given for."""
        return {**self.deviation.numbers(), **self.residuals.numbers()}

    @property
    def verdicts(self) -> dict[str, Verdict]:
        """Plant → whether its run did the scenario's job."""
        scenario, reference = self.contact.scenario, sample_reference(self.contact.scenario)
        runs: dict[Literal["contact", "analytic"], Trajectory] = {
            "contact": self.contact.trajectory,
            # a replay of commands knows no reference
            "analytic": replace(self.analytic, ref_q=self.contact.trajectory.ref_q),
        }
        return {
            kind: verdict_on(scenario, rows, demands_of(on_plant(scenario, kind), reference))
            for kind, rows in runs.items()
        }


def run_pair(
    scenario: Scenario,
    mode: Mode = "open_loop",
    *,
    real_wheels: bool = False,
    scenario_folder: Path | str | None = None,
    watch: Watch | None = None,
    pace: Pace | None = None,
) -> Pair:
    """A scenario on contact physics and on the analytic model, in memory.

    Args:
        scenario: what to run; its plant.kind does not matter.
        mode: "open_loop" gives both plants the commands of the contact run, "closed_loop" runs
            each under its own controller.
        real_wheels: in open loop, drive the analytic model with the actual wheel speeds.
        scenario_folder: where a custom controller is looked for first; None: here.
        watch: called with the new rows of both plants, now and then; not with `real_wheels`,
            whose analytic motion is found for the whole run at once.
        pace: how fast the contact run goes; None: as fast as it can.

    Raises:
        InputError: the scenario does not mean the same on both plants.
        RunError: a run failed.
    """
    scenario = require_scenario(scenario)
    if mode not in get_args(Mode):
        raise InputError.at("mode", got=shown(mode), allowed=", ".join(get_args(Mode)))
    if real_wheels and mode != "open_loop":
        raise InputError.at("real_wheels", got="True", allowed='with mode "open_loop" only')
    if real_wheels and scenario.plant.analytic.extended is not None:
        raise InputError.at("real_wheels", "drives the model without plant.analytic.extended")
    require(bool, "real_wheels", real_wheels)
    folder = None if scenario_folder is None else named("scenario_folder", scenario_folder)
    refuse_unlike(scenario)
    closed = motion.run_analytic(scenario, folder) if mode == "closed_loop" else None
    report = watch and _both(scenario, closed, watch)
    contact = motion.run_contact(scenario, folder, watch=report, pace=pace)
    if closed is not None:
        analytic = closed
    elif real_wheels:
        analytic = motion.follow_wheels(contact)
    else:
        analytic = motion.replay_analytic(scenario, contact.commands)
    deviation = Deviation.between(contact.trajectory, analytic)
    return Pair(contact, analytic, deviation, Residuals.of(contact))


def _both(scenario: Scenario, analytic: Trajectory | None, watch: Watch) -> Report:
    """What to do with new rows of the contact run: have them watched with the analytic ones.

    Args:
        scenario: what is run.
        analytic: that run, where it is known before; None: it replays the commands.
        watch: called with both.
    """
    replay = motion.Replay(scenario, motion.analytic_plant(scenario))

    def report(rows: Trajectory) -> None:
        if not len(rows):
            return
        if analytic is None:
            watch(rows, replay.follow(rows.time_s, motion.commands_of(scenario, rows)))
            return
        first = int(np.searchsorted(analytic.time_s, rows.time_s[0]))
        watch(rows, analytic.rows(first, first + len(rows)))

    return report


def known_numbers(trailers: int) -> list[str]:
    """The keys that a tolerance for this many trailers may have, before anything has run."""
    zero, slip = np.zeros(1), np.zeros((1, len(contacts(trailers))))
    deviation = Deviation(zero, np.zeros((1, 3 + trailers)), zero, zero)
    return [*deviation.numbers(), *Residuals(zero, slip, slip, zero, zero, zero).numbers()]


def refuse_unlike(scenario: Scenario) -> None:
    """Check that this scenario means the same on both plants.

    Raises:
        InputError: it does not; every key is named.
    """
    plant, hitch = scenario.plant, scenario.robot.hitch
    faults = []

    def refuse(*key: str, got: str, problem: str, hint: str) -> None:
        faults.append(Fault(key=("plant", *key), got=got, problem=problem, hint=hint))

    if plant.pushes:
        problem = "the analytic plant's tractor follows its commands exactly and cannot be pushed"
        refuse("pushes", got=str(len(plant.pushes)), problem=problem, hint="leave the pushes out")
    if scene := plant.contact.model_path:
        problem = "the analytic plant knows only a flat floor and the robot of this scenario"
        refuse("contact", "model_path", got=repr(scene), problem=problem, hint="leave the key out")
    if plant.analytic.published_spring and (hitch.stiffness_n_m_rad or hitch.damping_n_m_s_rad):
        problem = (
            "contact physics divides the hitch's torque by J2 + m2·l² and not by k, so the two "
            "hitches differ by m2·l"
        )
        refuse("analytic", "published_spring", got="true", problem=problem, hint="set it to false")
    faults += physics_step_faults(scenario)
    problem = "the analytic model has nothing of the kind, so there is nothing to compare"
    for fault in unknown_to_the_models(scenario):
        faults.append(replace(fault, problem=problem, hint=f"leave {fault.where} out"))
    if faults:
        raise InputError(*faults, file=f"{scenario.name}, compared on both plants")
