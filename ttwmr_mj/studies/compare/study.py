"""One comparison from scenario to folder: what `ttwmr compare` does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.files import write_json, write_parquet, write_text
from ttwmr_mj.plants.mjcf import CONTACTS
from ttwmr_mj.results.trajectory import Trajectory, to_table
from ttwmr_mj.run.folder import write_manifest, write_resolved
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare import attribution, convergence, gate
from ttwmr_mj.studies.compare.deviation import Deviation, Numbers
from ttwmr_mj.studies.compare.fit import fit
from ttwmr_mj.studies.compare.motion import (
    ContactRun,
    follow_wheels,
    replay_analytic,
    run_analytic,
    run_contact,
)
from ttwmr_mj.studies.compare.refusal import refuse_unlike
from ttwmr_mj.studies.compare.residuals import Residuals

SCHEMA_VERSION = 1
UNSEEN = ("waypoints", "lab_circle")  # what a fit is validated on, the first that is another one

Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Options:
    """What is asked of a comparison.

    Attributes:
        mode: "open_loop" gives both plants the commands of the contact run, "closed_loop" runs
            each under its own controller.
        real_wheels: in open loop, drive the analytic model by the wheels' real speeds, not by
            their commands: what is left is slip, without the servo.
        attribute: make the attribution tables (always in open loop, under commands).
        converge: make the convergence study.
        fit: fit the extended model.
        validate_on: scenario that the fit is validated on; None takes a shipped one.
        tolerance: TOML file of allowed values.
        recording, figures: leave run.rrd and figures/.
    """

    mode: Literal["open_loop", "closed_loop"] = "open_loop"
    real_wheels: bool = False
    attribute: bool = True
    converge: bool = False
    fit: bool = False
    validate_on: str | None = None
    tolerance: Path | None = None
    recording: bool = True
    figures: bool = True


@dataclass(frozen=True, slots=True)
class Comparison:
    """A finished comparison.

    Attributes:
        folder: where its files are.
        report: as in compare.json.
        breaches: tolerances that were exceeded.
    """

    folder: Path
    report: dict[str, Any]
    breaches: tuple[gate.Breach, ...]


@dataclass(frozen=True, slots=True)
class Pair:
    """The two runs that are compared, and what follows from them alone."""

    contact: ContactRun
    analytic: Trajectory
    deviation: Deviation
    residuals: Residuals

    @property
    def numbers(self) -> Numbers:
        """All numbers a tolerance may be given for."""
        return {**self.deviation.numbers(), **self.residuals.numbers()}


def run_pair(
    scenario: Scenario,
    mode: Literal["open_loop", "closed_loop"] = "open_loop",
    *,
    real_wheels: bool = False,
    scenario_folder: Path | None = None,
) -> Pair:
    """Run a scenario on both plants.

    Args:
        scenario: its plant.kind does not matter.
        mode: as in `Options`.
        real_wheels: as in `Options`.
        scenario_folder: where a custom controller is looked for first.

    Raises:
        InputError: the plants cannot mean the same thing.
        RunError: a run broke.
    """
    refuse_unlike(scenario)
    contact = run_contact(scenario, scenario_folder)
    if mode == "closed_loop":
        analytic = run_analytic(scenario, scenario_folder)
    elif real_wheels:
        analytic = follow_wheels(contact)
    else:
        analytic = replay_analytic(scenario, contact.commands)
    deviation = Deviation.between(contact.trajectory, analytic)
    return Pair(contact, analytic, deviation, Residuals.of(contact))


def compare_scenario(
    scenario: Scenario,
    folder: Path,
    options: Options,
    *,
    scenario_folder: Path | None = None,
    command_line: list[str] | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Compare both plants on a scenario and write what was found.

    Args:
        scenario: what to run.
        folder: an existing folder for the files.
        options: what is asked.
        scenario_folder: where a custom controller is looked for first.
        command_line: for the manifest.
        progress: called with the share of the work done.

    Raises:
        InputError: the scenario or the tolerances are wrong.
        RunError: a run broke.
    """
    refuse_unlike(scenario)
    _refuse_contradictions(options)
    unseen = _unseen(scenario, options) if options.fit else None
    tolerances = {}
    if options.tolerance:
        tolerances = gate.read_tolerances(options.tolerance, known_numbers())
    write_resolved(folder, scenario)
    write_manifest(folder, scenario, command_line or [])
    pair = run_pair(
        scenario, options.mode, real_wheels=options.real_wheels, scenario_folder=scenario_folder
    )
    found = gate.breaches(tolerances, pair.numbers)
    parts = _Parts(progress, options.attribute + options.converge + options.fit)
    commands = pair.contact.commands
    table = attribution.attribute(scenario, commands, parts.next()) if options.attribute else None
    orders = (
        convergence.converge(scenario, commands, progress=parts.next())
        if options.converge
        else None
    )
    fitted = fit.fit(pair.contact, run_contact(unseen), parts.next()) if unseen else None
    report = {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": options.mode,
        "analytic_driven_by": _driver(options),
        **pair.deviation.numbers(),
        "first_exceeded": pair.deviation.times(),
        **pair.residuals.numbers(),
        "attribution": table.as_json() if table else None,
        "convergence": orders.as_json() if orders else None,
        "fit": fitted.as_json() if fitted else None,
        "exceeded": [str(breach) for breach in found],
    }
    write_json(folder / "compare.json", report)
    write_parquet(to_table(pair.contact.trajectory), folder / "contact.parquet")
    write_parquet(to_table(pair.analytic), folder / "analytic.parquet")
    if fitted:
        write_text(folder / "fitted.toml", fitted.as_toml())
    if options.figures:
        from ttwmr_mj.studies.compare.figures import write_compare_figures

        write_compare_figures(pair, folder / "figures", scenario.name, table, orders, fitted)
    if options.recording:
        from ttwmr_mj.studies.compare.recording import record_comparison
        from ttwmr_mj.studies.compare.text import markdown

        record_comparison(pair, folder / "run.rrd", markdown(report))
    return Comparison(folder, report, found)


def known_numbers() -> list[str]:
    """The keys a tolerance may be given for, before anything has run."""
    zero, contacts = np.zeros(1), np.zeros((1, len(CONTACTS)))
    deviation = Deviation(zero, np.zeros((1, 4)), zero, zero)
    return [*deviation.numbers(), *Residuals(zero, contacts, contacts, zero, zero, zero).numbers()]


def _refuse_contradictions(options: Options) -> None:
    if options.real_wheels and options.mode == "closed_loop":
        raise InputError(
            "--real-wheels: drives the analytic model in the open loop; with --mode closed_loop "
            "its own controller does: leave one of them out"
        )
    if options.validate_on and not options.fit:
        raise InputError(f"--validate-on {options.validate_on}: there is no fit: add --fit")


def _driver(options: Options) -> str:
    if options.mode == "closed_loop":
        return "its own controller"
    return "real wheel speeds" if options.real_wheels else "commands"


def _unseen(scenario: Scenario, options: Options) -> Scenario:
    """The scenario that the fit is validated on, driven by the robot that was fitted."""
    name = options.validate_on or next(name for name in UNSEEN if name != scenario.name)
    other = load_scenario(name)
    if other.name == scenario.name:
        raise InputError(
            f"--validate-on {name}: the fit is made on {scenario.name}, a validation needs a "
            "scenario that it does not see: name another"
        )
    refuse_unlike(other)
    return other.model_copy(
        update={key: getattr(scenario, key) for key in ("robot", "belief", "plant", "control")}
    )


class _Parts:
    """Splits one progress bar evenly over several pieces of work."""

    def __init__(self, progress: Progress | None, count: int) -> None:
        self._progress, self._count, self._started = progress, count, -1

    def next(self) -> Progress | None:
        """The progress function of the next piece."""
        self._started += 1
        begin, progress, count = self._started, self._progress, self._count
        if progress is None:
            return None
        return lambda share: progress((begin + share) / count)
