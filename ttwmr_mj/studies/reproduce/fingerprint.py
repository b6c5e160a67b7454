"""Fingerprints of code: a result is used again only by the code that made it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

_HERE = Path(__file__).parent
_PACKAGE = _HERE.parent.parent
_STUDIES = (*sorted((_HERE / "ideal").glob("*.py")), *sorted((_HERE / "proofs").glob("*.py")))
_NO_PART_OF_A_RUN = ("studies", "recording", "cli", "figures")


@cache
def code_of_runs() -> str:
    """Of everything that moves a robot: the package without studies, drawings, command line."""
    files = sorted(_PACKAGE.rglob("*.py"))
    inside = [(path.relative_to(_PACKAGE), path) for path in files]
    return _digest(path for at, path in inside if at.parts[0] not in _NO_PART_OF_A_RUN)


@cache
def code_of_studies() -> str:
    """Of the computations on Eq. 31 and of the proofs."""
    return _digest(_STUDIES)


def _digest(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
