"""Gauss-Legendre rules and what they make of successive stretches of time, for `rollout`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """A Gauss-Legendre rule on [0, 1] and the stretches it is good for."""

    nodes: FloatArray  # (n,)
    weights: FloatArray  # (n,)
    once: FloatArray  # (n, n) integrals from 0 to each node
    twice: FloatArray  # (n, n) the integrals' integrals
    longest: float  # extent of a stretch up to which errors stay below 1e-10


class Integrals(NamedTuple):
    """Integrals from the start of a window over its stretches' n nodes, as matrices."""

    time: FloatArray  # (n,) of the nodes
    end: FloatArray  # (stretch,) times of the stretches' ends
    once: FloatArray  # (n, n) from the start to every node
    twice: FloatArray  # (n, n) the integral's integral
    once_to_end: FloatArray  # (stretch, n) from the start to every stretch's end
    twice_to_end: FloatArray  # (stretch, n)


@lru_cache(maxsize=8)
def integrals(rule: Rule, durations: tuple[float, ...]) -> Integrals:
    """The integrals over stretches of these durations."""
    duration = np.array(durations)
    count, size = duration.size, len(rule.nodes)
    end = np.cumsum(duration)
    time = ((end - duration)[:, None] + np.outer(duration, rule.nodes)).ravel()
    weight = np.outer(duration, rule.weights).ravel()
    before, until = _masks(count, size)
    once = before * weight
    twice = time[:, None] - time
    twice *= once
    within, diagonal = (count, size, count, size), np.arange(count)
    once.reshape(within)[diagonal, :, diagonal] = duration[:, None, None] * rule.once
    twice.reshape(within)[diagonal, :, diagonal] = duration[:, None, None] ** 2 * rule.twice
    once_to_end = until * weight
    return Integrals(time, end, once, twice, once_to_end, once_to_end * (end[:, None] - time))


@lru_cache(maxsize=64)
def _masks(count: int, size: int) -> tuple[FloatArray, FloatArray]:
    """Ones for nodes of earlier stretches than a node's, and of those up to a stretch's end."""
    earlier = np.tri(count, count, -1)
    before = np.repeat(np.repeat(earlier, size, axis=0), size, axis=1)
    return before, np.repeat(np.tri(count), size, axis=1)


def rule_for(extent: float, alone: bool) -> Rule:
    """The rule for stretches of this extent at most, one simulation or a batch."""
    for count, longest in ((2, 0.02), (3, 0.12), (4, 0.35)):
        if extent < longest:
            return _gauss(count, longest)
    return _gauss(16, 2.0) if alone else _gauss(5, 0.5)


@cache
def _gauss(count: int, longest: float) -> Rule:
    nodes, weights = (np.asarray(a, np.float64) for a in np.polynomial.legendre.leggauss(count))
    # integrals of the Legendre polynomials: ∫P_j = (P_{j+1} − P_{j−1})/(2j + 1)
    values = np.polynomial.legendre.legvander(nodes, count)
    integrals = np.empty((count, count))
    integrals[:, 0] = nodes + 1.0
    odd = 2.0 * np.arange(1, count) + 1.0
    integrals[:, 1:] = (values[:, 2:] - values[:, :-2]) / odd
    once = np.asarray(0.5 * np.linalg.solve(values[:, :count].T, integrals.T).T, np.float64)
    return Rule(0.5 + 0.5 * nodes, 0.5 * weights, once, once @ once, longest)
