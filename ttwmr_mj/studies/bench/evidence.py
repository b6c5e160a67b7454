"""What runs of several seeds can show: intervals, and whether one law is better than another."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ttwmr_mj.results.statistics import quantile, sign_test

SIGNIFICANCE = 0.05  # largest p at which two laws differ


class Statistic(NamedTuple):
    """One number of several runs; infinite where a run counts as worse than any number.

    Attributes:
        median: of all runs.
        low: end of the median's interval; None where the runs are too few for one, or but one.
        high: its other end.
        worst: the largest; None of a single run, which is all there is.
    """

    median: float
    low: float | None
    high: float | None
    worst: float | None

    @classmethod
    def of(cls, values: Sequence[float], scale: float = 1.0) -> "Statistic":
        """Of the values of all runs, at least one."""
        scaled = [scale * value for value in values]
        median, low, high = quantile(np.array(scaled), 0.5)
        few, one = low == -math.inf, len(scaled) == 1
        ends = (None, None) if few else (low, high)
        return cls(median, ends[0], ends[1], None if one else max(scaled))


class Outcome(NamedTuple):
    """How a run did, as laws are compared."""

    followed: bool
    error: float  # smaller is better


def better(one: Mapping[int, Outcome], other: Mapping[int, Outcome]) -> bool:
    """Whether one law is significantly better than another, by seeds that both have run.

    Exact two-sided sign test on pairs of runs with the same seed, so the same world, push and
    noise. A run that followed beats one that did not; of two that followed the smaller error wins;
    all else is a tie and does not count.
    """
    results = [_result(one[seed], other[seed]) for seed in one.keys() & other.keys()]
    wins, losses = results.count(1), results.count(-1)
    return wins > losses and sign_test(wins, losses) <= SIGNIFICANCE


def _result(one: Outcome, other: Outcome) -> int:
    """1 for a win of the first, -1 for a loss, 0 for a tie."""
    if one.followed != other.followed:
        return 1 if one.followed else -1
    if not one.followed or one.error == other.error:
        return 0
    return 1 if one.error < other.error else -1
