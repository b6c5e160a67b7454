"""One comparison from scenario to folder: what `ttwmr compare` does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import write_json, write_text
from ttwmr_mj.results.parquet import write_parquet
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.files.folder import write_manifest, write_resolved
from ttwmr_mj.scenario.checks import check
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.explain.attribution import Attribution, attribute
from ttwmr_mj.studies.compare.explain.convergence import Convergence, converge
from ttwmr_mj.studies.compare.fit.fit import Fit, fit
from ttwmr_mj.studies.compare.measures.gate import Breach, breaches, read_tolerances
from ttwmr_mj.studies.compare.motion import run_contact
from ttwmr_mj.studies.compare.pair import Mode, Pair, known_numbers, refuse_unlike, run_pair
from ttwmr_mj.studies.compare.report import write_report
from ttwmr_mj.studies.compare.text import markdown, short_markdown
from ttwmr_mj.studies.compare.variants import Progress

if TYPE_CHECKING:
    from ttwmr_mj.recording.stream.live import LiveView
    from ttwmr_mj.studies.compare.recording import ComparisonRecorder

SCHEMA_VERSION = 1
UNSEEN = ("spline", "lab_circle")  # what a fit is validated on: the first that is another one


@dataclass(frozen=True, slots=True)
class Options:
    """What a comparison shall do.

    Attributes:
        mode: "open_loop" gives both plants the commands of the contact run, "closed_loop" runs
            each under its own controller.
        real_wheels: in open loop, drive the analytic model with the actual wheel speeds, not
            the commanded ones: only slip is left, without the servo.
        attribute: make the attribution tables, in open loop.
        converge: make the convergence study.
        fit: fit the extended model, always under the commands of the contact run.
        validate_on: scenario that the fit is validated on; None takes a shipped one.
        tolerance: TOML file of allowed values.
        recording, figures: leave run.rrd and figures/.
    """

    mode: Mode = "open_loop"
    real_wheels: bool = False
    attribute: bool = True
    converge: bool = False
    fit: bool = False
    validate_on: str | None = None
    tolerance: Path | None = None
    recording: bool = True
    figures: bool = True

    @property
    def attributed(self) -> bool:
        """Whether the attribution is made; two controllers leave no one command history for it."""
        return self.attribute and self.mode == "open_loop"


@dataclass(frozen=True, slots=True)
class Comparison:
    """A finished comparison."""

    folder: Path  # where its files are
    report: dict[str, Any]  # as in compare.json
    breaches: tuple[Breach, ...]  # tolerances that were exceeded


class _Findings(NamedTuple):
    """What was studied beyond the two runs; None: it was not asked for."""

    attribution: Attribution | None
    convergence: Convergence | None
    fit: Fit | None


def compare_scenario(
    scenario: Scenario,
    folder: Path,
    options: Options,
    *,
    scenario_folder: Path | None = None,
    command_line: list[str] | None = None,
    progress: Progress | None = None,
    live: LiveView | None = None,
    pace: Pace | None = None,
) -> Comparison:
    """Compare both plants on a scenario and write what was found.

    Args:
        scenario: what to run.
        folder: an existing folder for the files.
        options: what to do.
        scenario_folder: where a custom controller is looked for first.
        command_line: for the manifest.
        progress: called with the share of the work done.
        live: shows both robots while they run.
        pace: how fast the contact run goes; None: as fast as it can.

    Raises:
        InputError: the scenario or the tolerances are wrong.
        RunError: a run broke.
    """
    refuse_unlike(scenario)
    _refuse_contradictions(scenario, options)
    unseen = _unseen(scenario, options) if options.fit else None
    file = options.tolerance
    known = known_numbers(len(scenario.robot.trailers))
    tolerances = read_tolerances(file, known) if file else {}
    write_resolved(folder, scenario, (scenario_folder or Path()).absolute())
    write_manifest(folder, scenario, command_line or [])
    with ExitStack() as stack:
        recorder = None
        if options.recording:
            recorder = stack.enter_context(_recorder(folder, scenario, live))
        pair = run_pair(
            scenario,
            options.mode,
            real_wheels=options.real_wheels,
            scenario_folder=scenario_folder,
            watch=recorder.append if recorder and live else None,
            pace=pace,
        )
        if recorder and not live:
            recorder.append(pair.contact.trajectory, pair.analytic)
        findings = _study(pair, unseen, options, progress)
        exceeded = breaches(tolerances, pair.numbers)
        report = _report(pair, findings, options, exceeded)
        _write(folder, pair, findings, report, options)
        if recorder:
            recorder.finish(pair, short_markdown(report), markdown(report))
    return Comparison(folder, report, exceeded)


def _study(
    pair: Pair, unseen: Scenario | None, options: Options, progress: Progress | None
) -> _Findings:
    parts = _parts(progress, options.attributed + options.converge + options.fit)
    scenario, commands = pair.contact.scenario, pair.contact.commands
    explain = partial(attribute, scenario, commands, real_wheels=options.real_wheels)
    refine = partial(converge, scenario, commands, real_wheels=options.real_wheels)
    return _Findings(
        attribution=explain(next(parts)) if options.attributed else None,
        convergence=refine(next(parts)) if options.converge else None,
        fit=fit(pair.contact, run_contact(unseen), next(parts)) if unseen else None,
    )


def _report(
    pair: Pair, findings: _Findings, options: Options, exceeded: tuple[Breach, ...]
) -> dict[str, Any]:
    """The content of compare.json."""
    scenario = pair.contact.scenario
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": options.mode,
        "analytic_driven_by": _driver(options),
        "notes": _notes(options),
        "verdicts": {kind: str(verdict) for kind, verdict in pair.verdicts.items()},
        **pair.deviation.numbers(),
        "first_exceeded": pair.deviation.times(),
        **pair.residuals.numbers(),
        **{name: found and found.as_json() for name, found in findings._asdict().items()},
        "exceeded": [str(breach) for breach in exceeded],
    }


def _write(
    folder: Path, pair: Pair, findings: _Findings, report: dict[str, Any], options: Options
) -> None:
    write_json(folder / "compare.json", report)
    pair.contact.trajectory.write(folder / "contact.parquet")
    pair.analytic.write(folder / "analytic.parquet")
    if findings.fit:
        write_text(folder / "fitted.toml", findings.fit.as_toml())
    if findings.attribution:
        write_parquet(findings.attribution.to_table(), folder / "attribution.parquet")
    if options.figures:
        from ttwmr_mj.studies.compare.figures import write_compare_figures

        write_compare_figures(pair, folder / "figures", report["scenario"], *findings)
    write_report(report, folder)


def _recorder(folder: Path, scenario: Scenario, live: LiveView | None) -> ComparisonRecorder:
    from ttwmr_mj.studies.compare.recording import ComparisonRecorder

    return ComparisonRecorder(folder / "run.rrd", scenario, live)


def _refuse_contradictions(scenario: Scenario, options: Options) -> None:
    if options.real_wheels and options.mode == "closed_loop":
        problem = (
            "drives the analytic model in open loop, but with --mode closed_loop its own "
            "controller drives it"
        )
        raise InputError.at("--real-wheels", problem, hint="leave one of them out")
    plain_only = {
        "--real-wheels": options.real_wheels,
        "--fit": options.fit,
        "--converge": options.converge,
        "the attribution": options.attributed,
    }
    if scenario.plant.analytic.extended and (asked := [k for k, on in plain_only.items() if on]):
        problem = f"cannot be combined with {' and '.join(asked)}"
        hint = "leave the table out, or add --no-attribution and leave the other options out"
        raise InputError.at("plant.analytic.extended", problem, hint=hint)
    if (name := options.validate_on) and not options.fit:
        raise InputError.at("--validate-on", "nothing is fitted", got=name, hint="add --fit")
    if options.fit and scenario.control.torque_input:
        problem = "the extended model is driven by wheel speeds, this scenario by torques"
        hint = "set control.inner_loop to 'velocity_servo'"
        raise InputError.at("--fit", problem, got=scenario.control.inner_loop, hint=hint)
    channel = ("command_latency_s", "command_jitter_s", "command_drop_probability")
    if options.fit and (late := [key for key in channel if getattr(scenario.control, key)]):
        problem = "the extended model gets every command at once, in this scenario they are late"
        hint = "set it to 0"
        raise InputError.at("--fit", problem, got=f"control.{late[0]}", hint=hint)
    hitches = {(h.damping_n_m_s_rad, h.coulomb_friction_n_m) for h in scenario.robot.hitches}
    if options.fit and len(hitches) > 1:
        problem = "fits one damping and one dry friction to all hitches, but these hitches differ"
        raise InputError.at("--fit", problem, got=str(sorted(hitches)))


def _driver(options: Options) -> str:
    if options.mode == "closed_loop":
        return "its own controller"
    return "actual wheel speeds" if options.real_wheels else "commands"


def _notes(options: Options) -> list[str]:
    """What the studies of a comparison do not say about the deviation that it prints."""
    notes = []
    closed = options.mode == "closed_loop"
    if options.attribute and not options.attributed:
        notes.append(
            "where the deviation comes from is left out: each plant is driven by its own "
            "controller, so there are no commands common to both under which effects could be "
            "switched off and on; compare in open loop, the default, to see it"
        )
    studies = {
        "convergence": options.converge and closed,
        "fit": options.fit and (closed or options.real_wheels),
    }
    if names := [name for name, apart in studies.items() if apart]:
        notes.append(
            f"{' and '.join(names)}: made in open loop, both plants driven by the commands of the "
            "contact run, so their deviations are not the ones compared here"
        )
    return notes


def _unseen(scenario: Scenario, options: Options) -> Scenario:
    """The scenario that the fit is validated on, driven by the robot that was fitted."""
    name = options.validate_on or next(name for name in UNSEEN if name != scenario.name)
    other = load_scenario(name)
    if other.name == scenario.name:
        problem = (
            f"the model is fitted on {scenario.name} and must be validated on another scenario"
        )
        raise InputError.at("--validate-on", problem, got=name, hint="name another one")
    refuse_unlike(other)
    same = {key: getattr(scenario, key) for key in ("robot", "belief", "plant", "control")}
    driven = other.model_copy(update=same)
    if faults := check(driven, []):
        problem = "the robot that is fitted cannot drive it"
        first = Fault(key=("--validate-on",), problem=problem, got=name)
        raise InputError(first, *faults)
    return driven


def _parts(progress: Progress | None, count: int) -> Iterator[Progress | None]:
    """One progress bar, split evenly over several pieces of work."""

    def part(begin: int, share: float) -> None:
        if progress is not None:
            progress((begin + share) / count)

    return (partial(part, begin) for begin in range(count))
