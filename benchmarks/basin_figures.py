"""Basins of attraction, drawn side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from basin import Basin

from ttwmr_mj.figures.canvas import canvas, save

LOST = "#ded9d2"  # a warm grey, behind the colours of what was caught
GIVEN = (-50.0, np.degrees(0.2))  # mm, degrees: where the shipped scenario starts


def write_basin_figure(basins: dict[str, Basin], path: Path, title: str) -> None:
    """One panel per controller: which starts are caught, and how soon.

    Args:
        basins: name of the controller → its basin; all on the same grid.
        path: a .png or .svg file.
        title: over all panels.
    """
    import matplotlib as mpl

    slowest = max((np.nanmax(b.caught_after_s) for b in basins.values() if b.share), default=1.0)
    looks = {"axes.grid": False, "font.size": 11, "axes.titlesize": 13}
    with canvas((3.1 * len(basins) + 1.0, 3.9), looks) as figure:
        panels = figure.subplots(1, len(basins), sharey=True, squeeze=False)[0]
        colours = mpl.colormaps["viridis_r"].with_extremes(bad=LOST)
        for axes, (name, basin) in zip(panels, basins.items(), strict=True):
            across = 1e3 * basin.position_offset_m
            up = np.degrees(basin.theta2_offset_rad)
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
            axes.plot(*GIVEN, "o", color="none", markeredgecolor="white", markersize=6)
            axes.set_title(f"{name}: {100 * basin.share:.0f} % caught")
            axes.set_xlabel("P off to the left [mm]")
        panels[0].set_ylabel("θ2 off [°]")
        bar = figure.colorbar(mesh, ax=list(panels), pad=0.015, aspect=28)
        bar.set_label("caught after [s], grey: lost")
        figure.suptitle(f"{title}   (○ start of the shipped scenario)", fontsize=14)
        save(figure, path)
