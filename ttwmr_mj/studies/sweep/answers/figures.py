"""The figures of a sweep's report."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.figures.canvas import Draw, legend_below, panel_grid, write_figures
from ttwmr_mj.figures.scales import is_wide, plain_log
from ttwmr_mj.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    MARKS,
    ORANGE,
    PINK,
    SERIES,
    SKY,
    VERMILION,
)
from ttwmr_mj.results.statistics import Interval
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.studies.sweep.answers.findings import Along, Findings, Pair, Sensitivity
from ttwmr_mj.studies.sweep.answers.maps import draw_map
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.slices import OUTER, Group, Slicing
from ttwmr_mj.studies.sweep.answers.tables import RULES
from ttwmr_mj.studies.sweep.answers.words import Shown, parameter_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 7.6
VERDICT_COLOURS = {
    "followed": GREEN,
    "no_reference": GREEN,
    "tractor_follows_trailer_lost": SKY,
    "lost": VERMILION,
    "saturated_throughout": ORANGE,
    "reference_not_feasible": PINK,
    "blind": "#8A6FB0",
    "diverged": "#7A2E00",
    "failed": "#555555",
    "interrupted": "#AAAAAA",
    "killed": "#AAAAAA",
}
BESIDE = 0.012  # of the range, between variants


def write_sweep_figures(sweep: Sweep, findings: Findings, folder: Path) -> dict[str, Path]:
    """Draw everything as NAME.png and NAME.svg; name → SVG file.

    Figures: `verdicts`, `distribution` and `along-PARAMETER`, `map-PARAMETER-PARAMETER`,
    `sensitivity`, `pairs` where there is something to show.
    """
    shown = Shown.of(sweep.headline)
    drawings: dict[str, Draw] = {"verdicts": partial(_draw_verdicts, findings=findings)}
    if sweep.headline:
        drawings["distribution"] = partial(_draw_distribution, sweep=sweep, shown=shown)
    for along in findings.along:
        drawings[along_name(along)] = partial(_draw_along, along=along, shown=shown)
    for drawn in findings.maps:
        name = f"map-{_slug(drawn.across.axis.path)}-{_slug(drawn.up.axis.path)}"
        drawings[name] = partial(draw_map, drawn=drawn, shown=shown)
    if findings.sensitivity:
        labels = [parameter_label(axis.path) for axis in sweep.axes]
        drawings["sensitivity"] = partial(
            _draw_sensitivity, found=findings.sensitivity, labels=labels, shown=shown
        )
    if findings.pairs:
        drawings["pairs"] = partial(_draw_pairs, pairs=findings.pairs, shown=shown)
    written = write_figures(drawings, folder, "", (WIDTH_IN, 3.0))
    return {path.stem: path for path in written if path.suffix == ".svg"}


def along_name(along: Along) -> str:
    """Of the figure along a parameter."""
    return f"along-{_slug(along.slicing.axis.path)}"


def _slug(path: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", path.lower()).strip("-")


def _named(variant: str) -> str:
    return variant or "all runs"


def _draw_verdicts(figure: Figure, findings: Findings) -> None:
    """Shares of the verdicts, one bar for each variant."""
    names = list(findings.verdicts)
    figure.set_size_inches(WIDTH_IN, 1.2 + 0.42 * len(names))
    axes = figure.subplots()
    left = np.zeros(len(names))
    kinds = dict.fromkeys(kind for counts in findings.verdicts.values() for kind in counts)
    for kind in sorted(kinds, key=lambda k: -[*VERDICTS, k].index(k)):
        counts = [findings.verdicts[name].get(kind, 0) for name in names]
        runs = [max(1, findings.variants[name].runs) for name in names]
        widths = 100.0 * np.array(counts) / runs
        colour = VERDICT_COLOURS.get(kind, GREY)
        label = RULES.get(kind, (kind, ""))[0]
        bars = axes.barh([_named(name) for name in names], widths, left=left, color=colour)
        bars.set_label(label)
        for place, (width, count) in enumerate(zip(widths, counts, strict=True)):
            if width > 5.0:
                x = left[place] + 0.5 * width
                axes.text(x, place, f"{count}", ha="center", va="center", color="#FEFEFE")
        left += widths
    axes.invert_yaxis()
    axes.set(xlabel="share of the runs [%], with their number", xlim=(0.0, 100.0))
    axes.grid(axis="y", visible=False)
    legend_below(figure, columns=4)


def _draw_distribution(figure: Figure, sweep: Sweep, shown: Shown) -> None:
    """Share of the runs whose headline is below x, of every variant."""
    axes = figure.subplots()
    finite: list[float] = []
    for i, (name, runs) in enumerate(sweep.variants.items()):
        values = shown.factor * np.sort(runs.numbers(sweep.headline))
        known = values[np.isfinite(values)]
        finite += known.tolist()
        share = 100.0 * np.arange(1, len(known) + 1) / max(1, len(values))
        style: dict[str, Any] = {"color": SERIES[i % len(SERIES)], "label": _named(name)}
        axes.step([*known[:1], *known], [0.0, *share] if known.size else [], where="post", **style)
        if known.size and len(known) < len(values):
            axes.plot(known[-1], share[-1], MARKS[i % len(MARKS)], color=style["color"])
    if finite and is_wide((min(finite), max(finite))):
        axes.set_xscale("log")
        plain_log(axes.xaxis, (min(finite), max(finite)))
    axes.set(xlabel=shown.label, ylabel="share of the runs\nbelow this [%]", ylim=(0.0, 102.0))
    if len(sweep.variants) > 1:
        legend_below(figure, columns=4)


def _draw_along(figure: Figure, along: Along, shown: Shown) -> None:
    """Failure rate and headline along one parameter, each with its interval."""
    slicing, has_number = along.slicing, bool(shown.name)
    figure.set_size_inches(WIDTH_IN if has_number else 0.6 * WIDTH_IN, 3.1)
    panels: Sequence[Axes] = figure.subplots(1, 1 + has_number, sharex=True, squeeze=False)[0]
    for i, (name, found) in enumerate(along.groups.items()):
        places = _beside(slicing, i)
        kept = [(x, g) for x, g in zip(places, found, strict=True) if g.runs]
        if not kept:
            continue
        x = np.array([place for place, _ in kept])
        colour, label = SERIES[i % len(SERIES)], _named(name)
        mark = f"{MARKS[i % len(MARKS)]}{'-' if slicing.numeric else ''}"
        _intervals(panels[0], x, [g.failures for _, g in kept], 100.0, colour, mark, label)
        if has_number:
            if slicing.numeric:
                _band(panels[1], x, [g for _, g in kept], shown, colour)
            medians = [g.median for _, g in kept]
            _intervals(panels[1], x, medians, shown.factor, colour, mark, label)
    panels[0].set(ylabel="failure rate [%]", ylim=(-3.0, 103.0))
    if has_number:
        panels[1].set_ylabel(f"{shown.label}\nmedian; dotted: {100 * OUTER[1]:.0f} %")
        _fit_to(panels[1], [g for found in along.groups.values() for g in found], shown)
    for axes in panels:
        _place_axis(axes, along)
    if len(along.groups) > 1:
        legend_below(figure, columns=4, axes=panels[0])


def _beside(slicing: Slicing, i: int) -> list[float]:
    """Where the i-th variant is drawn: a little to the right, so that none hides another."""
    places = np.array(slicing.places)
    if not slicing.numeric:
        return [float(place) for place in places + 0.08 * i]
    if slicing.axis.logarithmic:
        return [float(place) for place in places * (places.max() / places.min()) ** (BESIDE * i)]
    return [float(place) for place in places + BESIDE * i * np.ptp(places)]


def _place_axis(axes: Axes, along: Along) -> None:
    slicing = along.slicing
    axes.set_xlabel(parameter_label(slicing.axis.path))
    if not slicing.numeric:
        axes.set_xticks(slicing.places, slicing.labels)
        axes.set_xlim(-0.5, len(slicing.labels) - 0.4)
    elif slicing.axis.logarithmic:
        axes.set_xscale("log")
        plain_log(axes.xaxis, (min(slicing.places), max(slicing.places)))
    else:
        axes.ticklabel_format(axis="x", scilimits=(-3, 5), useMathText=True)
        axes.locator_params(axis="x", nbins=6)


def _intervals(
    axes: Axes,
    x: np.ndarray,
    found: list[Interval],
    factor: float,
    colour: str,
    mark: str,
    label: str,
) -> None:
    """Numbers with their intervals as bars; what is infinite leaves the axes."""
    values = factor * np.array(found)
    shown = np.isfinite(values[:, 0])
    x, values = x[shown], values[shown]
    far = 1e3 * (1.0 + np.abs(values).max(where=np.isfinite(values), initial=0.0))
    ends = np.clip(values, -far, far)
    ends[~np.isfinite(values[:, 1]) & ~np.isfinite(values[:, 2]), 1:] = np.nan
    bars = np.abs(ends[:, 1:] - ends[:, :1]).T
    axes.errorbar(x, values[:, 0], bars, fmt="none", ecolor=colour, capsize=2.5, elinewidth=1.2)
    axes.plot(x, values[:, 0], mark, color=colour, markersize=4, linewidth=1.2, label=label)


def _band(axes: Axes, x: np.ndarray, groups: list[Group], shown: Shown, colour: str) -> None:
    """The median's interval as a band, and the upper quantile; what is infinite leaves the axes."""
    ends = shown.factor * np.array([g.median[1:] for g in groups])
    known = np.isfinite(ends[:, 0])
    top = np.where(np.isinf(ends[:, 1]), 1e9, ends[:, 1])
    axes.fill_between(x, ends[:, 0], top, where=known, color=colour, alpha=0.18, linewidth=0)
    upper = shown.factor * np.array([g.outer[1] for g in groups])
    axes.plot(x, np.where(np.isinf(upper), np.nan, upper), ":", color=colour, linewidth=1.2)


def _fit_to(axes: Axes, groups: list[Group], shown: Shown) -> None:
    """Limits around what is finite, on a logarithmic scale if that is wide."""
    numbers = np.array([(*g.median, g.outer[1]) for g in groups if g.runs]).reshape(-1, 4)
    finite = shown.factor * numbers[np.isfinite(numbers)]
    if not finite.size:
        axes.text(0.5, 0.5, "no run has a number", transform=axes.transAxes, ha="center")
        return
    low, high = float(finite.min()), float(finite.max())
    if is_wide((low, high)):
        axes.set_yscale("log")
        axes.set_ylim(low / 1.3, high * 1.3)
        plain_log(axes.yaxis, (low, high))
    elif high > low:
        axes.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))


def _draw_sensitivity(
    figure: Figure, found: list[Sensitivity], labels: list[str], shown: Shown
) -> None:
    """First-order and total indices, one panel for each number that varies."""
    varied = [one for one in found if one.indices is not None]
    if not varied:
        figure.text(0.5, 0.5, "no number varies: nothing to explain", ha="center")
        return
    columns, place = min(2, len(varied)), np.arange(len(labels))
    rows = math.ceil(len(varied) / columns)
    figure.set_size_inches(WIDTH_IN, 0.8 + rows * (0.7 + 0.34 * len(labels)))
    grid = panel_grid(figure, len(varied), columns, "share of the variance")
    for axes, one in zip(grid.flat, varied, strict=False):
        axes.set_title(f"{one.variant + ': ' if one.variant else ''}{_kind(one.of, shown)}")
        for kind, colour, mark, shift in (
            ("first", BLUE, "o", -0.14),
            ("total", VERMILION, "s", 0.14),
        ):
            for i, index in enumerate(one.indices or ()):
                value, low, high = getattr(index, kind)
                bars = [[max(0.0, value - low)], [max(0.0, high - value)]]
                fill = colour if index.converged else "none"
                axes.errorbar(
                    value, i + shift, xerr=bars, fmt=mark, color=colour, mfc=fill, ms=5, capsize=2
                )
        axes.set_yticks(place, labels)
        axes.axvline(0.0, color=INK, linewidth=0.8)
    grid[0, 0].invert_yaxis()
    _name_indices(grid[0, 0])
    legend_below(figure, axes=grid[0, 0])


def _name_indices(axes: Axes) -> None:
    axes.plot([], [], "o", color=BLUE, label="first order: alone")
    axes.plot([], [], "s", color=VERMILION, label="total: with all it does together with others")
    axes.plot([], [], "o", color=GREY, mfc="none", label="not converged")


def _kind(of: str, shown: Shown) -> str:
    return {"failed": "failed or not", "headline": shown.name, "rank": f"rank of {shown.name}"}[of]


def _draw_pairs(figure: Figure, pairs: list[Pair], shown: Shown) -> None:
    """Differences of paired runs: of the headline, and of failure rates."""
    has_number = any(pair.found.compared for pair in pairs)
    figure.set_size_inches(WIDTH_IN, 1.3 + 0.42 * len(pairs))
    panels = figure.subplots(1, 1 + has_number, sharey=True, squeeze=False)[0]
    labels = [f"{pair.ours} − {pair.theirs}" for pair in pairs]
    drawn = [("failure rate [% of the pairs]", 100.0, [pair.found.failures for pair in pairs])]
    if has_number:
        drawn.append((shown.label, shown.factor, [pair.found.difference for pair in pairs]))
    for axes, (label, factor, found) in zip(panels, drawn, strict=True):
        values = factor * np.array(found)
        far = 10.0 * (1.0 + np.abs(values).max(where=np.isfinite(values), initial=0.0))
        finite = values[np.isfinite(values)]
        for i, (value, low, high) in enumerate(np.clip(values, -far, far)):
            if np.isfinite(values[i, 0]):
                bars = [[max(0.0, value - low)], [max(0.0, high - value)]]
                axes.errorbar(value, i, xerr=bars, fmt="o", color=BLUE, ms=5, capsize=3)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set(xlabel=f"difference of {label}", yticks=range(len(pairs)), yticklabels=labels)
        axes.locator_params(axis="x", nbins=5)
        span = max(float(np.abs(finite).max(initial=0.0)), 1e-12)
        ends = finite.min(initial=0.0), finite.max(initial=0.0)
        axes.set_xlim(min(-0.1 * span, 1.1 * ends[0]), max(0.1 * span, 1.1 * ends[1]))
        axes.set_ylim(len(pairs) - 0.5, -0.5)
