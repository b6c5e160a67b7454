"""Every run of the reproduction, from runs.toml: a shipped scenario and what is changed in it.

`ttwmr run SCENARIO --set ...` with these overrides gives the same trajectory; so does
`ttwmr run runs/NAME/scenario.resolved.toml`.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.reproduce.words import read_toml


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run."""

    name: str  # of its folder under runs/
    base: str  # the shipped scenario
    overrides: tuple[str, ...]  # `key.path=value`, as on the command line
    recording: bool = True  # whether it leaves a run.rrd

    def scenario(self) -> Scenario:
        """The scenario, checked."""
        told = [
            *self.overrides,
            f"name={self.name}",
            f"output.recording={str(self.recording).lower()}",
            "output.figures=false",
        ]
        return load_scenario(self.base, told)

    def command(self) -> list[str]:
        """How to run it alone, word by word."""
        told = (word for override in self.overrides for word in ("--set", override))
        return ["ttwmr", "run", self.base, *told]


def _specs(changes: dict[str, list[str]], table: dict[str, Any]) -> Iterator[RunSpec]:
    """The runs of a [[runs]] table."""

    def overrides(change: str) -> Iterator[str]:
        if "=" in change:
            yield change
        else:
            yield from (told for inner in changes[change] for told in overrides(inner))

    each: dict[str, list[str]] = table.get("each", {})
    for chosen in itertools.product(*each.values()):
        words = dict(zip(each, chosen, strict=True))
        told = (_filled(change, words) for change in table["changes"])
        every = tuple(override for change in told for override in overrides(change))
        name = _filled(table["name"], words)
        yield RunSpec(name, table["scenario"], every, table.get("recording", True))


def _filled(text: str, words: dict[str, str]) -> str:
    """The text with the words in its braces; other braces, as of inline tables, stay."""
    for key, word in words.items():
        text = text.replace(f"{{{key}}}", word)
    return text


def _read() -> dict[str, RunSpec]:
    told = read_toml(__package__, "runs.toml")
    specs = (spec for table in told["runs"] for spec in _specs(told["changes"], table))
    return {spec.name: spec for spec in specs}


RUNS = _read()


def matching(patterns: Iterable[str], names: Iterable[str]) -> tuple[str, ...]:
    """Names that match, pattern by pattern (`*` is anything).

    Raises:
        KeyError: a pattern matches none.
    """
    known, found = list(names), list[str]()
    for pattern in patterns:
        matched = [name for name in known if fnmatchcase(name, pattern)]
        if not matched:
            raise KeyError(pattern)
        found += matched
    return tuple(dict.fromkeys(found))
