"""Where samples lie: points of the unit cube by their number, wherever it is asked for.

Blocks of points are made as they are needed and kept for a while, so that a plan of millions of
samples costs no memory; a Latin hypercube alone has to be made whole.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import FloatArray

IntArray = NDArray[np.int64]
BLOCK = 4096  # points that are made at once


def unit_of_seed(sampling_seed: int, seed: int, name: str) -> float:
    """What a grid draws for one seed of the runs; each axis, by its name, its own."""
    words = np.random.SeedSequence([sampling_seed, seed, *name.encode()])
    return float(np.random.default_rng(words).random())


def random_units(sampling_seed: int, names: tuple[str, ...], samples: IntArray) -> FloatArray:
    """(n, axes) independent points; an axis has the same whatever other axes there are."""
    return _gathered(lambda block: _random_block(sampling_seed, names, block), samples, len(names))


def latin_units(sampling_seed: int, axes: int, count: int, samples: IntArray) -> FloatArray:
    """(n, axes) of a Latin hypercube of `count` points: 8 bytes each per axis."""
    return _latin(sampling_seed, axes, count)[samples]


def sobol_units(sampling_seed: int, axes: int, samples: IntArray) -> FloatArray:
    """(n, axes) of a scrambled Sobol sequence."""
    return _gathered(lambda block: _sobol_block(sampling_seed, axes, block), samples, axes)


def saltelli_units(sampling_seed: int, axes: int, draws: IntArray) -> FloatArray:
    """(n, axes) of the design that Sobol indices are computed from (Saltelli et al. 2010).

    Draw (2 + axes)·k + j is point k of set j: of A (0), of B (1), or of A with axis j − 2 from B.
    A and B are the halves of one Sobol sequence in twice as many dimensions.
    """
    sample, which = np.divmod(draws, axes + 2)
    both = sobol_units(sampling_seed, 2 * axes, sample)
    a, b = both[:, :axes], both[:, axes:]
    from_b = (which[:, None] == 1) | (which[:, None] - 2 == np.arange(axes))
    return np.where(from_b, b, a)


def _gathered(block_of: Callable[[int], FloatArray], samples: IntArray, axes: int) -> FloatArray:
    """Points out of the blocks that they are in."""
    blocks, places = np.divmod(samples, BLOCK)
    found = np.empty((len(samples), axes))
    for block in np.unique(blocks).tolist():
        here = blocks == block
        found[here] = block_of(block)[places[here]]
    return found


@lru_cache(maxsize=4)
def _random_block(sampling_seed: int, names: tuple[str, ...], block: int) -> FloatArray:
    columns = [
        np.random.default_rng(np.random.SeedSequence([sampling_seed, block, *name.encode()]))
        for name in names
    ]
    return np.stack([rng.random(BLOCK) for rng in columns], axis=-1)


@lru_cache(maxsize=1)
def _latin(sampling_seed: int, axes: int, count: int) -> FloatArray:
    from scipy.stats import qmc

    return np.asarray(
        qmc.LatinHypercube(axes, rng=np.random.default_rng(sampling_seed)).random(count)
    )


@lru_cache(maxsize=4)
def _sobol_block(sampling_seed: int, axes: int, block: int) -> FloatArray:
    from scipy.stats import qmc

    points = qmc.Sobol(axes, rng=np.random.default_rng(sampling_seed))
    if block:  # forward by nothing is an error
        points.fast_forward(block * BLOCK)
    return np.asarray(points.random(BLOCK))
