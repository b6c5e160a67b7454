"""Texts of this room's data files, and numbers put into them."""

import math
import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any


def read_toml(package: str | None, name: str) -> dict[str, Any]:
    """A data file beside a package's modules; a text over several lines as one line."""
    assert package is not None  # of a module in a package, which all of ours are
    text = (resources.files(package) / name).read_text(encoding="utf-8")
    read: dict[str, Any] = _joined(tomllib.loads(text))
    return read


def _joined(value: Any) -> Any:
    match value:
        case str():
            return " ".join(value.split())
        case list():
            return [_joined(item) for item in value]
        case dict():
            return {key: _joined(item) for key, item in value.items()}
    return value


def told(text: str, values: Mapping[str, float | str]) -> str:
    """A text with values in its braces.

    Besides Python's formats, `{x:mm}` is a length, `{x:x100}` is 100 times x without digits after
    the point, and so with other factors.
    """
    shown = {k: v if isinstance(v, str) else _Shown(v) for k, v in values.items()}
    return text.format(**shown)


class _Shown(float):
    def __format__(self, how: str) -> str:
        if how == "mm":
            return mm(self)
        return f"{float(how[1:]) * self:.0f}" if how.startswith("x") else super().__format__(how)


def mm(number: float) -> str:
    """A length for reading, three digits, in mm below a metre."""
    if not math.isfinite(number):
        return "undefined"
    return f"{number * 1e3:.3g} mm" if abs(number) < 1.0 else f"{number:.3g} m"
