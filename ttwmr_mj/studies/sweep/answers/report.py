"""report.html of a sweep: what its runs say, how sure that is, and how to run any of them again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.files import write_text
from ttwmr_mj.results.metrics import meaning_of
from ttwmr_mj.results.sensitivity import CONVERGED
from ttwmr_mj.results.statistics import LEVEL
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.studies.pages.page import inlined, render
from ttwmr_mj.studies.sweep.answers.figures import along_name, write_sweep_figures
from ttwmr_mj.studies.sweep.answers.findings import ALL_PAIRS, MOST_MAPS, Findings, find
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.slices import OUTER
from ttwmr_mj.studies.sweep.answers.tables import (
    along_table,
    failed_table,
    metrics_table,
    pairs_table,
    plan_table,
    sensitivity_table,
    variants_table,
    verdicts_table,
)
from ttwmr_mj.studies.sweep.answers.words import (
    Shown,
    compared,
    number,
    parameter_label,
    said_percent,
)
from ttwmr_mj.studies.sweep.folder.results import REPORT_FILE, RESULTS_FILE
from ttwmr_mj.studies.sweep.plan.plan import Row
from ttwmr_mj.studies.sweep.words import command_of

MOST_FAILED = 100  # failed runs that the page lists; failed.csv has all


def write_report(folder: Path) -> str:
    """Write report.html, figures/ and failed.csv into a sweep's folder.

    Args:
        folder: holds plan.json and results.parquet; the same two give the same bytes. Recordings in
            it are linked.

    Returns:
        The sweep in a few lines, for a terminal.
    """
    every = Sweep.read(folder)
    sweep = every.without_repeats()
    findings = find(sweep)
    drawings = write_sweep_figures(sweep, findings, folder / "figures")
    _write_failed(sweep, folder / "failed.csv")
    recorded = sorted((folder / "recorded").glob("row-*/run.rrd"))
    recordings = [(path.parent.name, path.relative_to(folder).as_posix()) for path in recorded]
    repeats = len(every) - len(sweep)
    page = _page(sweep, findings, drawings, recordings, repeats)
    write_text(folder / REPORT_FILE, page)
    return _told(sweep, findings, folder)


def _told(sweep: Sweep, findings: Findings, folder: Path) -> str:
    whole = findings.whole
    runs = (
        f"{len(sweep)} runs, {whole.failed} failed: {said_percent(whole.failures)}, 95 % interval"
    )
    lines = [f"{sweep.plan['name']}: {runs}"]
    if sweep.headline:
        lines.append(f"{sweep.headline}: median {Shown.of(sweep.headline).said(whole.median)}")
    return "\n".join([*lines, f"table: {folder / RESULTS_FILE}", f"report: {folder / REPORT_FILE}"])


def _write_failed(sweep: Sweep, path: Path) -> None:
    """Every failed run: what it was, why it failed, and the command that runs it again."""
    import csv
    import io

    failed, out = sweep.where(sweep.failed), io.StringIO()
    columns = ["row", "draw", "variant", "seed", *sweep.plan["parameters"]]
    columns += ["status", "verdict", "reason"]
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*columns, "command"])
    for i in range(len(failed)):
        writer.writerow([*(failed.table[name][i] for name in columns), command(failed, i)])
    write_text(path, out.getvalue())


def command(sweep: Sweep, i: int) -> str:
    """What runs the i-th run alone, with all its files."""
    row = {name: values[i] for name, values in sweep.table.items()}
    values = {path: _plain(row[path]) for path in sweep.plan["parameters"]}
    where = int(row["row"]), int(row["draw"]), str(row["variant"]), int(row["seed"])
    return command_of(sweep.planned, Row(*where, values))


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _page(
    sweep: Sweep,
    findings: Findings,
    drawings: dict[str, Path],
    recordings: list[tuple[str, str]],
    repeats: int,
) -> str:
    shown, plan = Shown.of(sweep.headline), sweep.plan
    failed = sweep.where(sweep.failed)
    draws = len(np.unique(sweep.table["draw"]))
    svg = {name: inlined(path) for name, path in drawings.items()}
    return render(
        __package__ or "",
        "report.html.j2",
        plan=plan,
        shown=shown,
        headline=sweep.headline,
        meaning=meaning_of(sweep.headline) if sweep.headline else "",
        runs=len(sweep),
        broke_off=int((~sweep.finished).sum()),
        draws=draws,
        seeds=sorted(set(sweep.seeds.values())),
        repeats=repeats,
        quiet=[name for name, seeds in sweep.seeds.items() if seeds < len(plan["seeds"])],
        whole=findings.whole,
        failure_rate=said_percent(findings.whole.failures).split(" % "),
        median=shown.cell(findings.whole.median),
        sentences=_sentences(sweep, findings, shown),
        svg=svg,
        verdicts=verdicts_table(findings),
        variants=variants_table(findings, shown),
        along=[
            (parameter_label(a.slicing.axis.path), a, svg[along_name(a)], along_table(a, shown))
            for a in findings.along
        ],
        maps=[svg[name] for name in drawings if name.startswith("map-")],
        map_count=MOST_MAPS,
        all_pairs=ALL_PAIRS,
        pairs=pairs_table(findings, shown),
        sensitivity=sensitivity_table(sweep, findings, shown),
        converged=CONVERGED,
        metrics=metrics_table(findings),
        failed=failed_table(failed, MOST_FAILED),
        failed_commands=[command(failed, i) for i in range(min(5, len(failed)))],
        most_failed=MOST_FAILED,
        examples=_examples(sweep),
        recordings=recordings,
        plan_rows=plan_table(sweep),
        rules={name: VERDICTS[name] for name in reversed(VERDICTS)},
        level=round(100 * LEVEL),
        outer=[round(100 * at) for at in OUTER],
        versions={
            name.removeprefix("version_"): sorted(set(sweep.table[name].astype(str).tolist()))
            for name in sweep.table
            if name.startswith("version_")
        },
    )


def _sentences(sweep: Sweep, findings: Findings, shown: Shown) -> list[str]:
    """What a reader should take away, each with its interval."""
    whole = findings.whole
    said = [
        f"{whole.failed} of {whole.runs} runs failed: {said_percent(whole.failures)}."
        if whole.failed
        else f"None of {whole.runs} runs failed: "
        f"the failure rate is at most {number(100 * whole.failures.high)} %."
    ]
    most = max(findings.along, key=lambda a: a.explained, default=None)
    if most is not None and len(findings.along) > 1 and most.explained > 0.05:
        label = parameter_label(most.slicing.axis.path).partition(" [")[0]
        said.append(
            f"Of the parameters, {label} explains most alone: "
            f"{number(100 * most.explained)} % of the variance."
        )
    if sweep.headline:
        said += [compared(pair.ours, pair.theirs, pair.found, shown) for pair in findings.pairs]
    return said


def _examples(sweep: Sweep) -> list[tuple[str, str]]:
    """Runs to look at: the median one of those that followed, and the worst."""
    if not sweep.headline:
        return [("the first", command(sweep, 0))]
    values = sweep.numbers(sweep.headline)
    order = np.argsort(values, kind="stable")[: int((~np.isnan(values)).sum())]
    middle, last = int(order[(len(order) - 1) // 2]), int(order[-1])
    rows = [("in the middle", middle), ("the worst", last)]
    return [(f"{what}, row {sweep.table['row'][i]}", command(sweep, i)) for what, i in rows]
