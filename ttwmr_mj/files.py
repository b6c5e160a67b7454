"""Files: written under a temporary name, then renamed (atomically); and file names in input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import AfterValidator, ValidationInfo

if TYPE_CHECKING:
    import pyarrow as pa


def write_text(path: Path, text: str) -> None:
    """Write a text file under a temporary name, then rename it."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


def write_json(path: Path, value: Any) -> None:
    """Write JSON; a NaN or infinity in it is a programming error and raises ValueError."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write a table; the file appears whole or not at all."""
    import pyarrow.parquet as pq

    temporary = path.with_name(path.name + ".part")
    pq.write_table(table, temporary)
    temporary.replace(path)


def input_file(remedy: str) -> AfterValidator:
    """Marks a text field as the name of a file beside the scenario; see `placed`."""
    return AfterValidator(lambda given, info: placed(given, info, remedy))


def placed(given: str, info: ValidationInfo, remedy: str) -> str:
    """The absolute path of a file named in a scenario file, relative to that file's folder.

    Where no file is being read (the validation has no folder in its context) it stays as given.

    Raises:
        ValueError: there is no such file; for pydantic, which adds the key.
    """
    if info.context is None:
        return given
    path = (info.context["folder"] / given).resolve()
    if not path.is_file():
        raise ValueError(f"no such file ({path}); {remedy}")
    return str(path)
