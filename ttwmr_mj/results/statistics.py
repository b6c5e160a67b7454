"""Intervals for what many runs say: shares of runs, quantiles, differences of paired runs.

Every interval is at LEVEL. A number that a run does not have, because the run broke off, is given
as infinity, "worse than any": quantiles then count that run, and are infinite where they fall among
such runs. Nothing is dropped here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import FloatArray

LEVEL = 0.95
RESAMPLES = 2000  # of a bootstrap: its 2.5 % ends then rest on 50 resamples each


class Interval(NamedTuple):
    """A number found from runs, and between what it lies."""

    value: float
    low: float
    high: float


def share(count: int, of: int, level: float = LEVEL) -> Interval:
    """The share of runs, with the exact binomial interval (Clopper and Pearson, 1934).

    Args:
        count: runs that have the property.
        of: all runs; 0 gives the interval from 0 to 1 around NaN.
        level: confidence that is kept whatever the true share.
    """
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - level)
    low = float(betaincinv(count, of - count + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, of - count, 1.0 - tail)) if count < of else 1.0
    return Interval(count / of if of else math.nan, low, high)


def quantile(values: FloatArray, at: float, rng: np.random.Generator) -> Interval:
    """A quantile (0.5: the median) of values (n,), with its percentile bootstrap interval.

    The k-th smallest of n draws with replacement is the value at place ⌈n·U⌉ of the sorted ones,
    where U is the k-th smallest of n uniform numbers, which has a beta distribution: a resample
    costs two random numbers, not n. No value gives NaN; one value no interval, but infinite ends.
    """
    ranked, n = np.sort(values), len(values)
    if n == 0:
        return Interval(math.nan, math.nan, math.nan)
    place = at * (n - 1)
    below, part = math.floor(place), place - math.floor(place)
    value = float(_between(ranked[below], ranked[min(below + 1, n - 1)], part))
    if n == 1:
        return Interval(value, -math.inf, math.inf)
    first = rng.beta(below + 1, n - below, RESAMPLES)
    rest = n - below - 1  # uniform numbers above the first; the smallest of them is the next
    shrink = rng.random(RESAMPLES) ** (1.0 / rest) if rest else np.ones(RESAMPLES)
    second = 1.0 - (1.0 - first) * shrink
    low, high = (ranked[np.minimum((n * u).astype(int), n - 1)] for u in (first, second))
    found = np.sort(_between(low, high, part))
    cut = round(0.5 * (1.0 - LEVEL) * RESAMPLES)
    return Interval(value, float(found[cut]), float(found[-1 - cut]))


def median_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """Interval of the population's median, whatever the distribution: two of the values.

    The k-th smallest and the k-th largest, with the largest k for which they hold the median
    between them at LEVEL: 1 − 2·Pr(fewer than k of n fall below it). None of five and less. For the
    few seeds of a task, where a bootstrap would be too sure.
    """
    from scipy.stats import binom

    n = len(values)
    k = sum(binom.cdf(i, n, 0.5) <= 0.5 * (1.0 - LEVEL) for i in range(n))
    return (sorted(values)[k - 1], sorted(values)[n - k]) if k else None


def sign_test(wins: int, losses: int) -> float:
    """Exact two-sided p of so uneven a result between equals."""
    from scipy.stats import binomtest

    return float(binomtest(wins, wins + losses).pvalue) if wins + losses else 1.0


def _between(low: FloatArray, high: FloatArray, part: float) -> FloatArray:
    """Part of the way from low to high, each of which may be infinite."""
    if part == 0.0:
        return low
    with np.errstate(invalid="ignore"):
        inside = low + part * (high - low)
    return np.where(np.isfinite(low) & np.isfinite(high), inside, np.where(low == high, low, high))


@dataclass(frozen=True, slots=True)
class Paired:
    """Two alternatives, `ours` and `theirs`, on the same draws and seeds; smaller is better.

    Attributes:
        pairs: how many there are.
        only_ours, only_theirs: pairs in which this one alone failed.
        both: pairs in which both failed.
        failures: failure rate of ours minus theirs; its interval holds at least LEVEL.
        difference: median of ours minus theirs over the pairs that have a difference.
        better, worse: pairs in which ours is smaller, and larger; a number beats none.
        unknown: pairs in which neither has a number.
        wins: better per better or worse, with its exact interval; a sign test.
    """

    pairs: int
    only_ours: int
    only_theirs: int
    both: int
    failures: Interval
    difference: Interval
    better: int
    worse: int
    unknown: int
    wins: Interval

    @property
    def equal(self) -> int:
        """Pairs in which both have the same number."""
        return self.pairs - self.better - self.worse - self.unknown

    @property
    def favours(self) -> int:
        """−1 where ours is better beyond doubt, 1 where worse, 0 where the interval holds 0."""
        return (self.difference.low > 0.0) - (self.difference.high < 0.0)


def paired(
    ours: FloatArray,
    theirs: FloatArray,
    failed: tuple[np.ndarray, np.ndarray],
    rng: np.random.Generator,
) -> Paired:
    """Compare numbers (n,) pair by pair; infinite where a run has none.

    Args:
        ours: of one alternative.
        theirs: of the other.
        failed: (n,) which runs failed, of either.
        rng: for the bootstrap.
    """
    known = np.isfinite(ours) | np.isfinite(theirs)
    difference = ours[known] - theirs[known]
    better, worse = int((difference < 0.0).sum()), int((difference > 0.0).sum())
    only_ours, only_theirs = (int((a & ~b).sum()) for a, b in (failed, failed[::-1]))
    return Paired(
        pairs=len(ours),
        only_ours=only_ours,
        only_theirs=only_theirs,
        both=int((failed[0] & failed[1]).sum()),
        failures=share_difference(only_ours, only_theirs, len(ours)),
        difference=quantile(difference, 0.5, rng),
        better=better,
        worse=worse,
        unknown=int((~known).sum()),
        wins=share(better, better + worse),
    )


def share_difference(only_ours: int, only_theirs: int, pairs: int) -> Interval:
    """The difference of two shares of the same pairs, from those in which they disagree.

    The interval joins the exact ones of the two kinds of disagreement, each at a level that leaves
    half of the error to it (Bonferroni): never too sure, also where no pair disagrees.
    """
    each = 1.0 - 0.5 * (1.0 - LEVEL)
    up, down = share(only_ours, pairs, each), share(only_theirs, pairs, each)
    return Interval(up.value - down.value, up.low - down.high, up.high - down.low)
