"""From the file of a sweep to its plan: the scenario read, and what results are made of."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import is_file, resolved
from ttwmr_mj.runs.report import HEADLINES
from ttwmr_mj.scenario.file import find_scenario, read_scenario
from ttwmr_mj.scenario.motion import sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.ingredients import ENTRY, made_of_run
from ttwmr_mj.studies.sweep.plan.axes import Table
from ttwmr_mj.studies.sweep.plan.file import SweepRequest
from ttwmr_mj.studies.sweep.plan.parameters import Value
from ttwmr_mj.studies.sweep.plan.plan import SHIPPED, Plan, Row

MOST_ROWS = 10_000_000
SWEEP = "ttwmr_mj.studies.sweep"
CODE = (  # that decides about rows, and about what is kept of them
    ENTRY,
    "ttwmr_mj.runs.batch",
    f"{SWEEP}.engine",
    *(f"{SWEEP}.plan.{module}" for module in ("parameters", "plan", "sampling")),
)


def build_plan(request: SweepRequest, most_rows: int = MOST_ROWS) -> Plan:
    """The plan of a sweep, its rows not checked; what it is made of comes with `with_ingredients`.

    Raises:
        InputError: there is no such scenario, it cannot be read, or there are too many rows.
    """
    file = request.file
    beside = request.folder / file.scenario
    path = find_scenario(str(beside) if is_file(beside) else file.scenario)
    shipped = resolved(path.parent) == resolved(scenarios_folder())
    plan = Plan(
        name=file.name,
        description=file.description,
        scenario=path.stem if shipped else str(resolved(path)),
        base=read_scenario(path),
        folder=SHIPPED if shipped else str(resolved(path.parent)),
        overrides=request.overrides,
        seeds=request.seeds,
        sampling=file.sampling,
        samples=file.samples,
        sampling_seed=file.sampling_seed,
        sensitivity=file.sensitivity,
        axes=request.axes,
        variants={name: tuple(given.overrides) for name, given in file.variants.items()},
        metric=file.metric or "",
        timeout_s=file.timeout_s,
    )
    faults = [*_too_many_rows(plan, most_rows)]
    if plan.sensitivity and not plan.axes:
        faults.append(Fault(key=("sensitivity",), problem="nothing is varied"))
    if plan.sampling != "grid" and not plan.axes:
        faults.append(Fault(key=("samples",), problem="nothing is varied; leave the sampling out"))
    if faults:
        raise InputError(*faults, file=request.source)
    return plan


def refuse_too_many_rows(plan: Plan, source: str, most_rows: int) -> None:
    """Refuse a plan of which a table of its rows would not fit.

    Raises:
        InputError: it has more rows than are allowed.
    """
    if faults := _too_many_rows(plan, most_rows):
        raise InputError(*faults, file=source)


def _too_many_rows(plan: Plan, most_rows: int) -> list[Fault]:
    if plan.rows <= most_rows:
        return []
    hint = "vary less, or raise the limit with --max-rows"
    return [Fault(got=f"{plan.rows} rows", allowed=f"at most {most_rows}", hint=hint)]


def completed(plan: Plan) -> Plan:
    """The plan with its headline metric and what its results are made of.

    Args:
        plan: whose rows are sound.
    """
    from dataclasses import replace

    rows = list(kinds_of_rows(plan))
    scenarios = [plan.scenario_of(row) for row in rows]
    return replace(
        plan, metric=plan.metric or _headline(scenarios[0]), made_of=_made_of(plan, scenarios)
    )


def kinds_of_rows(plan: Plan) -> Iterator[Row]:
    """A row of each variant, and of each word that a parameter may be."""
    first: dict[str, Value] = {key: p.extremes[0] for key, p in plan.parameters.items()}
    for variant in plan.variant_names:
        yield Row(-1, 0, variant, plan.seeds[0], first)
        for axis in plan.axes:
            words = [p.values or () for p in axis.parameters.values()]
            for cell in zip(*words, strict=False):
                if any(isinstance(value, str) for value in cell):
                    others = first | dict(zip(axis.parameters, cell, strict=True))
                    yield Row(-1, 0, variant, plan.seeds[0], others)


def _headline(scenario: Scenario) -> str:
    """Where the trailer goes, if the reference says where; else where P goes."""
    reference = sample_reference(scenario)
    told = reference is not None and np.isfinite(reference.q[..., 3]).any()
    of_the_trailer, of_the_tractor = HEADLINES
    return of_the_trailer if told else of_the_tractor


def _made_of(plan: Plan, scenarios: list[Scenario]) -> Table:
    """Of all kinds of rows; files beside the scenario by their names there."""
    parts: dict[str, dict[str, Any]] = {"data": {}, "code": {}, "libraries": {}}
    for scenario in scenarios:
        made_of = made_of_run(scenario, plan.beside, CODE)
        for part, found in parts.items():
            found |= made_of[part]
    beside = f"{resolved(plan.beside)}/"
    data = {name.removeprefix(beside): digest for name, digest in parts["data"].items()}
    return {**parts, "data": dict(sorted(data.items()))}


def files_beside(plan: Plan) -> list[Path]:
    """Files of the user's that a machine needs to compute rows: beside the scenario."""
    return [plan.beside / name for name in plan.made_of["data"] if (plan.beside / name).is_file()]
