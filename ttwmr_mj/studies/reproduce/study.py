"""The whole reproduction: run what is missing, draw, judge, report."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from ttwmr_mj.errors import InputError, MachineError, refused
from ttwmr_mj.runs.files.lock import NAME as LOCK
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.runs.process.progress import progress_bar
from ttwmr_mj.scenario.faults import suggestion
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Judgement
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.execute import execute, missing_tasks
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.report import write_claims, write_report
from ttwmr_mj.studies.reproduce.runs import RUNS


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What a reproduction left behind."""

    report: Path  # the HTML file
    judgements: dict[str, Judgement]  # verdicts by claim; empty when only figures were asked for
    failures: dict[str, str]  # what could not be run, with the reason
    runs_failed: bool  # whether that is more than a study that lacks its library


def reproduce(out: Path, only: list[str] | None = None, *, quiet: bool = False) -> Reproduction:
    """Reproduce the article into a folder; results that are finished and up to date are reused.

    Args:
        out: the folder; made if missing.
        only: names of figures; then no claim is judged, and report.html and claims.json stay.
        quiet: show no progress.

    Returns:
        The report and the verdicts.

    Raises:
        InputError: `only` names no figure, or the folder holds something else.
    """
    figures = _checked(only or [])
    _check_folder(out)
    needed = [FIGURES[name].numbers for name in figures]
    runs = {run for numbers in needed for run in numbers.runs} if only else RUNS
    studies = [s for numbers in needed for s in numbers.studies] if only else STUDIES
    with ExitStack() as stack:
        stack.enter_context(locked(out))
        tasks = missing_tasks(out, [name for name in RUNS if name in runs], studies)
        bar = progress_bar("reproduce", len(tasks) + len(figures), "parts", quiet)
        progress = stack.enter_context(bar)
        failed = execute(tasks, progress)
        failures = {event.job.name: event.reason for event in failed}
        evidence = Evidence(out, failures)
        drawn = [name for name in figures if not evidence.lacking(FIGURES[name].numbers.needed)]
        _draw(drawn, evidence)
        if progress:
            progress(len(tasks) + len(figures))
    judgements = {} if only else {n: claim.judgement(evidence) for n, claim in CLAIMS.items()}
    report = out / f"{'-'.join(['report', *(only or [])])}.html"
    if judgements:
        write_claims(evidence, judgements, out / "claims.json")
    write_report(evidence, judgements, figures, report)
    runs_failed = any(
        event.job.name in RUNS or not isinstance(event.error, MachineError) for event in failed
    )
    return Reproduction(report, judgements, failures, runs_failed)


def _checked(only: list[str]) -> list[str]:
    for name in only:
        if name not in FIGURES:
            hint = suggestion(name, list(FIGURES))
            raise InputError.at("--only", got=f"{name!r}{hint}", allowed=", ".join(FIGURES))
    return [name for name in FIGURES if name in only] if only else list(FIGURES)


def _check_folder(out: Path) -> None:
    """Refuse to spread into a folder that is not a reproduction's."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        strangers = [p.name for p in out.iterdir() if not _ours(p.name)]
    except OSError as error:
        raise InputError.at(
            "--out", f"cannot make the folder: {refused(error)}", got=str(out)
        ) from error
    if strangers:
        raise InputError.at(
            "--out",
            f"the folder holds other files ({strangers[0]})",
            got=str(out),
            hint="give an empty folder, or that of an earlier reproduction, which then resumes",
        )


def _ours(name: str) -> bool:
    ours = (LOCK, "runs", "studies", "figures", "claims.json")
    return name in ours or name.startswith("report")


def _draw(names: list[str], evidence: Evidence) -> None:
    from ttwmr_mj.studies.reproduce.figures.drawings import draw

    for name in names:
        draw(FIGURES[name], evidence, evidence.out / "figures")


def verdict_table(judgements: dict[str, Judgement]) -> str:
    """Verdicts for the terminal, one line per claim."""
    return "\n".join(
        f"{judgement.verdict:18s}  {CLAIMS[name].source:28s}  {CLAIMS[name].statement}"
        for name, judgement in judgements.items()
    )
