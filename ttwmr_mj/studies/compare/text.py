"""A comparison in words, for the terminal and the recording."""

import math
import textwrap
from collections.abc import Iterable, Iterator
from typing import Any

from ttwmr_mj.studies.compare.explain.attribution import TRAILERS, unit_of
from ttwmr_mj.studies.compare.explain.effects import EFFECTS

ENERGY_LOST = "energy lost to floor, balls and gears"
ROWS = (
    ("position_deviation_max_m", "P, largest deviation", 1e3, "mm"),
    ("position_deviation_rms_m", "P, rms deviation", 1e3, "mm"),
    ("position_deviation_per_path", "P, largest deviation per path length", 1e6, "µm/m"),
    ("theta1_deviation_max_rad", "θ1, largest deviation", 1e3, "mrad"),
    *(
        (f"{name}_deviation_{key}_rad", f"{symbol}, {what} deviation", 1e3, "mrad")
        for name, symbol in TRAILERS.items()
        for key, what in (("max", "largest"), ("rms", "rms"))
    ),
    ("constraint_residual_max_m_s", "side slip of P (Eq. 3), largest", 1e3, "mm/s"),
    ("trailer_equation_residual_rms_n_m", "trailer torque (Eq. 17), rms residual", 1e6, "µN·m"),
    ("energy_residual_final_j", ENERGY_LOST, 1e3, "mJ"),
)
NAMES = {effect.name: effect.text for effect in EFFECTS} | {
    "higher_interactions": "three and more effects together",
    "rest": "unexplained remainder",
    "total": "total (rms)",
}
SYMBOLS = {"position": "P", **TRAILERS}  # the quantities that are explained


WIDTH = 100  # columns of a terminal that running text fills
HEAD = ("", "alone", "interaction", "contribution", "share")


def plain(report: dict[str, Any]) -> str:
    """The report for a terminal."""
    lines = [*_verdicts(report), "", *_aligned(_summary(report))]
    for note in report["notes"]:
        lines += ["", *textwrap.wrap(note, WIDTH)]
    for symbol, rows, note in _explained(report):
        lines += ["", f"where the deviation of {symbol} comes from"]
        lines += ["  {:44s} {:>9s} {:>12s} {:>15s} {:>9s}".format(*row) for row in (HEAD, *rows)]
        lines += note
    if study := report["convergence"]:
        numbers = {
            "order of convergence of P": study["order"]["position_deviation_max_m"],
            **{
                f"order of convergence of {symbol}": study["order"][key]
                for name, symbol in TRAILERS.items()
                if (key := f"{name}_deviation_max_rad") in study["order"]
            },
            "P per path length at the finest level": study["position_deviation_per_path"][-1],
        }
        lines += ["", *_aligned([(label, _number(value)) for label, value in numbers.items()])]
    if fit := report["fit"]:
        lines += ["", "fitted parameters, with their 95 % intervals"]
        for name, e in fit["parameters"].items():
            value, low, high = told_with_ends(e["value"], *e["confidence_95"])
            lines.append(f"  {name:34s} {value}  [{low}, {high}]")
        unseen, factors = fit["validation"]["scenario"], fit["validation"]["factor"]
        lines.append(f"on {unseen}, which was not used for the fit, deviations")
        for name, v in factors.items():
            by = f"fell to 1/{v:.3g}" if v >= 1.0 else f"rose {1.0 / v:.3g}-fold" if v else "rose"
            lines.append(f"  {name:34s} {by}")
    return "\n".join(lines)


def told_with_ends(value: float, low: float, high: float) -> list[str]:
    """A number and the ends of its interval, in digits that show two of the interval's width."""
    width, size = high - low, max(abs(low), abs(high))
    digits = 2 + math.ceil(math.log10(size / width)) if 0.0 < width < math.inf else 6
    return [f"{number:.{min(max(digits, 4), 17)}g}" for number in (value, low, high)]


def markdown(report: dict[str, Any]) -> str:
    """The report for the recording's text panel."""
    lines = [
        f"# {report['scenario']}: contact physics against the analytic model",
        "",
        f"Analytic model (translucent) driven by: {report['analytic_driven_by']}.",
        "",
        *(f"- {line}" for line in _verdicts(report)),
        "",
        *_table(("", ""), _summary(report)),
        *(line for note in report["notes"] for line in ("", note)),
    ]
    for symbol, rows, note in _explained(report):
        lines += ["", f"Where the deviation of {symbol} comes from", "", *_table(HEAD, rows)]
        lines += ["", *note]
    return "\n".join(lines) + "\n"


def short_markdown(report: dict[str, Any]) -> str:
    """The largest deviations and the verdicts, for the panel below the robots."""
    apart, turned = report["position_deviation_max_m"], report["theta2_deviation_max_rad"]
    lines = [
        f"# P at most {1e3 * apart:.3g} mm apart, θ2 at most {1e3 * turned:.3g} mrad",
        f"The analytic model (translucent) is driven by: {report['analytic_driven_by']}.",
        *_verdicts(report),
    ]
    return "\n\n".join(lines)


def rows_of(report: dict[str, Any]) -> list[tuple[str, str, float, str]]:
    """What a comparison deviates by: key, label, factor to the unit shown, unit."""
    return [row for row in ROWS if row[0] in report]


def symbols_of(tables: Iterable[str]) -> dict[str, str]:
    """Which of the quantities are explained, with their symbols."""
    given = frozenset(tables)
    return {quantity: symbol for quantity, symbol in SYMBOLS.items() if quantity in given}


def fixed(value: float) -> str:
    """A number with four digits after the point, never "-0.0000"."""
    return f"{round(value, 4) + 0.0:.4f}"


def percent(share: float | None) -> str:
    """A share as text, never as "-0.0 %"; empty where it is undefined."""
    return "" if share is None else f"{round(100 * share, 1) + 0.0:.1f} %"


def _verdicts(report: dict[str, Any]) -> list[str]:
    return [f"{kind}: {verdict}" for kind, verdict in report["verdicts"].items()]


def _summary(report: dict[str, Any]) -> list[tuple[str, str]]:
    """What deviates by how much: (label, value with unit)."""
    rows = rows_of(report)
    return [(label, _number(report[key], scale, f" {unit}")) for key, label, scale, unit in rows]


def _number(value: float | None, scale: float = 1.0, unit: str = "") -> str:
    return "undefined" if value is None else f"{value * scale:.4g}{unit}"


def _explained(report: dict[str, Any]) -> Iterator[tuple[str, list[tuple[str, ...]], list[str]]]:
    """What explains each quantity: its symbol, rows as `HEAD` says, and a note if there is one."""
    attribution = report["attribution"] or {}
    for quantity, symbol in symbols_of(attribution).items():
        unit, note = unit_of(quantity), attribution["notes"].get(quantity)
        rows = []
        for name, row in attribution[quantity].items():
            cells = [
                "" if (value := row[f"{column}_{unit}"]) is None else fixed(1e3 * value)
                for column in HEAD[1:4]
            ]
            rows.append((NAMES[name], *cells[:2], f"{cells[2]} m{unit}", percent(row["share"])))
        solver = percent(attribution["solver_share"][quantity])
        own = f"  the solver's own, compliance and timestep, sum of both shares: {solver}"
        notes = [own] if solver else []
        yield symbol, rows, notes + ([f"  {note}"] if note else [])


def _aligned(rows: list[tuple[str, str]]) -> list[str]:
    return [f"{label:42s} {value}" for label, value in rows]


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    lines = (f"| {' | '.join(row)} |" for row in rows)
    return [f"| {' | '.join(head)} |", "|" + "---|" * len(head), *lines]
