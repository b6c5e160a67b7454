"""report.html and claims.json: what a reader who has only the article can follow and re-run."""

import shlex
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_json, write_text
from ttwmr_mj.runs.files.folder import LIBRARIES, git_commit, library_version
from ttwmr_mj.runs.report import verdict_line
from ttwmr_mj.studies.pages.page import inlined, render
from ttwmr_mj.studies.reproduce.claims import friction
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Judgement
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS, REASONS
from ttwmr_mj.studies.reproduce.errata import ERRATA
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.runs import RUNS
from ttwmr_mj.studies.reproduce.words import mm

CLAIMS_SCHEMA_VERSION = 1
TONES = {  # verdict → how the page colours it
    "holds": "good",
    "holds with changes": "warn",
    "fails": "bad",
    "undecided": "odd",
    "evidence missing": "muted",
}
REPORTED = ("ttwmr-mj", *LIBRARIES, "scipy", "sympy")


def write_claims(evidence: Evidence, judgements: dict[str, Judgement], path: Path) -> None:
    """claims.json: per claim the rule, the verdict, the numbers, the runs with their recordings."""
    rows = [
        {
            "name": name,
            "source": CLAIMS[name].source,
            "statement": CLAIMS[name].statement,
            "rule": CLAIMS[name].rule,
            **asdict(judgement),
            "runs": [
                {"run": run, "folder": f"runs/{run}", "recording": evidence.recording(run)}
                for run in CLAIMS[name].runs
            ],
            "studies": list(CLAIMS[name].studies),
        }
        for name, judgement in judgements.items()
    ]
    write_json(path, {"schema_version": CLAIMS_SCHEMA_VERSION, "claims": rows})


def write_report(
    evidence: Evidence, judgements: dict[str, Judgement], drawn: list[str], path: Path
) -> None:
    """One HTML file that needs nothing beside it, but for the recordings it links to.

    Args:
        evidence: the results.
        judgements: verdicts; none for a report of single figures.
        drawn: names of the figures to show, as SVG files under figures/.
        path: the file.
    """
    swept = judgements and not evidence.lacking(FIGURES["friction"].numbers.needed)
    claimed = {figure for name in judgements for figure in CLAIMS[name].figures}
    page = render(
        __package__ or "",
        "report.html.j2",
        counts=Counter(judgement.verdict for judgement in judgements.values()),
        claims=[(CLAIMS[name], judgement) for name, judgement in judgements.items()],
        shown={name: _figure(evidence, name) for name in drawn},
        unclaimed=[name for name in drawn if name not in claimed],
        tones=TONES,
        errata=_errata(evidence) if judgements else [],
        friction=friction.numbers(evidence) if swept else None,
        balances=friction.balances(evidence) if swept else [],
        limits=[(name, value, REASONS[name]) for name, value in LIMITS.items()],
        runs=[_run(evidence, name) for name in _used(drawn, judgements)],
        recording=evidence.recording,
        mm=mm,
        versions={name: library_version(name) for name in REPORTED},
        commit=git_commit(),
    )
    write_text(path, page)


def _used(drawn: list[str], judgements: dict[str, Judgement]) -> list[str]:
    used = {run for name in drawn for run in FIGURES[name].numbers.runs}
    used |= {run for name in judgements for run in CLAIMS[name].runs}
    return [name for name in RUNS if name in used]


def _figure(evidence: Evidence, name: str) -> dict[str, Any]:
    """What the template cannot see in a figure itself."""
    figure, drawing = FIGURES[name], evidence.out / "figures" / f"{name}.svg"
    lacking = evidence.lacking(figure.numbers.needed)
    return {
        "figure": figure,
        "found": f"Not run: {', '.join(lacking)}." if lacking else figure.caption(evidence),
        "svg": None if lacking else inlined(drawing),
    }


def _errata(evidence: Evidence) -> list[dict[str, Any]]:
    """Every erratum with its proof, or why there is none."""
    missing = evidence.failures.get("proofs")
    proofs = {} if missing else evidence.study("proofs")
    return [
        {"erratum": erratum, "proof": proofs.get(erratum.proof), "missing": missing}
        for erratum in ERRATA
    ]


def _run(evidence: Evidence, name: str) -> dict[str, str]:
    status = "not run" if name in evidence.failures else verdict_line(evidence.metrics(name))
    return {"name": name, "command": shlex.join(RUNS[name].command()), "status": status}
