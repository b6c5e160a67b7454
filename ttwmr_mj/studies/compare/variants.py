"""The same scenario with something else about it, and many such variants at once."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal, TypeVar

import numpy as np

from ttwmr_mj.scenario.schema import Scenario

Progress = Callable[[float], None]  # called with the share of the work done
Made = TypeVar("Made")


def on_plant(scenario: Scenario, kind: Literal["contact", "analytic"]) -> Scenario:
    """The scenario on the other plant, or on the same."""
    physics_rate = scenario.output.physics_rate and kind == "contact"
    return changed(scenario, {"plant.kind": kind, "output.physics_rate": physics_rate})


def changed(scenario: Scenario, values: dict[str, Any]) -> Scenario:
    """The scenario with values replaced, key.path → value; the result is checked like a file.

    Keys are this package's own, so a wrong one is a mistake here and raises KeyError. The world has
    filled in the scenario already, and does not fill in again what is taken away here.
    """
    data = {**scenario.model_dump(), "world": "kind"}
    for path, value in values.items():
        *sections, key = path.split(".")
        place: Any = data
        for section in sections:
            place = place[int(section) if section.isdigit() else section]
        if key not in place:
            raise KeyError(path)
        place[key] = value
    return Scenario.model_validate(data)


def in_threads(
    make: Callable[[Scenario], Made], variants: list[Scenario], progress: Progress | None
) -> list[Made]:
    """What is made of each variant, in their order.

    Contact physics lets other threads run meanwhile. Variants with the shortest physics step take
    longest and go first.
    """
    work = np.array([1.0 / variant.plant.contact.timestep_s for variant in variants])
    order = np.argsort(-work, kind="stable").tolist()
    found = {}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for i, made in zip(order, pool.map(make, (variants[i] for i in order)), strict=True):
            found[i] = made
            if progress is not None:
                progress(float(work[list(found)].sum() / work.sum()))
    return [found[i] for i in range(len(variants))]
