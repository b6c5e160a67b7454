"""Scales of axes that read well: logarithmic ones with plain numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axis import Axis

WIDE = 20.0  # ratio of largest to smallest from which a scale is logarithmic


def plain_log(axis: Axis, span: tuple[float, float]) -> None:
    """Ticks 1, 2, 5, 10 or, over many decades, powers of ten; written as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    steps = (1.0, 2.0, 5.0) if span[1] < 2e2 * span[0] else (1.0,)
    axis.set_major_locator(LogLocator(subs=steps, numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}".replace("-", "−")))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
