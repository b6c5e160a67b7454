"""The scenario of a run folder, whose file holds every value that was used."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import parse_toml
from ttwmr_mj.scenario.file import check_scenario, dump_scenario, find_scenario, read_scenario
from ttwmr_mj.scenario.schema import Scenario

FIRST = 3  # keys that are told of those that are missing
HINT = (
    "it was cut off or edited, or a version without these keys wrote it; run the scenario again, "
    "or add what is missing as it was in that run"
)


def read_resolved(file: Path) -> Scenario:
    """Read a scenario.resolved.toml as the record of a run, of which nothing is left out.

    Raises:
        InputError: it cannot be read as a scenario, or lacks values, which defaults would replace.
    """
    data = read_scenario(find_scenario(str(file)))  # which waits for no pipe
    scenario = check_scenario(data, str(file), file.parent)
    missing = list(_missing(parse_toml(dump_scenario(scenario)), data))
    if not missing and file.read_bytes().endswith(b"\n"):
        return scenario
    more = f" and {len(missing) - FIRST} more" if len(missing) > FIRST else ""
    lacks = f"{', '.join(missing[:FIRST])}{more}" if missing else "the end of its last line"
    problem = f"lacks {lacks}; a run's file holds every value that was used"
    raise InputError(Fault(problem=problem, hint=HINT), file=str(file))


def _missing(whole: Any, given: Any, within: str = "") -> Iterator[str]:
    """Keys of the one that the other lacks; of a table that is missing, only its own."""
    if isinstance(whole, list) and isinstance(given, list):
        whole, given = dict(enumerate(whole)), dict(enumerate(given))
    if not (isinstance(whole, dict) and isinstance(given, dict)):
        return
    for key, value in whole.items():
        if key in given:
            yield from _missing(value, given[key], f"{within}{key}.")
        else:
            yield f"{within}{key}"
