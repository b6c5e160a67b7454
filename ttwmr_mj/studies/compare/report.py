"""report.html of a comparison: what deviates, by how much, and where it comes from."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_text
from ttwmr_mj.runs.files.folder import LIBRARIES, git_commit, library_version
from ttwmr_mj.studies.compare import text
from ttwmr_mj.studies.compare.explain.attribution import unit_of
from ttwmr_mj.studies.compare.explain.effects import EFFECTS
from ttwmr_mj.studies.pages.page import inlined, render

Cells = list[list[Any]]
TILES = ("position_deviation_max_m", "position_deviation_per_path", "theta2_deviation_max_rad")


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write report.html beside the other files of a comparison.

    Args:
        report: what compare.json holds.
        folder: the comparison's; its figures, if there are any, are shown.
    """
    drawings = sorted((folder / "figures").glob("*.svg"))
    page = render(
        __package__ or "",
        "report.html.j2",
        report=report,
        tiles=[_tile(report, key) for key in TILES],
        verdicts=report["verdicts"],
        deviations=_deviations(report),
        exceeded=_first_exceeded(report),
        explained=_explained(report) if report["attribution"] else [],
        solver=[effect.text for effect in EFFECTS if effect.solver],
        fitted=_fitted(report["fit"]) if report["fit"] else [],
        factors=_factors(report["fit"]) if report["fit"] else [],
        svg={drawing.stem: inlined(drawing) for drawing in drawings},
        recording="run.rrd" if (folder / "run.rrd").is_file() else None,
        again=_commands(report),
        versions={name: library_version(name) for name in ("ttwmr-mj", *LIBRARIES)},
        commit=git_commit(),
    )
    write_text(folder / "report.html", page)


def _tile(report: dict[str, Any], key: str) -> tuple[str, str]:
    label, factor, unit = next(row[1:] for row in text.ROWS if row[0] == key)
    value = report[key]
    return "undefined" if value is None else f"{factor * value:.3g} {unit}", label


def _deviations(report: dict[str, Any]) -> Cells:
    rows: Cells = []
    for key, label, factor, unit in text.rows_of(report):
        value = report[key]
        shown = "undefined" if value is None else f"{factor * value:.4g}"
        rows.append([label, (shown, value), unit, key])
    return rows


def _first_exceeded(report: dict[str, Any]) -> Cells:
    """When each bound is first exceeded."""
    rows: Cells = []
    for key, time_s in report["first_exceeded"].items():
        what, _, bound = key.removesuffix("_s").partition("_over_")
        size, _, unit = bound.partition("_")
        symbol = text.SYMBOLS.get(what, "θ1")
        shown = ("never", 1e9) if time_s is None else (f"{time_s:.3g} s", time_s)
        rows.append([f"{symbol} by more than {1e3 * float(size):g} m{unit}", shown])
    return rows


def _explained(report: dict[str, Any]) -> list[dict[str, Any]]:
    """One table for each quantity, in its own unit."""
    tables = []
    for quantity, symbol in text.symbols_of(report["attribution"]).items():
        unit = unit_of(quantity)
        rows: Cells = []
        for name, row in report["attribution"][quantity].items():
            values = [row[f"{column}_{unit}"] for column in text.HEAD[1:4]]
            numbers = [("" if v is None else text.fixed(1e3 * v), v) for v in values]
            rows.append([text.NAMES[name], *numbers, (text.percent(row["share"]), row["share"])])
        tables.append(
            {
                "symbol": symbol,
                "head": ["", *(f"{column} [m{unit}]" for column in text.HEAD[1:4]), "share"],
                "rows": rows,
                "solver": text.percent(report["attribution"]["solver_share"][quantity]),
                "note": report["attribution"]["notes"].get(quantity),
            }
        )
    return tables


def _fitted(fit: dict[str, Any]) -> Cells:
    rows: Cells = []
    for name, e in fit["parameters"].items():
        value, low, high = text.told_with_ends(e["value"], *e["confidence_95"])
        expected = f"{e['expected']:.5g}", e["expected"]
        state = "taken for zero" if e["pinned"] else "" if e["identified"] else "not identified"
        rows.append([name, (value, e["value"], f"[{low}, {high}]"), expected, state])
    return rows


def _factors(fit: dict[str, Any]) -> Cells:
    """By what each deviation fell, where the model was fitted and where it was not."""
    seen, unseen = (fit[part]["factor"] for part in ("training", "validation"))
    return [[name, *((f"{f[name]:.1f} ×", f[name]) for f in (seen, unseen))] for name in seen]


def _commands(report: dict[str, Any]) -> list[str]:
    asked = {
        "--mode closed_loop": report["mode"] == "closed_loop",
        "--real-wheels": report["analytic_driven_by"] == "actual wheel speeds",
        "--no-attribution": report["attribution"] is None and report["mode"] == "open_loop",
        "--converge": report["convergence"] is not None,
        "--fit": report["fit"] is not None,
    }
    words = [word for option, given in asked.items() if given for word in option.split()]
    again = shlex.join(["ttwmr", "compare", "scenario.resolved.toml", *words])
    return [again, "ttwmr view ."]
