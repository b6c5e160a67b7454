"""Tolerances that make a comparison pass or fail, for continuous integration."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import Fault, InputError, apart, shown
from ttwmr_mj.files import read_toml
from ttwmr_mj.scenario.faults import suggestion


@dataclass(frozen=True, slots=True)
class Breach:
    """A number beyond its tolerance; `value` is None where the number is undefined."""

    key: str
    value: float | None
    allowed: float

    def __str__(self) -> str:
        if self.value is None:
            return f"{self.key}: got undefined, allowed: {self.allowed:g} at most"
        got, allowed = apart(self.value, self.allowed)
        return f"{self.key}: got {got}, allowed: {allowed} at most"


def read_tolerances(path: Path, known: Collection[str]) -> dict[str, float]:
    """A TOML file of `key = largest allowed value`, keys as in compare.json.

    Args:
        path: the file.
        known: the keys there are.

    Raises:
        InputError: the file cannot be read, is empty, or holds an unknown key or no number.
    """
    data = read_toml(path)
    found = (_fault(key, value, known) for key, value in data.items())
    faults = [fault for fault in found if fault]
    if not data:
        allowed = ", ".join(known)
        faults = [Fault(key=("--tolerance",), problem="holds no tolerance", allowed=allowed)]
    if faults:
        raise InputError(*faults, file=str(path))
    return {key: float(value) for key, value in data.items()}


def _fault(key: str, value: Any, known: Collection[str]) -> Fault | None:
    if key not in known:
        problem = f"unknown key{suggestion(key, list(known))}"
        return Fault(key=(key,), problem=problem, allowed=", ".join(known))
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
        return Fault(key=(key,), got=shown(value), allowed="a finite number, 0 or more")
    return None


def breaches(
    tolerances: Mapping[str, float], numbers: Mapping[str, float | None]
) -> tuple[Breach, ...]:
    """Which tolerances the absolute numbers exceed; an undefined number does."""

    def kept(value: float | None, allowed: float) -> bool:
        return value is not None and not math.isnan(value) and abs(value) <= allowed

    return tuple(
        Breach(key, numbers[key], allowed)
        for key, allowed in tolerances.items()
        if not kept(numbers[key], allowed)
    )
