"""Basins of attraction, drawn side by side."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from basin import Basin

from ttwmr_mj.figures.canvas import canvas, save

LOST = "#ded9d2"  # a warm grey, behind the colours of what was caught


class Panel(NamedTuple):
    """One basin."""

    title: str
    basin: Basin
    labels: tuple[str, str] = ("P off to the left [mm]", "θ2 off [°]")
    start: tuple[float, float] | None = None  # of the shipped scenario, as the axes have it


def write_basin_figure(panels: list[Panel], path: Path, title: str) -> None:
    """Side by side which starts are caught, and how soon.

    Args:
        panels: from left to right. Offsets are in mm where the label says so, else in degrees.
        path: a .png or .svg file.
        title: over all panels.
    """
    import matplotlib as mpl

    caught = [basin for _, basin, *_ in panels if basin.share]
    slowest = max((np.nanmax(basin.caught_after_s) for basin in caught), default=1.0)
    looks = {"axes.grid": False, "font.size": 11, "axes.titlesize": 13}
    with canvas((max(3.1 * len(panels) + 1.0, 7.0), 3.9), looks) as figure:
        drawn = figure.subplots(1, len(panels), squeeze=False)[0]
        colours = mpl.colormaps["viridis_r"].with_extremes(bad=LOST)
        before = ""
        for axes, (name, basin, labels, start) in zip(drawn, panels, strict=True):
            across, up = (
                1e3 * values if "[mm]" in label else np.degrees(values)
                for values, label in zip((basin.across, basin.up), labels, strict=True)
            )
            mesh = axes.pcolormesh(
                across,
                up,
                np.ma.masked_invalid(basin.caught_after_s.T),
                cmap=colours,
                vmin=0.0,
                vmax=np.ceil(slowest),
                shading="nearest",
                rasterized=True,
            )
            axes.set_facecolor(LOST)
            axes.plot(0.0, 0.0, "+", color="white", markersize=11, markeredgewidth=2)
            if start is not None:
                axes.plot(*start, "o", color="none", markeredgecolor="white", markersize=6)
            axes.set_title(f"{name}: {100 * basin.share:.0f} % caught")
            axes.set_xlabel(labels[0])
            if labels[1] != before:
                axes.set_ylabel(labels[1])
            before = labels[1]
        bar = figure.colorbar(mesh, ax=list(drawn), pad=0.015, aspect=28)
        bar.set_label("caught after [s], grey: lost")
        figure.suptitle(title, fontsize=14)
        save(figure, path)
