"""Many variants of a scenario on contact physics at once."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from ttwmr_mj.scenario.schema import Scenario

Progress = Callable[[float], None]  # called with the share of the work done


Made = TypeVar("Made")


def in_threads(
    make: Callable[[Scenario], Made], variants: list[Scenario], progress: Progress | None
) -> list[Made]:
    """What is made of each variant, in their order.

    Contact physics lets other threads run meanwhile. Variants with the shortest physics step take
    longest and go first.
    """
    work = np.array([1.0 / variant.plant.contact.timestep_s for variant in variants])
    order = np.argsort(-work, kind="stable").tolist()
    done = np.cumsum(work[order])
    found = {}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        made = pool.map(make, (variants[i] for i in order))
        for i, result, so_far in zip(order, made, done, strict=True):
            found[i] = result
            if progress is not None:
                progress(float(so_far / done[-1]))
    return [found[i] for i in range(len(variants))]
