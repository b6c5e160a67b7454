"""leaderboard.html: charts with intervals, tables that can be sorted, each row's command."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_text
from ttwmr_mj.studies.bench.evidence import Statistic
from ttwmr_mj.studies.bench.figures import write_charts
from ttwmr_mj.studies.bench.leaderboard import RULES, followed_share, notes, status
from ttwmr_mj.studies.bench.lines import COLUMNS, RANKED_BY, Line
from ttwmr_mj.studies.bench.overview import (
    CAPTION,
    NOT_MEANT,
    condition,
    failures,
    number,
    overview,
    sections,
)
from ttwmr_mj.studies.bench.scoring import Board
from ttwmr_mj.studies.pages.page import inlined, render

Cell = tuple[str, float | str, str]  # as the page's tables take it


def write_page(board: Board, folder: Path, title: str) -> None:
    """Write leaderboard.html, and its charts as figures/TASK.png and .svg.

    Args:
        board: what it shows.
        folder: the suite's.
        title: heading.
    """
    charts = write_charts(board.lines, folder / "figures")
    write_text(folder / "leaderboard.html", to_html(board, title, charts))


def to_html(board: Board, title: str, charts: dict[str, Path] | None = None) -> str:
    """The page; charts: task → SVG file, which the page then holds."""
    return render(
        __package__ or "",
        "leaderboard.html.j2",
        title=title,
        status=status(board),
        rules=RULES,
        caption=CAPTION,
        tasks=[_task(board.lines, task, rows) for task, rows in overview(board.lines).items()],
        charts={task: inlined(path) for task, path in (charts or {}).items()},
        failures=failures(board.lines),
    )


def _task(lines: list[Line], task: str, rows: list[list[str]]) -> dict[str, Any]:
    members = {name: found for (of, name), found in sections(lines).items() if of == task}
    return {
        "name": task,
        "id": re.sub(r"\W+", "-", task),
        "overview": rows,
        "best": _best(lines, task),
        "sections": {name: _section(found) for name, found in members.items()},
    }


def _best(lines: list[Line], task: str) -> list[str]:
    """Where a law is better than every other, beyond chance."""
    return [
        f"{condition(line)}: {line.names['controller']}"
        for line in lines
        if line.best and line.names["task"] == task
    ]


def _section(lines: list[Line]) -> dict[str, Any]:
    """One table: head, rows, what failed, and the commands."""
    several = any(len(line.runs) > 1 for line in lines)
    shown = [name for name in COLUMNS if any(line.statistic(name) for line in lines)]
    head = ["controller", RANKED_BY, *(["worst, mm"] if several else [])]
    head += [name for name in shown if name != RANKED_BY]
    return {
        "head": [*head, "followed", "verdict", "files"],
        "rows": [_row(line, shown, several) for line in lines],
        "told": [f"{x.names['controller']}, {text}" for x in lines for text in notes(x)],
        "commands": [line.command for line in lines],
    }


def _row(line: Line, shown: list[str], several: bool) -> list[Any]:
    error = line.statistic(RANKED_BY)
    name = line.names["controller"] + ("" if line.meant else f" {NOT_MEANT}")
    worst = error.worst if error and error.worst is not None else None
    cells: list[Any] = [name, _cell(error), *([_number(worst)] if several else [])]
    cells += [_cell(line.statistic(column)) for column in shown if column != RANKED_BY]
    followed = (followed_share(line), line.followed / len(line.runs))
    links = [*line.recordings, *([line.manifest] if line.manifest else [])]
    return [*cells, followed, line.verdict, {"links": links, "best": line.best}]


def _cell(found: Statistic | None) -> Cell:
    """The median and its interval; a single run has but its number."""
    if found is None:
        return "–", "", ""
    ends = "" if found.low is None else f"[{number(found.low)}, {number(found.high)}]"
    return number(found.median), found.median, ends


def _number(value: float | None) -> Cell:
    return number(value), math.inf if value is None else value, ""
