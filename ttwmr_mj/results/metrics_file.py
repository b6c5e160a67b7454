"""metrics.json read back: how a run ended, and how long things took."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from ttwmr_mj.errors import Fault, InputError, of_system, shown
from ttwmr_mj.files import read_json
from ttwmr_mj.results.accept import Status

MEASURED = (  # different whenever a run is repeated; null where nobody measured them
    "control_time_per_sample_us",
    "control_overruns",
    "control_slowest_s",
    "wall_time_s",
    "real_time_factor",
)


def read_metrics(path: Path) -> dict[str, Any]:
    """The metrics of a run, of which status, reason, end and MEASURED are looked at.

    Raises:
        InputError: there are none, or they are damaged.
    """
    try:
        said = read_json(path)
    except (OSError, ValueError) as error:
        why = of_system(error) if isinstance(error, OSError) else error
        raise InputError(f"cannot be read as metrics: {why}", file=str(path)) from error
    if faults := list(_faults(said)):
        raise InputError(*faults, file=str(path))
    return said


def _faults(said: dict[str, Any]) -> Iterator[Fault]:
    if said.get("status") not in (known := get_args(Status)):
        yield Fault(key=("status",), got=shown(said.get("status")), allowed=", ".join(known))
    if not isinstance(said.get("reason"), str):
        yield Fault(key=("reason",), got=shown(said.get("reason")), allowed="a text")
    if not _is_amount(said.get("end_time_s")):
        got = shown(said.get("end_time_s"))
        yield Fault(key=("end_time_s",), got=got, allowed="a number, 0 or more")
    for name in MEASURED:
        whole = name == "control_overruns"
        if said.get(name) is not None and not _is_amount(said[name], whole=whole):
            allowed = f"a {'whole ' * whole}number, 0 or more, or null"
            yield Fault(key=(name,), got=shown(said[name]), allowed=allowed)


def _is_amount(value: object, *, whole: bool = False) -> bool:
    kinds = int if whole else int | float
    return isinstance(value, kinds) and not isinstance(value, bool) and value >= 0
