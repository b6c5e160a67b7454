"""Scales that read well: logarithmic axes with plain numbers, colours of heat maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.colors import Colormap, Normalize

BEYOND, ABSENT = "#3A0000", "#BBBBBB"  # what is infinite, what is not there

WIDE = 20.0  # ratio of largest to smallest from which a scale is logarithmic


def is_wide(span: tuple[float, float]) -> bool:
    """Whether from the first to the second only a logarithmic scale shows both."""
    return span[0] > 0.0 and span[1] > WIDE * span[0]


def plain_log(axis: Axis, span: tuple[float, float]) -> None:
    """Ticks 1, 2, 5, 10 or, over many decades, powers of ten; written as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    steps = (1.0, 2.0, 5.0) if span[1] < 2e2 * span[0] else (1.0,)
    axis.set_major_locator(LogLocator(subs=steps, numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}".replace("-", "−")))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def heat(span: tuple[float, float]) -> tuple[Colormap, Normalize]:
    """Colours that rise evenly for every eye, and their scale: logarithmic over a wide span."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, Normalize

    low, high = span
    colours = colormaps["cividis_r"].with_extremes(over=BEYOND, bad=ABSENT)
    if is_wide(span):
        return colours, LogNorm(low, high)
    return colours, Normalize(low, high if high > low else low + 1.0)
