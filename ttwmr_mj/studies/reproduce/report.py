"""report.html and claims.json: what a reader who has only the article can follow and re-run."""

import base64
import re
import shlex
from collections import Counter
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_json, write_text
from ttwmr_mj.runs.folder import LIBRARIES, git_commit, library_version
from ttwmr_mj.runs.report import verdict_line
from ttwmr_mj.studies.reproduce.claims import friction
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Judgement
from ttwmr_mj.studies.reproduce.errata import ERRATA
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.runs import RUNS
from ttwmr_mj.studies.reproduce.words import mm

CLAIMS_SCHEMA_VERSION = 1
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
                for run in CLAIMS[name].numbers.runs
            ],
            "studies": list(CLAIMS[name].numbers.studies),
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
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup, escape

    template = (resources.files(__package__) / "report.html.j2").read_text(encoding="utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    # `name` in a text of ours is set in <code>
    environment.filters["code"] = lambda text: Markup(
        re.sub(r"`([^`]*)`", r"<code>\1</code>", str(escape(text)))
    )
    swept = not evidence.lacking(friction.SWEEP)
    page = environment.from_string(template).render(
        counts=Counter(judgement.verdict for judgement in judgements.values()),
        claims=[(CLAIMS[name], judgement) for name, judgement in judgements.items()],
        figures=[_figure(evidence, name) for name in drawn],
        errata=_errata(evidence) if judgements else [],
        largest_load_n_m=friction.largest_load_n_m(evidence),
        balances=friction.balances(evidence) if judgements and swept else [],
        runs=[_run(evidence, name) for name in _used(drawn, judgements)],
        recording=evidence.recording,
        mm=mm,
        versions={name: library_version(name) for name in REPORTED},
        commit=git_commit(),
    )
    write_text(path, page)


def _used(drawn: list[str], judgements: dict[str, Judgement]) -> list[str]:
    shown = [FIGURES[name] for name in drawn] + [CLAIMS[name] for name in judgements]
    used = {run for part in shown for run in part.numbers.runs}
    return [name for name in RUNS if name in used]


def _figure(evidence: Evidence, name: str) -> dict[str, Any]:
    """What the template cannot see in a figure itself."""
    figure, drawing = FIGURES[name], evidence.out / "figures" / f"{name}.svg"
    lacking = evidence.lacking(figure.numbers.needed)
    return {
        "figure": figure,
        "found": f"Not run: {', '.join(lacking)}." if lacking else figure.caption(evidence),
        "svg": None if lacking else base64.b64encode(drawing.read_bytes()).decode("ascii"),
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
