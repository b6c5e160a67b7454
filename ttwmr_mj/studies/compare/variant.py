"""The same scenario with something else about it."""

from __future__ import annotations

from typing import Any, Literal

from ttwmr_mj.scenario.schema import Scenario


def on_plant(scenario: Scenario, kind: Literal["contact", "analytic"]) -> Scenario:
    """The scenario on the other plant, or on the same."""
    physics_rate = scenario.output.physics_rate and kind == "contact"
    return changed(scenario, {"plant.kind": kind, "output.physics_rate": physics_rate})


def changed(scenario: Scenario, values: dict[str, Any]) -> Scenario:
    """The scenario with values replaced, key.path → value; the result is checked like a file.

    Keys are this package's own, so a wrong one is a mistake here and raises KeyError.
    """
    data = scenario.model_dump()
    for path, value in values.items():
        *sections, key = path.split(".")
        place = data
        for section in sections:
            place = place[section]
        if key not in place:
            raise KeyError(path)
        place[key] = value
    return Scenario.model_validate(data)
