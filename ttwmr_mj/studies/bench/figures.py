"""The leaderboard's charts: errors with their intervals, task by task."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.figures.canvas import legend_below, write_figures
from ttwmr_mj.figures.scales import plain_log
from ttwmr_mj.figures.style import MARKS, SERIES
from ttwmr_mj.studies.bench.lines import RANKED_BY, Line
from ttwmr_mj.studies.bench.overview import condition

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMALLEST_MM = 1e-3  # smaller errors, as of the analytic plant without noise, are drawn there
SPREAD = 0.62  # of a row's height that its controllers share


def write_charts(lines: list[Line], folder: Path) -> dict[str, Path]:
    """Draw a chart for each task in which any run has an error; task → SVG file."""
    looks = {name: i for i, name in enumerate(dict.fromkeys(x.names["controller"] for x in lines))}
    written = {}
    for task in dict.fromkeys(line.names["task"] for line in lines):
        members = [line for line in lines if line.names["task"] == task]
        if not any(_finite(line) for line in members):
            continue
        draw = partial(_draw, lines=members, looks=looks)
        name = re.sub(r"\W+", "-", task)
        paths = write_figures({name: draw}, folder, "")
        written[task] = next(path for path in paths if path.suffix == ".svg")
    return written


def _finite(line: Line) -> bool:
    error = line.statistic(RANKED_BY)
    return error is not None and math.isfinite(error.median) and error.median > 0.0


def _draw(figure: Figure, lines: list[Line], looks: dict[str, int]) -> None:
    """A row for each condition, a point for each law: hollow if not every run followed."""
    rows = list(dict.fromkeys(condition(line) for line in lines))
    names = [name for name in looks if any(line.names["controller"] == name for line in lines)]
    figure.set_size_inches(7.6, 1.4 + len(rows) * max(0.34, 0.085 * len(names)))
    axes = figure.subplots()
    for line in filter(_finite, lines):
        place = names.index(line.names["controller"])
        shift = SPREAD * (place / max(1, len(names) - 1) - 0.5) if len(names) > 1 else 0.0
        _point(axes, line, rows.index(condition(line)) + shift, looks[line.names["controller"]])
    for name in names:
        i = looks[name]
        axes.plot([], [], MARKS[i % len(MARKS)], color=SERIES[i % len(SERIES)], label=name)
    medians = [line.statistic(RANKED_BY) for line in filter(_finite, lines)]
    found = [max(one.median, SMALLEST_MM) for one in medians if one is not None]
    axes.set_xscale("log")
    axes.set_xlim(0.6 * min(found), 1.7 * max(found))
    plain_log(axes.xaxis, (min(found), max(found)))
    axes.set(yticks=range(len(rows)), yticklabels=rows, ylim=(len(rows) - 0.5, -0.5))
    for edge in range(1, len(rows)):
        axes.axhline(edge - 0.5, color="#DDDDDD", linewidth=0.8)
    axes.grid(axis="y", visible=False)
    left = f"; leftmost: {SMALLEST_MM:g} or less" if min(found) == SMALLEST_MM else ""
    axes.set_xlabel(f"{RANKED_BY}{left}; hollow: not every run followed")
    legend_below(figure, columns=5, axes=axes)


def _point(axes: Axes, line: Line, y: float, look: int) -> None:
    error = line.statistic(RANKED_BY)
    assert error is not None
    colour, mark = SERIES[look % len(SERIES)], MARKS[look % len(MARKS)]
    fill = colour if not line.failed else "none"
    if error.low is not None and error.high is not None:
        high = min(error.high, 1e3 * error.median)
        ends = [max(end, SMALLEST_MM) for end in (error.low, high)]
        axes.plot(ends, [y, y], color=colour, linewidth=1.1)
    axes.plot(max(error.median, SMALLEST_MM), y, mark, color=colour, mfc=fill, markersize=4.5)
