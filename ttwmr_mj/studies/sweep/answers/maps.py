"""Heat maps: what happens where two parameters meet."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.figures.scales import heat, is_wide, plain_log
from ttwmr_mj.studies.sweep.answers.words import number, numbers, parameter_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ttwmr_mj.studies.sweep.answers.findings import Map
    from ttwmr_mj.studies.sweep.answers.slices import Slicing
    from ttwmr_mj.studies.sweep.answers.words import Shown

WIDTH_IN, PANEL_IN = 7.6, 2.6
MOST_NUMBERS = 8  # columns up to which numbers are written into the cells
WHITE, BLACK = "#FEFEFE", "#010101"  # stay what they are on a dark page


def draw_map(figure: Figure, drawn: Map, shown: Shown) -> None:
    """Failure rates above, medians of the headline below; one column for each variant."""
    names, has_number = list(drawn.groups), bool(shown.name)
    most = len(drawn.across.labels) * len(names)
    width = min(16.0, max(WIDTH_IN * (0.6 if len(names) == 1 else 1.0), 1.6 + 0.42 * most))
    height = 1.0 + (1 + has_number) * (0.7 + 0.26 * max(5, len(drawn.up.labels)))
    figure.set_size_inches(width, height)
    grid = figure.subplots(1 + has_number, len(names), sharex=True, sharey=True, squeeze=False)
    cells = {name: drawn.groups[name] for name in names}
    kinds = [("failure rate [%]", _each(cells, lambda g: 100.0 * g.failures.value), (0.0, 100.0))]
    if has_number:
        medians = _each(cells, lambda g: shown.factor * g.median.value)
        kinds.append((f"median of\n{shown.label}", medians, _span(medians)))
    for i, (row, (label, values, span)) in enumerate(zip(grid, kinds, strict=True)):
        for axes, name in zip(row, names, strict=True):
            mesh = _colour(axes, values[name], span, number if i else _rounded)
            _ticks(axes, drawn.across, drawn.up)
            if i == 0 and name:
                axes.set_title(name)
        bar = figure.colorbar(mesh, ax=row.tolist(), label=label, aspect=12)
        if is_wide(span):
            plain_log(bar.ax.yaxis, span)
    for axes in grid[-1]:
        axes.set_xlabel(parameter_label(drawn.across.axis.path))
    for axes in grid[:, 0]:
        axes.set_ylabel(parameter_label(drawn.up.axis.path).replace(" [", "\n["))


def _each(cells: dict[str, np.ndarray], of: Any) -> dict[str, np.ndarray]:
    """A number of every group; NaN where there are no runs."""
    one = np.vectorize(lambda g: of(g) if g.runs else np.nan, otypes=[float])
    return {name: one(groups) for name, groups in cells.items()}


def _span(values: dict[str, np.ndarray]) -> tuple[float, float]:
    finite = np.concatenate([v[np.isfinite(v)] for v in values.values()])
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def _rounded(value: float) -> str:
    return f"{value:.0f}"


def _colour(
    axes: Axes, values: np.ndarray, span: tuple[float, float], said: Callable[[float], str]
) -> Any:
    colours, norm = heat(span)
    shown = np.where(np.isposinf(values), 1e3 * abs(span[1]) + 1.0, values)
    mesh = axes.pcolormesh(shown, cmap=colours, norm=norm, edgecolors="#FEFEFE", linewidth=0.6)
    axes.grid(visible=False)
    if values.shape[1] <= MOST_NUMBERS:
        for (row, column), value in np.ndenumerate(values):
            dark = (np.isfinite(value) and float(norm(value)) > 0.5) or np.isposinf(value)
            text = "" if np.isnan(value) else said(float(value))
            middle: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7.5}
            axes.text(column + 0.5, row + 0.5, text, color=WHITE if dark else BLACK, **middle)
    return mesh


def _ticks(axes: Axes, across: Slicing, up: Slicing) -> None:
    """Values in the middle of their cells; bins by their ends."""
    for slicing, axis in ((across, axes.xaxis), (up, axes.yaxis)):
        if slicing.values:
            every = max(1, len(slicing.labels) // 8)
            places = np.arange(len(slicing.labels))[::every]
            axis.set_ticks(places + 0.5, [slicing.labels[i] for i in places])
        else:
            axis.set_ticks(np.arange(1, len(slicing.labels)), numbers(slicing.edges.tolist()))
    axes.tick_params(axis="x", labelrotation=30)
