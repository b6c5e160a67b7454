"""Colours, sizes and matplotlib settings with one meaning in every figure."""

from typing import Any

INK = "#222222"
BLUE, VERMILION, GREEN, PINK = "#0072B2", "#D55E00", "#009E73", "#C2478A"
ORANGE, SKY, GREY = "#E69F00", "#56B4E9", "#777777"
TRACTOR, TRAILER, HITCH = BLUE, PINK, ORANGE
RIGHT, LEFT = BLUE, VERMILION
# of several alternatives side by side: colours and marks, so that no colour stands alone
SERIES = (BLUE, VERMILION, GREEN, PINK, ORANGE, SKY, GREY)
MARKS = "os^Dv<>ph*X"
REFERENCE: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 2)), "linewidth": 1.0}
# what was asked for: wide and pale below what happened, so that both are seen where they agree
BAND: dict[str, Any] = {"color": "#F2C879", "linewidth": 4.0, "zorder": 1.5}

SIZE_IN = (4.8, 3.0)
PATHS_SIZE_IN = (4.8, 4.2)
DPI = 150
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "figure.titlesize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "ttwmr",  # else ids in the SVG are random
}
