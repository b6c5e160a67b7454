"""The tables of a sweep's report, as heads and rows of cells."""

from __future__ import annotations

from typing import Any, NamedTuple

from ttwmr_mj.results.metrics import meaning_of
from ttwmr_mj.results.statistics import Interval, share
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.studies.sweep.answers.findings import Along, Findings
from ttwmr_mj.studies.sweep.answers.read import Axis, Sweep
from ttwmr_mj.studies.sweep.answers.slices import OUTER, Group
from ttwmr_mj.studies.sweep.answers.words import Shown, number, parameter_label, percent

RULES: dict[str, tuple[str, str]] = {
    str(name): said for name, said in VERDICTS.items()
}  # by any text that a table may hold
LOW, HIGH = (f"{100 * at:.0f} %" for at in OUTER)


class Table(NamedTuple):
    """As `parts.table` takes it."""

    head: list[str]
    rows: list[list[Any]]


def _count(number: int) -> tuple[str, int]:
    return str(number), number


def _variant(name: str) -> str:
    return name or "all runs"


def verdicts_table(findings: Findings) -> Table:
    """How many runs got which verdict, and their share."""
    rows: list[list[Any]] = []
    for variant, counts in findings.verdicts.items():
        group = findings.variants[variant]
        for name, count in counts.items():
            words, when = RULES.get(name, (name, ""))
            found = percent(share(count, group.runs, independent=group.independent))
            rows.append([_variant(variant), words, _count(count), found, when])
    return Table(["variant", "verdict", "runs", "share, %", "given when"], rows)


def _group_cells(group: Group, shown: Shown) -> list[Any]:
    cells: list[Any] = [_count(group.runs), _count(group.failed), percent(group.failures)]
    if shown.name:
        outer = [(text, value) for text, value, _ in map(shown.cell, map(_alone, group.outer))]
        cells += [shown.cell(group.median), *outer]
    return cells


def _alone(value: float) -> Interval:
    return Interval(value, float("-inf"), float("inf"))


def _group_head(shown: Shown) -> list[str]:
    unit = f" of {shown.label}" if shown.name else ""
    numbers = [f"median{unit}", LOW, HIGH] if shown.name else []
    return ["runs", "failed", "failure rate, %", *numbers]


def variants_table(findings: Findings, shown: Shown) -> Table:
    """Failure rate and headline of every variant."""
    rows = [[_variant(n), *_group_cells(g, shown)] for n, g in findings.variants.items()]
    return Table(["variant", *_group_head(shown)], rows)


def along_table(along: Along, shown: Shown) -> Table:
    """The same, part by part of one parameter."""
    rows = [
        [(label, place), _variant(variant), *_group_cells(group, shown)]
        for variant, found in along.groups.items()
        for label, place, group in zip(
            along.slicing.labels, along.slicing.places, found, strict=True
        )
    ]
    head = [parameter_label(along.slicing.axis.path), "variant", *_group_head(shown)]
    return Table(head, rows)


def pairs_table(findings: Findings, shown: Shown) -> Table:
    """Every pair of variants on equal draws and seeds."""
    rows: list[list[Any]] = []
    for pair in findings.pairs:
        found = pair.found
        cells: list[Any] = [f"{pair.ours} − {pair.theirs}", _count(found.pairs)]
        if shown.name:
            cells += [shown.cell(found.difference), percent(found.wins)]
            cells += [_count(found.unknown)]
        cells += [percent(found.failures)]
        cells += [_count(n) for n in (found.only_ours, found.only_theirs, found.both)]
        rows.append(cells)
    numbers = [
        f"difference of {shown.label}",
        "first smaller, % of those that differ",
        "no number to compare",
    ]
    head = ["first − second", "pairs", *(numbers if shown.name else [])]
    head += ["difference of failure rates, %", "first alone failed", "second alone", "both"]
    return Table(head, rows)


def sensitivity_table(sweep: Sweep, findings: Findings, shown: Shown) -> Table:
    """First-order and total indices, and whether they can be read."""
    names = {"failed": "failed or not", "headline": shown.name, "rank": f"rank of {shown.name}"}
    rows: list[list[Any]] = []
    for one in findings.sensitivity:
        if one.indices is None:
            constant = "the same in every run"
            rows.append([_variant(one.variant), names[one.of], constant, "", "", ""])
            continue
        for axis, index in zip(sweep.axes, one.indices, strict=True):
            first, total = map(_index, (index.first, index.total))
            state = "converged" if index.converged else "not converged"
            rows.append([_variant(one.variant), names[one.of], _axis(axis), first, total, state])
    return Table(["variant", "of", "parameter", "first order", "total", ""], rows)


def _index(found: Interval) -> tuple[str, float, str]:
    value, low, high = (f"{x + 0.0:.2f}".replace("-", "−") for x in found)
    return value, found.value, f"[{low}, {high}]"


def _axis(axis: Axis) -> str:
    return " & ".join(axis.paths)


def metrics_table(findings: Findings) -> Table:
    """Quantiles of every metric that is defined."""
    rows: list[list[Any]] = []
    for variant, metrics in findings.metrics.items():
        for name, quantiles in metrics.items():
            shown = Shown.of(name)
            cells = [shown.cell(found) for found in quantiles]
            rows.append([name, _variant(variant), shown.unit, *cells, meaning_of(name)])
    return Table(["metric", "variant", "unit", LOW, "median", HIGH, "what it is"], rows)


def failed_table(failed: Sweep, most: int) -> Table:
    """The first of the failed runs."""
    paths = list(failed.plan["parameters"])
    columns = ["row", *(["variant"] if failed.plan["variants"] else []), "seed", *paths]
    rows: list[list[Any]] = []
    for i in range(min(most, len(failed))):
        cells = [_value(failed.table[name][i]) for name in columns]
        verdict, reason = (str(failed.table[name][i]) for name in ("verdict", "reason"))
        words = RULES.get(verdict, (verdict, ""))[0]
        rows.append([*cells, words, reason])
    labels = [parameter_label(name) if name in paths else name for name in columns]
    return Table([*labels, "verdict", "reason"], rows)


def _value(value: Any) -> Any:
    if isinstance(value, str):
        return value
    plain = value.item() if hasattr(value, "item") else value
    text = str(plain).lower() if isinstance(plain, bool | int) else number(plain)
    return text, float(plain)


def plan_table(sweep: Sweep) -> Table:
    """The parameters of the plan."""
    rows = []
    for path, given in sweep.plan["parameters"].items():
        shares = [
            other for other, its in sweep.plan["parameters"].items() if its["axis"] == given["axis"]
        ]
        together = (
            "" if len(shares) == 1 else f"together with {', '.join(p for p in shares if p != path)}"
        )
        rows.append([path, _described(given), together])
    return Table(["parameter", "values", ""], rows)


def _described(given: dict[str, Any]) -> str:
    """How a parameter varies, in words."""
    if "values" in given:
        words = ", ".join(_plain(v) for v in given["values"])
        if given.get("weights"):
            words += f" with weights {', '.join(_plain(v) for v in given['weights'])}"
        return words
    kind = str(given.get("distribution", given.get("spacing", "linear"))).replace("_", "-")
    if kind == "normal":
        words = f"normal, mean {_plain(given['mean'])}, standard deviation {_plain(given['std'])}"
    else:
        words = f"{kind}, {_plain(given['low'])} to {_plain(given['high'])}"
    return f"{words}, {given['count']} values" if given.get("count") else words


def _plain(value: Any) -> str:
    return (
        value
        if isinstance(value, str)
        else str(value).lower()
        if isinstance(value, bool)
        else f"{value:g}"
    )
