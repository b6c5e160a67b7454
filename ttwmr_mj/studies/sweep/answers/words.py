"""Numbers, metrics and parameters in words, with units that read well."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from ttwmr_mj.results.statistics import Interval, Paired

UNITS = {
    "n_m_s_rad": "N·m·s/rad",
    "rad_s2": "rad/s²",
    "rad_s": "rad/s",
    "m_s2": "m/s²",
    "kg_m2": "kg·m²",
    "n_m": "N·m",
    "m_s": "m/s",
    "1_s": "1/s",
    "rad": "rad",
    "deg": "°",
    "kg": "kg",
    "px": "px",
    "hz": "Hz",
    "n": "N",
    "m": "m",
    "s": "s",
}
# end of a metric's name → factor and unit in which it reads well; the first that fits
READABLE = {
    "iae_m_s": (1.0, "m·s"),
    "itae_m_s2": (1.0, "m·s²"),
    "_rad_s": (1.0, "rad/s"),
    "_share": (100.0, "%"),
    "_rad": (180.0 / math.pi, "°"),
    "_m": (1e3, "mm"),
    "_s": (1.0, "s"),
    "control_effort": (1.0, "rad²/s"),
}
# what a report is about, in few words; the caption has the whole definition
BRIEF = {
    "steady_centre_of_oscillation_rmse_m": "steady trailer error",
    "steady_trailer_rmse_m": "steady trailer error",
    "steady_tractor_rmse_m": "steady tractor error",
}
Cell = tuple[str, float, str]  # as the page's tables take it: text, number to sort by, interval


class Shown(NamedTuple):
    """How a metric is shown: name in words, factor to its unit, unit."""

    name: str
    factor: float
    unit: str

    @classmethod
    def of(cls, metric: str) -> "Shown":
        """Of a name in metrics.json."""
        end = next((end for end in READABLE if metric.endswith(end)), "")
        factor, unit = READABLE.get(end, (1.0, ""))
        words = metric.removesuffix(end) if end in ("_m", "_s", "_rad", "_rad_s") else metric
        words = words.replace("rmse", "rms error").replace("_", " ")
        return cls(BRIEF.get(metric, words), factor, unit)

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def cell(self, found: Interval) -> Cell:
        """A number with its interval, without the unit."""
        return interval_cell(Interval(*(self.factor * x for x in found)))

    def said(self, found: Interval) -> str:
        """The same in one text with the unit."""
        text, _, ends = self.cell(found)
        return f"{text} {self.unit} {ends}".replace("  ", " ").strip()


def interval_cell(found: Interval) -> Cell:
    """A number and its interval as a cell."""
    unsure = found.low == -math.inf and found.high == math.inf
    ends = (
        "" if unsure or math.isnan(found.value) else f"[{number(found.low)}, {number(found.high)}]"
    )
    return number(found.value), found.value if math.isfinite(found.value) else math.inf, ends


def numbers(values: Sequence[float]) -> list[str]:
    """Those of a scale: with more than three digits where fewer would not tell them apart."""
    rounding = 1e-12 * max(map(abs, values), default=0.0)
    shown = [0.0 if abs(value) < rounding else value for value in values]
    for digits in range(3, 18):
        told = [number(value, digits) for value in shown]
        if len(set(told)) == len(set(shown)):
            break
    return told


def number(value: float, digits: int = 3) -> str:
    """Three digits; ∞ for what has no number, – for what is undefined."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0.0:
        return "0"
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e6:
        text = f"{value:.0f}"
    return text.replace("-", "−")


def percent(found: Interval) -> Cell:
    """A share as a cell in percent."""
    return interval_cell(Interval(*(100.0 * x for x in found)))


def said_percent(found: Interval) -> str:
    """A share and its interval in one text."""
    text, _, ends = percent(found)
    return f"{text} % {ends}"


def parameter_label(path: str) -> str:
    """A parameter's last key in words, with its unit: what axes are labelled with."""
    key = path.rpartition(".")[2]
    end = next((end for end in UNITS if key.endswith(f"_{end}")), "")
    words = key.removesuffix(f"_{end}") if end else key
    owner = path.split(".")[-2] if "." in path else ""
    owner = "" if owner in words.split("_") else owner  # no "noise read noise"
    believed = "believed " if path.startswith("belief.") else ""
    text = " ".join(f"{believed}{owner} {words}".replace("_", " ").split())
    return f"{text} [{UNITS[end]}]" if end else text


def compared(ours: str, theirs: str, found: Paired, shown: Shown) -> str:
    """Which of two variants has the smaller number, if that can be told.

    Args:
        ours: name of the one.
        theirs: name of the other.
        found: what came of their pairs.
        shown: the number.
    """
    if not found.compared:
        return f"No pair of {ours} and {theirs} has a {shown.name} to compare."
    if found.favours:
        ahead, behind = (ours, theirs)[:: -found.favours]
        value, low, high = found.difference
        by = Interval(abs(value), *sorted((abs(low), abs(high))))
        return (
            f"{ahead} has a smaller {shown.name} than {behind}, by {shown.said(by)} in the median "
            f"of {found.compared} pairs on the same draws and seeds."
        )
    if not found.wins.low <= 0.5 <= found.wins.high:  # but for what is equal there is a difference
        return (
            f"{ours} and {theirs} have the same {shown.name} in {found.equal} of {found.compared} "
            f"pairs on the same draws and seeds; of the other pairs {ours} has the smaller one in "
            f"{said_percent(found.wins)}."
        )
    return (
        f"{ours} and {theirs} do not differ measurably in {shown.name}: "
        f"{shown.said(found.difference)} in the median of {found.compared} pairs."
    )
