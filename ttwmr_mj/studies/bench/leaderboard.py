"""From run folders to a ranking: scored from stored trajectories, nothing is simulated again."""

from __future__ import annotations

import html
import json
import statistics
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import InputError
from ttwmr_mj.metrics import score
from ttwmr_mj.run_folder import write_text
from ttwmr_mj.scenario_file import load_scenario
from ttwmr_mj.studies.bench.suite import AXES
from ttwmr_mj.trajectory import read_parquet, write_parquet

# column → (metric, scale, how seeds are combined)
COLUMNS: dict[str, tuple[str, float, str]] = {
    "P rms, mm": ("steady_tractor_rmse_m", 1e3, "median"),
    "P rms worst, mm": ("steady_tractor_rmse_m", 1e3, "worst"),
    "trailer rms, mm": ("steady_trailer_rmse_m", 1e3, "median"),
    "trailer rms worst, mm": ("steady_trailer_rmse_m", 1e3, "worst"),
    "settled, s": ("settling_time_s", 1.0, "median"),
    "effort, rad²/s": ("control_effort", 1.0, "median"),
    "saturated, %": ("saturated_share", 100.0, "median"),
    "blind, %": ("blind_share", 100.0, "median"),
    "control, µs": ("control_time_per_sample_us", 1.0, "median"),
}
RANKED_BY = "trailer rms, mm"


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the leaderboard: a controller on a task, all seeds together.

    Attributes:
        names: axis → name.
        values: column → number; None where undefined in every seed.
        runs, failures: how many there were, and how many did not end well.
        reason: why the first of them failed.
        command: runs its first seed again.
        manifest: of its first seed, relative to the leaderboard.
    """

    names: dict[str, str]
    values: dict[str, float | None]
    runs: int
    failures: int
    reason: str
    command: str
    manifest: str


def collect(folder: Path) -> list[Line]:
    """Score every finished row of a bench folder and rank the lines within each task.

    Raises:
        InputError: there is no finished row.
    """
    found = sorted((folder / "runs").glob("*/row.json"))
    if not found:
        raise InputError(f"{folder}: no finished runs in it; run the suite first")
    groups: dict[tuple[str, ...], list[dict[str, Any]]] = defaultdict(list)
    for path in found:
        row = json.loads(path.read_text())
        row["numbers"] = _numbers(path.parent) if row["status"] == "ok" else {}
        row["manifest"] = str((path.parent / "manifest.json").relative_to(folder))
        groups[tuple(row[axis] for axis in AXES)].append(row)
    lines = [_line(names, rows) for names, rows in groups.items()]
    return sorted(lines, key=_rank)


def _numbers(folder: Path) -> dict[str, float | None]:
    """The metrics of a run, scored afresh; the control time is as it was measured."""
    robot = load_scenario(str(folder / "scenario.resolved.toml")).robot
    fresh = score(read_parquet(folder / "trajectory.parquet"), robot)
    stored = json.loads((folder / "metrics.json").read_text())
    return {**fresh, "control_time_per_sample_us": stored["control_time_per_sample_us"]}


def _line(names: tuple[str, ...], rows: list[dict[str, Any]]) -> Line:
    good = [row["numbers"] for row in rows if row["numbers"]]
    values: dict[str, float | None] = {}
    for column, (metric, scale, combine) in COLUMNS.items():
        numbers = [one[metric] * scale for one in good if one[metric] is not None]
        pick = statistics.median if combine == "median" else max
        values[column] = pick(numbers) if numbers else None
    bad = [row for row in rows if row["status"] != "ok"]
    return Line(
        names=dict(zip(AXES, names, strict=True)),
        values=values,
        runs=len(rows),
        failures=len(bad),
        reason=bad[0]["reason"].splitlines()[-1] if bad and bad[0]["reason"] else "",
        command=rows[0]["run"],
        manifest=rows[0]["manifest"],
    )


def _rank(line: Line) -> tuple[Any, ...]:
    """Tasks apart; within one, fewer failures first, then the smaller trailer error."""
    names = line.names
    where = (names["task"], names["plant"], names["sensing"], names["disturbance"])
    error = line.values[RANKED_BY]
    return (*where, line.failures, float("inf") if error is None else error, names["controller"])


def write_leaderboard(lines: list[Line], folder: Path, title: str) -> None:
    """leaderboard.md, .html and .parquet."""
    import pyarrow as pa

    write_text(folder / "leaderboard.md", to_markdown(lines, title))
    write_text(folder / "leaderboard.html", to_html(lines, title))
    columns: dict[str, list[Any]] = {axis: [line.names[axis] for line in lines] for axis in AXES}
    columns |= {name: [line.values[name] for line in lines] for name in COLUMNS}
    for name in ("runs", "failures", "reason", "command", "manifest"):
        columns[name] = [getattr(line, name) for line in lines]
    write_parquet(pa.table(columns), folder / "leaderboard.parquet")


def _cells(line: Line) -> list[str]:
    numbers = ["–" if value is None else f"{value:.3g}" for value in line.values.values()]
    return [line.names["controller"], *numbers, f"{line.failures}/{line.runs}"]


def _sections(lines: list[Line]) -> dict[str, list[Line]]:
    sections: dict[str, list[Line]] = defaultdict(list)
    for line in lines:
        names = line.names
        head = f"{names['task']} · {names['plant']} · {names['sensing']}"
        head += "" if names["disturbance"] == "none" else f" · {names['disturbance']}"
        sections[head].append(line)
    return dict(sections)


HEAD = ["controller", *COLUMNS, "failed"]
NOTE = (
    "Errors are those of the second half of each run, medians over seeds; “worst” is the worst "
    "seed. Ranked by failures, then by the trailer's error."
)


def to_markdown(lines: list[Line], title: str) -> str:
    """The leaderboard as Markdown tables, one per task, with the commands below each."""
    parts = [f"# {title}\n\n{NOTE}\n"]
    for head, members in _sections(lines).items():
        rows = [f"| {' | '.join(_cells(line))} |" for line in members]
        parts.append(
            f"## {head}\n\n| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}\n" + "\n".join(rows) + "\n"
        )
        parts += [
            f"- {line.names['controller']}: {line.reason}\n" for line in members if line.reason
        ]
        commands = "\n".join(f"{line.command}   # {line.manifest}" for line in members)
        parts.append(f"```sh\n{commands}\n```\n")
    return "\n".join(parts)


def to_html(lines: list[Line], title: str) -> str:
    """The same as one page without anything outside of it."""
    body = []
    for head, members in _sections(lines).items():
        cells = "".join(f"<th>{html.escape(name)}</th>" for name in [*HEAD, "run again"])
        rows = []
        for line in members:
            values = "".join(f"<td>{html.escape(cell)}</td>" for cell in _cells(line))
            link = f'<a href="{html.escape(line.manifest)}">manifest</a>'
            why = f"<br>{html.escape(line.reason)}" if line.reason else ""
            code = f"<code>{html.escape(line.command)}</code>"
            rows.append(f"<tr>{values}<td>{code} {link}{why}</td></tr>")
        body.append(f"<h2>{html.escape(head)}</h2><table><tr>{cells}</tr>{''.join(rows)}</table>")
    return PAGE.format(title=html.escape(title), note=NOTE, body="\n".join(body))


PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 78rem; color: #222; }}
table {{ border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }}
th, td {{ padding: .3rem .6rem; text-align: right; border-bottom: 1px solid #ddd; }}
th:first-child, td:first-child, th:last-child, td:last-child {{ text-align: left; }}
tr:nth-child(2) td {{ background: #eef6ee; }}
code {{ font-size: 12px; }}
</style></head>
<body><h1>{title}</h1><p>{note}</p>
{body}
</body></html>
"""
