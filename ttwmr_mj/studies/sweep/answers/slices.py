"""Runs along a parameter: by its values if they are few, else in bins of equally many runs."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ttwmr_mj.results.statistics import Interval, quantile, share
from ttwmr_mj.studies.sweep.answers.read import Axis, Sweep
from ttwmr_mj.studies.sweep.answers.words import numbers

MOST_VALUES = 24  # that are shown one by one
BINS = 10
FEWEST = 20  # values of a bin: fewer have intervals too wide to read
BY_CHANCE = 0.05  # probability below which what a parameter explains is not put down to chance
TINY = 1e-12  # share of a variance that is rounding
OUTER = (0.05, 0.95)  # quantiles that a robustness curve's band lies between


@dataclass(frozen=True)
class Slicing:
    """How one axis is cut.

    Attributes:
        axis: which.
        labels: of the parts.
        places: where each is drawn: its value or the median of its values; 0, 1, … for texts.
        edges: between parts; empty if they are values.
        values: each part's value; empty if they are bins.
    """

    axis: Axis
    labels: list[str]
    places: list[float]
    edges: np.ndarray
    values: list[object]

    @classmethod
    def of(cls, sweep: Sweep, axis: Axis, bins: int = BINS) -> Slicing:
        """Cut by all runs, so that variants share it."""
        column = sweep.table[axis.path]
        distinct = np.unique(column)
        if column.dtype.kind not in "fiu":
            values = [v for v in axis.given.get("values", distinct.tolist()) if v in distinct]
            labels, places = [str(v) for v in values], [float(i) for i in range(len(values))]
            return cls(axis, labels, places, np.zeros(0), values)
        listed = bool(axis.given.get("values") or axis.given.get("count"))
        if len(distinct) <= (MOST_VALUES if listed else 1):  # draws differ in all else, too
            found = distinct.tolist()
            return cls(axis, numbers(found), found, np.zeros(0), found)
        count = int(np.clip(len(distinct) // FEWEST, 2, bins))
        edges = np.quantile(column, np.linspace(0.0, 1.0, count + 1))[1:-1]
        which = np.searchsorted(edges, column, side="right")
        places = [float(np.median(column[which == i])) for i in range(count)]
        ends = numbers([column.min(), *edges, column.max()])
        labels = [f"{a} … {b}" for a, b in itertools.pairwise(ends)]
        return cls(axis, labels, places, edges, [])

    @property
    def numeric(self) -> bool:
        """Whether the places are numbers of the parameter."""
        return not self.values or isinstance(self.values[0], float | int)

    def which(self, sweep: Sweep) -> np.ndarray:
        """(n,) the part that each run is in."""
        column = sweep.table[self.axis.path]
        if not self.values:
            return np.asarray(np.searchsorted(self.edges, column, side="right"))
        parts = np.stack([column == value for value in self.values])
        return np.asarray(np.argmax(parts, axis=0))


@dataclass(frozen=True)
class Group:
    """What some runs say.

    Attributes:
        runs: how many.
        independent: how many of them share nothing that was drawn.
        failed: how many failed.
        failures: the share that failed.
        median: of the headline metric; NaN where it is undefined.
        outer: its OUTER quantiles.
    """

    runs: int
    independent: int
    failed: int
    failures: Interval
    median: Interval
    outer: tuple[float, float]

    @classmethod
    def of(cls, sweep: Sweep, metric: str) -> Group:
        """Of all runs of a sweep, or of a part of one."""
        values, free = sweep.numbers(metric) if metric else np.zeros(0), sweep.independent
        low, high = (quantile(values, at).value for at in OUTER)
        failed = int(sweep.failed.sum())
        failures = share(failed, len(sweep), independent=free)
        median = quantile(values, 0.5, independent=free)
        return cls(len(sweep), free, failed, failures, median, (low, high))


def groups(sweep: Sweep, slicings: list[Slicing], metric: str) -> np.ndarray:
    """An array of Group, with one dimension for each slicing."""
    shape = tuple(len(slicing.labels) for slicing in slicings)
    found = np.empty(shape, dtype=object)
    which = [slicing.which(sweep) for slicing in slicings]
    for place in np.ndindex(*shape):
        here = np.logical_and.reduce([w == i for w, i in zip(which, place, strict=True)])
        found[place] = Group.of(sweep.where(here), metric)
    return found


def explained(sweep: Sweep, slicing: Slicing) -> float:
    """Share of the variance within a variant that one parameter explains alone; mean of variants.

    Of who failed, or of the headline's ranks, whichever is larger: correlation ratios, less what as
    many parts explain by chance (ε², Kelley 1935). 0 where chance alone explains as much in one
    of twenty sweeps. It sorts parameters, no more.
    """
    from scipy.stats import rankdata

    kinds: list[Callable[[Sweep], np.ndarray]] = [lambda runs: runs.failed.astype(float)]
    if sweep.headline:
        # where it is undefined all runs tie
        kinds.append(
            lambda runs: np.asarray(
                rankdata(np.nan_to_num(runs.numbers(sweep.headline), posinf=np.inf))
            )
        )
    parts = [runs for runs in sweep.variants.values() if len(runs)]
    found = np.array(
        [
            [_alone(of(runs), slicing.which(runs), runs.sources(slicing.axis)) for runs in parts]
            for of in kinds
        ]
    )
    shares, chances = found[..., 0], found[..., 1]
    if chances.min() * chances.size > BY_CHANCE:
        return 0.0
    return float(shares.mean(axis=1).max())


def _alone(values: np.ndarray, which: np.ndarray, source: np.ndarray) -> tuple[float, float]:
    """What values (n,) owe to the parts (n,) they are in.

    Runs of one source (n,), which are in one part, share more than the part: what differs between
    sources measures what chance does.

    Returns:
        ε², and the probability that chance explains as much (F test).
    """
    from scipy.stats import f

    parts, sources = len(np.unique(which)), len(np.unique(source))
    total = float(((values - values.mean()) ** 2).sum())
    if total == 0.0 or parts < 2 or sources <= parts:
        return 0.0, 1.0
    between = _between(values, which)
    by_chance = max(0.0, _between(values, source) - between) / (sources - parts)
    share = max(0.0, (between - (parts - 1) * by_chance) / total)
    if by_chance <= TINY * total:
        return share, float(between <= TINY * total)
    ratio = between / (parts - 1) / by_chance
    return share, float(f.sf(ratio, parts - 1, sources - parts))


def _between(values: np.ndarray, label: np.ndarray) -> float:
    """Sum of squares between the means of values (n,) of one label (n,), and all."""
    _, label = np.unique(label, return_inverse=True)
    sums, counts = np.bincount(label, weights=values - values.mean()), np.bincount(label)
    return float((sums**2 / counts).sum())
