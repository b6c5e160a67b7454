"""Tolerances that make a comparison pass or fail, for continuous integration."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.faults import suggestion


@dataclass(frozen=True, slots=True)
class Breach:
    """A number beyond its tolerance; `value` is None where the number is undefined."""

    key: str
    value: float | None
    allowed: float

    def __str__(self) -> str:
        got = "undefined" if self.value is None else f"{self.value:.6g}"
        return f"{self.key}: got {got}, allowed: {self.allowed:g} at most"


def read_tolerances(path: Path, known: Collection[str]) -> dict[str, float]:
    """A TOML file of `key = largest allowed value`, keys as in compare.json.

    Args:
        path: the file.
        known: the keys there are.

    Raises:
        InputError: the file cannot be read, is empty, or holds an unknown key or no number.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"--tolerance {path}: cannot be read as TOML: {error}") from error
    if not data:
        raise InputError(f"--tolerance {path}: holds no tolerance; allowed: {', '.join(known)}")
    return {key: _number(path, key, value, known) for key, value in data.items()}


def _number(path: Path, key: str, value: Any, known: Collection[str]) -> float:
    if key not in known:
        hint = suggestion(key, list(known))
        allowed = ", ".join(known)
        raise InputError(f"--tolerance {path}: {key}: unknown key{hint}; allowed: {allowed}")
    if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
        raise InputError(f"--tolerance {path}: {key}: got {value!r}; allowed: a number, 0 or more")
    return float(value)


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
