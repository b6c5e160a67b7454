"""Intervals for what many runs say: shares of runs, quantiles, differences of paired runs.

Every interval is at LEVEL. A number that a run does not have, because the run broke off, is given
as infinity, "worse than any": quantiles then count that run, and are infinite where they fall among
such runs. Nothing is dropped here.

Runs that share what was drawn are not independent of each other. Where only m of n are, intervals
are those of m runs that say the same: as wide as they would be if those that share were all alike,
so never too narrow (Korn and Graubard, 1998, with the largest design effect that there can be).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import FloatArray

LEVEL = 0.95


class Interval(NamedTuple):
    """A number found from runs, and between what it lies."""

    value: float
    low: float
    high: float


def share(count: int, of: int, *, independent: int | None = None, level: float = LEVEL) -> Interval:
    """The share of runs, with the exact binomial interval (Clopper and Pearson, 1934).

    Args:
        count: runs that have the property.
        of: all runs; 0 gives the interval from 0 to 1 around NaN.
        independent: how many of them are independent of each other; None: all.
        level: confidence that is kept whatever the true share.
    """
    from scipy.special import betaincinv

    if not of:
        return Interval(math.nan, 0.0, 1.0)
    tail, runs = 0.5 * (1.0 - level), of if independent is None else min(independent, of)
    yes, no = count / of * runs, (of - count) / of * runs
    low = float(betaincinv(yes, no + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(yes + 1, no, 1.0 - tail)) if count < of else 1.0
    return Interval(count / of, low, high)


def quantile(values: FloatArray, at: float, *, independent: int | None = None) -> Interval:
    """A quantile (0.5: the median) of values (n,), with an interval whatever the distribution.

    Its ends are two of the values, or open, that is, infinite. Of n runs the number that fall below
    the population's quantile is binomial: the k-th smallest value is the lower end, with the
    largest k for which it is at most 2.5 % probable that fewer than k do; the upper one likewise.
    Where no value is far enough out, as of a median of five or less, or above a 95 % quantile of
    less than 72, that end is open; a bootstrap would be too sure. NaN is no value; of none all
    three are NaN. `independent` as in `share`: of m runs the k-th stands for n/m of the n values.
    """
    from scipy.stats import binom

    ranked = np.sort(values[~np.isnan(values)])
    if not (n := len(ranked)):
        return Interval(math.nan, math.nan, math.nan)
    place = at * (n - 1)
    below, part = math.floor(place), place - math.floor(place)
    value = _between(float(ranked[below]), float(ranked[min(below + 1, n - 1)]), part)
    m = n if independent is None else min(independent, n)
    at_most = binom.cdf(np.arange(m), m, at)  # 0, 1, … m − 1 below the population's quantile
    tail = 0.5 * (1.0 - LEVEL)
    low, high = int((at_most <= tail).sum()), int((at_most < 1.0 - tail).sum())
    return Interval(
        value,
        float(ranked[(low - 1) * n // m]) if low else -math.inf,
        float(ranked[-(-(high + 1) * n // m) - 1]) if high < m else math.inf,
    )


def sign_test(wins: int, losses: int) -> float:
    """Exact two-sided p of so uneven a result between equals."""
    from scipy.stats import binomtest

    return float(binomtest(wins, wins + losses).pvalue) if wins + losses else 1.0


def _between(low: float, high: float, part: float) -> float:
    """Part of the way from low to high, each of which may be infinite."""
    if part == 0.0 or low == high:
        return low
    return low + part * (high - low)


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
        unknown: pairs in which neither has a number, or it is undefined for one of them.
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
    def compared(self) -> int:
        """Pairs in which the numbers can be compared."""
        return self.pairs - self.unknown

    @property
    def equal(self) -> int:
        """Pairs in which both have the same number."""
        return self.compared - self.better - self.worse

    @property
    def favours(self) -> int:
        """−1 where ours is better beyond doubt, 1 where worse, 0 where the interval holds 0."""
        return (self.difference.low > 0.0) - (self.difference.high < 0.0)


def paired(
    ours: FloatArray,
    theirs: FloatArray,
    failed: tuple[np.ndarray, np.ndarray],
    *,
    independent: int | None = None,
) -> Paired:
    """Compare numbers (n,) pair by pair; infinite where a run has none, NaN where none is defined.

    Args:
        ours: of one alternative.
        theirs: of the other.
        failed: (n,) which runs failed, of either.
        independent: how many of the pairs are independent of each other; None: all.
    """
    undefined = np.isnan(ours) | np.isnan(theirs)
    known = ~undefined & (np.isfinite(ours) | np.isfinite(theirs))
    difference = ours[known] - theirs[known]
    better, worse = int((difference < 0.0).sum()), int((difference > 0.0).sum())
    only_ours, only_theirs = (int((a & ~b).sum()) for a, b in (failed, failed[::-1]))
    return Paired(
        pairs=len(ours),
        only_ours=only_ours,
        only_theirs=only_theirs,
        both=int((failed[0] & failed[1]).sum()),
        failures=share_difference(only_ours, only_theirs, len(ours), independent=independent),
        difference=quantile(difference, 0.5, independent=independent),
        better=better,
        worse=worse,
        unknown=int((~known).sum()),
        wins=share(better, better + worse, independent=independent),
    )


def share_difference(
    only_ours: int, only_theirs: int, pairs: int, *, independent: int | None = None
) -> Interval:
    """The difference of two shares of the same pairs, from those in which they disagree.

    The interval joins the exact ones of the two kinds of disagreement, each at a level that leaves
    half of the error to it (Bonferroni): never too sure, also where no pair disagrees.
    """
    each = 1.0 - 0.5 * (1.0 - LEVEL)
    up, down = (
        share(count, pairs, independent=independent, level=each)
        for count in (only_ours, only_theirs)
    )
    return Interval(up.value - down.value, up.low - down.high, up.high - down.low)
