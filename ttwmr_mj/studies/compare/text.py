"""A comparison in words, for the terminal and the recording."""

from __future__ import annotations

from typing import Any

from ttwmr_mj.studies.compare.attribution import QUANTITIES
from ttwmr_mj.studies.compare.effects import EFFECTS

ROWS = (
    ("position_deviation_max_m", "P, largest deviation", 1e3, "mm"),
    ("position_deviation_rms_m", "P, rms deviation", 1e3, "mm"),
    ("position_deviation_per_path", "P, largest deviation per path", 1e6, "µm/m"),
    ("theta1_deviation_max_rad", "θ1, largest deviation", 1e3, "mrad"),
    ("theta2_deviation_max_rad", "θ2, largest deviation", 1e3, "mrad"),
    ("theta2_deviation_rms_rad", "θ2, rms deviation", 1e3, "mrad"),
    ("constraint_residual_max_m_s", "side slip of P (Eq. 3), largest", 1e3, "mm/s"),
    ("trailer_equation_residual_rms_n_m", "trailer's torque (Eq. 17), rms residual", 1e6, "µN·m"),
    ("energy_residual_final_j", "energy lost to the floor", 1e3, "mJ"),
)
NAMES = {effect.name: effect.text for effect in EFFECTS} | {
    "higher_interactions": "three effects and more together",
    "rest": "unexplained rest",
    "total": "total (rms)",
}
SYMBOLS = {"position": "P", "theta2": "θ2"}  # the quantities that are explained
SCALES = {"m": (1e3, "mm"), "rad": (1e3, "mrad")}


def summary_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """What deviates by how much: (label, value with unit)."""
    return [
        (label, "undefined" if report[key] is None else f"{report[key] * scale:.4g} {unit}")
        for key, label, scale, unit in ROWS
    ]


def attribution_rows(report: dict[str, Any], quantity: str) -> list[tuple[str, str, str, str, str]]:
    """The table of one quantity: effect, alone, interaction, contribution with unit, share."""
    unit = QUANTITIES[quantity][1]
    scale, shown = SCALES[unit]

    def cell(value: float | None) -> str:
        return "" if value is None else f"{value * scale:.4f}"

    rows = []
    for name, row in report["attribution"][quantity].items():
        share = "" if row["share"] is None else f"{round(100 * row['share'], 1) + 0.0:.1f} %"
        rows.append(
            (
                NAMES[name],
                cell(row[f"alone_{unit}"]),
                cell(row[f"interaction_{unit}"]),
                f"{cell(row[f'contribution_{unit}'])} {shown}",
                share,
            )
        )
    return rows


HEAD = ("", "alone", "interaction", "contribution", "share")


def plain(report: dict[str, Any]) -> str:
    """The report for a terminal."""
    lines = [f"{label:42s} {value}" for label, value in summary_rows(report)]
    if report["attribution"]:
        for quantity, symbol in SYMBOLS.items():
            lines += ["", f"where the deviation of {symbol} comes from"]
            for row in (HEAD, *attribution_rows(report, quantity)):
                lines.append(
                    f"  {row[0]:34s} {row[1]:>9s} {row[2]:>12s} {row[3]:>15s} {row[4]:>9s}"
                )
            lines += _note(report, quantity)
    if report["convergence"]:
        study, orders = report["convergence"], report["convergence"]["order"]
        numbers = {
            "order of convergence of P": orders["position_deviation_max_m"],
            "order of convergence of θ2": orders["theta2_deviation_max_rad"],
            "P per path at the finest level": study["position_deviation_per_path"][-1],
        }
        shown = {k: "undefined" if v is None else f"{v:.4g}" for k, v in numbers.items()}
        lines += ["", *(f"{label:42s} {value}" for label, value in shown.items())]
    if report["fit"]:
        lines += ["", "fitted parameters, with their 95 % intervals"]
        for name, e in report["fit"]["parameters"].items():
            low, high = e["confidence_95"]
            lines.append(f"  {name:34s} {e['value']:.6g}  [{low:.6g}, {high:.6g}]")
        validation = report["fit"]["validation"]
        lines.append(f"on {validation['scenario']}, which it did not see, deviations fell by")
        lines += [f"  {name:34s} {v:.1f} ×" for name, v in validation["factor"].items()]
    return "\n".join(lines)


def markdown(report: dict[str, Any]) -> str:
    """The report for the recording's text panel."""
    lines = [
        f"# {report['scenario']}: contact physics against the analytic model",
        "",
        f"Analytic model (translucent) driven by: {report['analytic_driven_by']}.",
        "",
        *_table(("", ""), summary_rows(report)),
    ]
    if report["attribution"]:
        for quantity, symbol in SYMBOLS.items():
            lines += ["", f"Where the deviation of {symbol} comes from", ""]
            lines += _table(HEAD, attribution_rows(report, quantity))
            lines += ["", *_note(report, quantity)]
    return "\n".join(lines) + "\n"


def _note(report: dict[str, Any], quantity: str) -> list[str]:
    note = report["attribution"]["notes"].get(quantity)
    return [f"  {note}"] if note else []


def _table(head: tuple[str, ...], rows: list[Any]) -> list[str]:
    return [
        f"| {' | '.join(head)} |",
        "|" + "---|" * len(head),
        *(f"| {' | '.join(row)} |" for row in rows),
    ]
