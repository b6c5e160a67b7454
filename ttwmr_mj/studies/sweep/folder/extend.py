"""A plan that grew: rows that are there keep their results and get their new numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.studies.sweep.folder.plan_file import PLAN_FILE, changes, write_plan
from ttwmr_mj.studies.sweep.folder.results import GROUP, REPORT_FILE, RESULTS_FILE
from ttwmr_mj.studies.sweep.folder.shards import drop_remains, shards_in, to_bytes, write_shard
from ttwmr_mj.studies.sweep.plan.axes import Axis
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray


def extend(folder: Path, stored: Plan, plan: Plan) -> None:
    """Make a larger plan the folder's; killed at any moment, it can be done again.

    Raises:
        InputError: the plan does not hold every row of the stored one, or another process fills
            the folder.
    """
    faults = _faults(stored, plan)
    if faults:
        problem = "this plan does not hold every row of the one in the folder"
        raise InputError(Fault(problem=problem), *faults, file=str(folder / PLAN_FILE))
    with locked(folder):
        _rewrite(folder, stored, plan)


def _rewrite(folder: Path, stored: Plan, plan: Plan) -> None:
    for shard in shards_in(folder, stored):
        table = shard.read()
        new = _new_numbers(stored, plan, table["row"].to_numpy())
        draw, _, _ = plan.numbers(new)
        table = _with_column(_with_column(table, "row", new), "draw", draw)
        for window in np.unique(new // GROUP).tolist():  # of near rows, as `assemble` reads them
            inside = np.flatnonzero(new // GROUP == window)
            order = inside[np.argsort(new[inside])]
            write_shard(folder, plan, new[order], to_bytes(table.take(order).combine_chunks()))
    for name in (RESULTS_FILE, REPORT_FILE):
        (folder / name).unlink(missing_ok=True)
    write_plan(folder, plan)  # from here on it is the folder's
    drop_remains(folder, plan)


def _with_column(table: pa.Table, name: str, values: IntArray) -> pa.Table:
    index = table.schema.get_field_index(name)
    return table.set_column(index, name, pa.array(values, pa.int64()))


def _faults(stored: Plan, plan: Plan) -> list[Fault]:
    """What keeps the old rows from being among the new ones."""
    may_grow = {"seeds", "variants", "samples", "parameters"}
    faults = [f for f in changes(stored, plan) if f.where.split(".")[0] not in may_grow]
    faults += _left_out("seeds", stored.seeds, plan.seeds)
    if stored.variant_names != plan.variant_names:
        faults += _left_out("variants", stored.variant_names, plan.variant_names)
    for name in stored.variants.keys() & plan.variants.keys():
        if stored.variants[name] != plan.variants[name]:
            faults.append(Fault(key=("variants", name), problem="has other overrides"))
    return [*faults, *_axes_faults(stored, plan)]


def _left_out(key: str, before: tuple[object, ...], now: tuple[object, ...]) -> list[Fault]:
    gone = [item for item in before if item not in set(now)]
    return [Fault(key=(key,), got=", ".join(map(str, gone)), problem="left out")] if gone else []


def _axes_faults(stored: Plan, plan: Plan) -> list[Fault]:
    names = [axis.name for axis in stored.axes]
    if names != [axis.name for axis in plan.axes]:
        problem = "other parameters, or in another order, than " + (", ".join(names) or "none")
        return [Fault(key=("parameters",), problem=problem)]
    if plan.sampling != "grid":
        return _sampling_faults(stored, plan)
    faults = []
    for before, now in zip(stored.axes, plan.axes, strict=True):
        if before.drawn or now.drawn:
            if before != now:
                faults.append(Fault(key=("parameters", now.name), problem="another distribution"))
        else:
            faults += _left_out(f"parameters.{now.name}", tuple(_cells(before)), tuple(_cells(now)))
    return faults


def _sampling_faults(stored: Plan, plan: Plan) -> list[Fault]:
    if stored.axes != plan.axes:
        return [Fault(key=("parameters",), problem="other values; samples can only grow in number")]
    before, now = stored.samples or 0, plan.samples or 0
    if plan.sampling == "latin_hypercube" and before != now:
        hint = "a Latin hypercube is made whole; random and sobol grow"
        return [Fault(key=("samples",), got=str(now), allowed=str(before), hint=hint)]
    if now < before:
        return [Fault(key=("samples",), got=str(now), allowed=f"at least {before}")]
    return []


def _cells(axis: Axis) -> list[tuple[object, ...]]:
    """The values of an axis, place by place."""
    return list(zip(*(p.values or () for p in axis.parameters.values()), strict=True))


def _new_numbers(stored: Plan, plan: Plan, rows: IntArray) -> IntArray:
    """What rows of the stored plan are called in the new one."""
    draw, variant, seed = stored.numbers(rows)
    variants = _places(stored.variant_names, plan.variant_names)
    seeds = _places(stored.seeds, plan.seeds)
    if plan.sampling == "grid":
        draw = _new_points(stored, plan)[draw]
    return plan.row_of(draw, variants[variant], seeds[seed])


def _new_points(stored: Plan, plan: Plan) -> IntArray:
    """Draw in the stored grid → draw in the new one."""
    pairs = zip(stored.axes, plan.axes, strict=True)
    places = [
        np.zeros(1, dtype=np.int64)
        if before.drawn
        else _places(tuple(_cells(before)), tuple(_cells(now)))
        for before, now in pairs
    ]
    sizes = [1 if axis.drawn else axis.count or 1 for axis in plan.axes]
    new = np.zeros(1, dtype=np.int64)
    for place, size in zip(places, sizes, strict=True):
        new = (new[:, None] * size + place).ravel()
    return new


def _places(before: tuple[object, ...], now: tuple[object, ...]) -> IntArray:
    where = {item: i for i, item in enumerate(now)}
    return np.array([where[item] for item in before], dtype=np.int64)
