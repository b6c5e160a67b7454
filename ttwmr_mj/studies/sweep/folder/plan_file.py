"""plan.json: what a folder is being filled with; another plan is refused, and told what differs."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from ttwmr_mj.errors import Fault, InputError, cut, described, of_system
from ttwmr_mj.files import read_json, write_json
from ttwmr_mj.studies.pool.ingredients import differences
from ttwmr_mj.studies.sweep.folder.results import REPORT_FILE, RESULTS_FILE
from ttwmr_mj.studies.sweep.plan.axes import Table
from ttwmr_mj.studies.sweep.plan.plan import Plan

PLAN_FILE = "plan.json"
SHOWN = 12  # differences
LONGEST = 500  # letters of what is wrong with a file
LONGEST_VALUE = 80  # letters of a value
MISSING = object()


def stored_plan(folder: Path) -> Plan | None:
    """The plan of a folder; None if it has none.

    Raises:
        InputError: it cannot be read.
    """
    path = folder / PLAN_FILE
    if not path.is_file():
        return None
    try:
        return _unchanged(read_json(path))
    except (OSError, ValueError, InputError) as error:
        hint = "give another --out, or delete the file if its sweep is the one that is asked for"
        fault = Fault(problem=f"no plan that this version can read: {_told(error)}", hint=hint)
        raise InputError(fault, file=str(path)) from error


def _unchanged(data: Table) -> Plan:
    """The plan that a plan.json tells of, if it is the one that was written."""
    plan = Plan.from_json(data)
    if plan.digest != data["digest"]:
        problem = "is not that of the rest of the file, which was changed"
        raise InputError.at("digest", problem, got=repr(data["digest"]))
    return plan


def _told(error: Exception) -> str:
    if isinstance(error, InputError):
        return cut("; ".join(map(str, error.faults)), LONGEST)
    return of_system(error) if isinstance(error, OSError) else described(error)


def write_plan(folder: Path, plan: Plan) -> None:
    """Make it the folder's plan."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / PLAN_FILE, plan.to_json())


def update_plan(folder: Path, plan: Plan) -> None:
    """Write the folder's plan anew where it differs in what changes no row, such as the metric."""
    stored = stored_plan(folder)
    if stored is None or stored.to_json() != plan.to_json():
        write_plan(folder, plan)


def refuse_other(folder: Path, stored: Plan, plan: Plan) -> None:
    """Raises InputError if the plans' results differ, with what does."""
    if stored.digest == plan.digest:
        return
    faults = changes(stored, plan)
    hint = "give another --out; --extend keeps what is there where rows were only added"
    problem = f"the folder holds results of another plan; {hint}"
    raise InputError(Fault(problem=problem), *faults, file=str(folder / PLAN_FILE))


def changes(stored: Plan, plan: Plan) -> list[Fault]:
    """What differs between two plans, in a line each."""
    before, now = stored.identity, plan.identity
    keys = differences(before, now)
    faults = [
        Fault(key=(key,), problem=_change(_at(before, key), _at(now, key))) for key in keys[:SHOWN]
    ]
    if len(keys) > SHOWN:
        faults.append(Fault(problem=f"and {len(keys) - SHOWN} more"))
    return faults


def _at(data: Any, key: str) -> Any:
    """The value at a dotted key, some of whose parts hold dots themselves; MISSING: none."""
    while key:
        heads = [k for k in data if key == k or key.startswith(f"{k}.")]
        if not heads:
            return MISSING
        head = max(heads, key=len)  # beside a module, its package has a key
        data, key = data[head], key[len(head) + 1 :]
    return data


def _change(before: Any, now: Any) -> str:
    """What became of a value; of what is too long to be shown only what differs."""
    texts = ["missing" if value is MISSING else json.dumps(value) for value in (before, now)]
    if max(map(len, texts)) > LONGEST_VALUE:
        if isinstance(before, list) and isinstance(now, list):
            return _list_change([*map(json.dumps, before)], [*map(json.dumps, now)])
        texts = _around_difference(*texts)
    return f"was {texts[0]}, is {texts[1]}"


def _list_change(before: list[str], now: list[str]) -> str:
    """The counts, and the items that only one list has."""
    told = []
    for what, some, others in (("left out", before, {*now}), ("added", now, {*before})):
        items = [item for item in some if item not in others]
        if items:
            told.append(f"{len(items)} {what}: {cut(', '.join(items), LONGEST_VALUE)}")
    return f"were {len(before)}, are {len(now)}; {'; '.join(told) or 'in another order'}"


def _around_difference(one: str, other: str) -> list[str]:
    """Two texts, cut so that where they begin to differ shows."""
    pairs = enumerate(zip(one, other, strict=False))
    first = next((i for i, (a, b) in pairs if a != b), min(len(one), len(other)))
    start = max(0, first - LONGEST_VALUE // 2)
    return [cut("..." * (start > 0) + text[start:], LONGEST_VALUE) for text in (one, other)]


def refuse_foreign(folder: Path) -> None:
    """Raises InputError if the folder holds something else than a sweep."""
    if folder.exists() and not folder.is_dir():
        raise InputError.at("--out", "a file is in the way", got=str(folder))
    if folder.is_dir() and not (folder / PLAN_FILE).is_file() and any(folder.iterdir()):
        hint = "give another one"
        problem = "the folder holds something, and no sweep"
        raise InputError.at("--out", problem, got=str(folder), hint=hint)
    for path in (folder / RESULTS_FILE, folder / REPORT_FILE):
        if path.is_dir():
            raise InputError.at("--out", f"a folder is in the way of {path.name}", got=str(folder))
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not os.access(there, os.W_OK):
        raise InputError.at("--out", f"nothing can be written in {there}", got=str(folder))
