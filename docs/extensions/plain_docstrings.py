"""Docstrings of this package for reStructuredText: they are plain text with `names` in it.

Absolute values, stars and trailing underscores are meant as they are written, and lines that are
set in are formulas.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SPECIAL = re.compile(r"(?<!\\)([|*])")


def plain(_app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    """Take away what reStructuredText would read into a docstring, before napoleon reads it."""
    lines[:] = ["".join(_escaped(part) for part in re.split(r"(`[^`]*`)", line)) for line in lines]


def _escaped(part: str) -> str:
    if part.startswith("`"):
        return part
    return re.sub(r"(\w)_(?=[^\w]|$)", r"\1\\_", SPECIAL.sub(r"\\\1", part))


def setup(app: Sphinx) -> dict[str, Any]:
    """Before napoleon, whose priority is 500."""
    app.connect("autodoc-process-docstring", plain, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
