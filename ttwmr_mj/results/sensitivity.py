"""Which parameter matters: Sobol indices of a number over a design of runs."""

import math
from typing import NamedTuple

import numpy as np

from ttwmr_mj.results.statistics import LEVEL, Interval
from ttwmr_mj.state import FloatArray

RESAMPLES = 2000  # of the bootstrap: its 2.5 % ends then rest on 50 resamples each
CONVERGED = 0.1  # an index whose interval is wider than ± this is not converged
FEWEST = 16  # base samples below which a bootstrap says nothing about its own width
# the fewest runs that may carry the variance, of a number that is 0 or 1 about as many failures:
# with fewer a parameter that matters may by chance have changed nothing, in any resample
CARRIERS = 50.0


class Indices(NamedTuple):
    """What one parameter does to the variance of a number.

    Attributes:
        first: share of the variance that it causes alone.
        total: share that goes when it is fixed, with all that it does together with others.
        converged: whether both intervals are narrow enough to be read, enough runs carry the
            variance, and all totals together can be the 1 or more that they are of any number that
            varies.
    """

    first: Interval
    total: Interval
    converged: bool


def sobol_indices(
    a: FloatArray, b: FloatArray, ab: FloatArray, rng: np.random.Generator
) -> list[Indices] | None:
    """First-order and total indices of each parameter, with percentile bootstrap intervals.

    First order by Saltelli et al. (2010), Table 2 (b), total by Jansen, Table 2 (f). The same as
    `scipy.stats.sobol_indices`, which takes only powers of 2 and no generator for its bootstrap.

    Args:
        a: (n,) the number at the design's base samples A.
        b: (n,) at B, drawn independently.
        ab: (parameters, n) at A with one parameter's column from B.
        rng: for the bootstrap.

    Returns:
        One each; None where the number never varies, so that there is nothing to explain.
    """
    if np.ptp(np.concatenate([a, b, *ab])) == 0.0:
        return None
    first, total = _indices(a[None], b[None], ab[:, None])
    n, cut = len(a), round(0.5 * (1.0 - LEVEL) * RESAMPLES)
    parts: list[tuple[FloatArray, FloatArray]] = []
    for size in np.diff(np.linspace(0, RESAMPLES, 21).astype(int)):  # a twentieth at a time
        chosen = rng.integers(n, size=(size, n))
        parts.append(_indices(a[chosen], b[chosen], ab[:, chosen]))
    drawn = [np.sort(np.concatenate(kind, axis=1)) for kind in zip(*parts, strict=True)]

    def interval(values: FloatArray, draws: FloatArray, i: int) -> Interval:
        return Interval(float(values[i, 0]), float(draws[i, cut]), float(draws[i, -1 - cut]))

    found = [(interval(first, drawn[0], i), interval(total, drawn[1], i)) for i in range(len(ab))]
    # what varies only in rows that the indices give no weight, such as a failure in B, is explained
    # by nobody, and by any resample alike
    whole = sum(total.high for _, total in found) >= 1.0 - CONVERGED
    readable = n >= FEWEST and whole and _carriers(np.concatenate([a, b, *ab])) >= CARRIERS
    return [Indices(*both, readable and all(map(_narrow, both))) for both in found]


def _carriers(values: FloatArray) -> float:
    """How many of n values carry their variance: n/(kurtosis − 1).

    The standard error of the variance is one over the root of this, relative to it. Of n normal
    values n/2; where few of n differ from the others, about their number; where two values are as
    frequent as each other, no limit.
    """
    off = (values - values.mean()) ** 2
    spread = float(off.var())
    return math.inf if spread == 0.0 else len(values) * float(off.mean()) ** 2 / spread


def _narrow(index: Interval) -> bool:
    return 0.5 * (index.high - index.low) <= CONVERGED


def _indices(a: FloatArray, b: FloatArray, ab: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and total indices (parameters, resamples) of a, b (resamples, n), ab with both."""
    both = np.concatenate([a, b], axis=-1)
    mean = both.mean(axis=-1, keepdims=True)
    variance = both.var(axis=-1)
    first = ((b - mean) * (ab - a)).mean(axis=-1)
    total = 0.5 * ((a - ab) ** 2).mean(axis=-1)

    def share(part: FloatArray) -> FloatArray:
        """A resample that happens to be constant explains nothing: 0, not 0/0."""
        varies = variance > 0.0
        return np.where(varies, part / np.where(varies, variance, 1.0), 0.0)

    return share(first), share(total)
