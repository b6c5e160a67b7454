"""Basins of attraction, drawn side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ttwmr_mj.studies.basin import Basin


def write_basin_figure(basins: dict[str, Basin], path: Path, title: str) -> None:
    """One panel per controller: which starts are caught.

    Args:
        basins: name of the controller → its basin.
        path: a .png or .svg file.
        title: over all panels.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(basins), 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(basins), sharey=True, squeeze=False)[0]
    colours = ListedColormap(["#e9e4de", "#3b7ea1"])
    for axes, (name, basin) in zip(panels, basins.items(), strict=True):
        axes.pcolormesh(
            1e3 * basin.position_offset_m,
            np.degrees(basin.theta2_offset_rad),
            basin.caught.T.astype(float),
            cmap=colours,
            vmin=0,
            vmax=1,
            shading="nearest",
        )
        axes.plot(0, 0, marker="+", color="white", markersize=12, markeredgewidth=2)
        axes.set_title(f"{name}: {100 * basin.share:.0f} % caught")
        axes.set_xlabel("offset of P to the left [mm]")
    panels[0].set_ylabel("offset of θ2 [°]")
    figure.suptitle(title)
    temporary = path.with_name(f".{path.stem}.part{path.suffix}")
    figure.savefig(temporary, dpi=150)
    temporary.replace(path)
