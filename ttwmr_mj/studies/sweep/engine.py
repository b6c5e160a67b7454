"""Rows of a sweep become rows of its table: scenarios built, run in batches, summed up."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from ttwmr_mj.errors import InputError
from ttwmr_mj.results.metrics import METRICS
from ttwmr_mj.runs.batch import run_batch
from ttwmr_mj.runs.files.folder import library_version
from ttwmr_mj.runs.metrics import repeatable_metrics
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.ingredients import shown_path
from ttwmr_mj.studies.sweep.plan.parameters import Value
from ttwmr_mj.studies.sweep.plan.plan import Plan, Row
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

NUMBERS = ("end_time_s", *METRICS, "camera_frame_offset_m", "camera_frame_turn_rad")
VERSIONS = {"version_ttwmr_mj": "ttwmr-mj", "version_mujoco": "mujoco", "version_numpy": "numpy"}
REFUSED = {"status": "failed", "verdict": "failed"}  # of a row that could not be built

Record = dict[str, Any]


def schema_of(plan: Plan) -> pa.Schema:
    """Columns of the table of results, the same for every part of it."""
    parameters = [(key, _type_of(p.values)) for key, p in plan.parameters.items()]
    return pa.schema(
        [
            ("row", pa.int64()),
            ("draw", pa.int64()),
            ("variant", pa.string()),
            ("seed", pa.int64()),
            *parameters,
            ("status", pa.string()),
            ("verdict", pa.string()),
            ("reason", pa.string()),
            *((name, pa.float64()) for name in NUMBERS),
            ("scenario_digest", pa.string()),
            *((name, pa.string()) for name in VERSIONS),
        ]
    )


def _type_of(values: tuple[Value, ...] | None) -> pa.DataType:
    """All values of a parameter are texts, or truth values, or numbers."""
    match values and values[0]:
        case bool():
            return pa.bool_()
        case str():
            return pa.string()
    return pa.float64()


def table_of(plan: Plan, numbers: IntArray) -> pa.Table:
    """Run these rows and sum them up: one record each, in order, whatever becomes of them."""
    rows = plan.rows_at(numbers)
    records: dict[int, Record] = {}
    sound: list[tuple[Row, Scenario]] = []
    for row in rows:
        try:
            sound.append((row, plan.scenario_of(row)))
        except InputError as error:  # of a plan too large to be checked whole
            records[row.row] = _refused(row, None, error)
    records |= {record["row"]: record for record in _run(sound, plan.beside)}
    columns = schema_of(plan)
    return pa.Table.from_pylist([_typed(records[row.row], columns) for row in rows], columns)


def _typed(record: Record, columns: pa.Schema) -> Record:
    """Whole numbers as the floating-point ones that their column holds."""
    floats = {f.name for f in columns if pa.types.is_floating(f.type)}
    return {k: float(v) if k in floats and v is not None else v for k, v in record.items()}


def _run(rows: list[tuple[Row, Scenario]], folder: Path) -> Iterator[Record]:
    """Run rows in batches; if some are refused, halves of them, so that the others are kept."""
    try:
        results = run_batch([scenario for _, scenario in rows], folder, nthread=1)
    except InputError as error:
        if len(rows) == 1:
            yield _refused(*rows[0], error)
            return
        middle = len(rows) // 2
        yield from _run(rows[:middle], folder)
        yield from _run(rows[middle:], folder)
        return
    for (row, scenario), result in zip(rows, results, strict=True):
        found = repeatable_metrics(result, scenario)
        found["reason"] = found["reason"] or found.pop("verdict_reason")
        yield _identity(row, scenario) | {k: v for k, v in found.items() if k != "verdict_reason"}


def _refused(row: Row, scenario: Scenario | None, error: InputError) -> Record:
    reason = "; ".join(map(str, error.faults))
    return _identity(row, scenario) | REFUSED | {"reason": reason} | dict.fromkeys(NUMBERS)


def broken(plan: Plan, row: int, reason: str) -> pa.Table:
    """The record of a row whose process broke: a crash is a result too."""
    (place,) = plan.rows_at(np.array([row]))
    try:
        scenario = plan.scenario_of(place)
    except InputError:
        scenario = None
    record = _identity(place, scenario) | REFUSED | {"reason": reason} | dict.fromkeys(NUMBERS)
    columns = schema_of(plan)
    return pa.Table.from_pylist([_typed(record, columns)], columns)


def _identity(row: Row, scenario: Scenario | None) -> Record:
    return {
        "row": row.row,
        "draw": row.draw,
        "variant": row.variant,
        "seed": row.seed,
        **row.values,
        "scenario_digest": scenario and scenario_digest(scenario),
        **_versions(),
    }


@cache
def _versions() -> dict[str, str | None]:
    return {column: library_version(name) for column, name in VERSIONS.items()}


def scenario_digest(scenario: Scenario) -> str:
    """Of every value of a resolved scenario; files by their names within the package, if there."""
    data = _with_shown_paths(scenario.model_dump(mode="json"))
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def _with_shown_paths(value: Any) -> Any:
    match value:
        case dict():
            return {key: _with_shown_paths(item) for key, item in value.items()}
        case list():
            return [_with_shown_paths(item) for item in value]
        case str() if value.startswith("/"):
            return shown_path(Path(value))
    return value
