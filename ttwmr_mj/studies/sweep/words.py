"""A plan in words, for the terminal: what is varied, how many rows, what some of them are."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import closing
from time import perf_counter

import numpy as np

from ttwmr_mj.errors import TtwmrError
from ttwmr_mj.runs.batch import run_batch
from ttwmr_mj.runs.judgement.foresight import foreseen
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.jobs import Done, Job, run_jobs
from ttwmr_mj.studies.pool.task import PRELOAD
from ttwmr_mj.studies.sweep.plan.axes import Axis
from ttwmr_mj.studies.sweep.plan.build import kinds_of_rows
from ttwmr_mj.studies.sweep.plan.parameters import Value
from ttwmr_mj.studies.sweep.plan.plan import Plan, Row

SAMPLE = 5  # rows that are shown
PROBED = 16  # rows that are run for a moment
PROBES_S = (
    0.2,
    1.2,
)  # simulated times of that: what takes longer grows with it, the rest is set-up


def plan_text(plan: Plan) -> str:
    """What a sweep will do."""
    head = f"{plan.name}: {plan.description}" if plan.description else plan.name
    return "\n".join([head, "", *_settings(plan), "", *_rows(plan)])


def _settings(plan: Plan) -> Iterator[str]:
    yield f"scenario   {' '.join([plan.scenario, *plan.overrides])}"
    sampled = f", {plan.samples} samples" if plan.samples else ""
    yield f"sampling   {plan.sampling}{sampled}{', for Sobol indices' if plan.sensitivity else ''}"
    for axis in plan.axes:
        yield f"           {_axis(axis)}"
    for name, overrides in plan.variants.items():
        yield f"variant    {name}: {' '.join(overrides) or 'as the scenario is'}"
    yield f"seeds      {_list(plan.seeds)}"
    yield f"metric     {plan.metric}"
    sizes = {"draws": plan.draws, "variants": len(plan.variant_names), "seeds": len(plan.seeds)}
    product = " × ".join(f"{size} {what}" for what, size in sizes.items() if size > 1)
    yield f"rows       {plan.rows}{f' = {product}' if '×' in product else ''}"


def _axis(axis: Axis) -> str:
    return ", together with ".join(
        f"{key}: {_list(p.values) if p.values else p.model_dump_json(exclude_none=True)}"
        for key, p in axis.parameters.items()
    )


def _list(values: tuple[Value, ...]) -> str:
    shown = [f"{v:.6g}" if isinstance(v, float) else str(v) for v in values]
    if len(shown) <= 8:
        return ", ".join(shown)
    return f"{', '.join(shown[:3])} … {shown[-1]} ({len(shown)} values)"


def _rows(plan: Plan) -> Iterator[str]:
    numbers = np.unique(np.linspace(0, plan.rows - 1, SAMPLE).astype(np.int64))
    for row in plan.rows_at(numbers):
        yield f"row {row.row}: {command_of(plan, row)}"


def command_of(plan: Plan, row: Row) -> str:
    """What a person types to run a row with all its files."""
    varied = (f"{key}={_toml(value)}" for key, value in row.values.items())
    overrides = [*plan.overrides, *plan.variants.get(row.variant, ()), *varied]
    sets = [word for item in overrides for word in ("--set", item)]
    return shlex.join(["ttwmr", "run", plan.scenario, *sets, "--seed", str(row.seed)])


def _toml(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def remarks(plan: Plan) -> list[str]:
    """What is worth knowing before the sweep is run."""
    return [*_idle_seeds(plan), *_infeasible(plan)]


def _infeasible(plan: Plan) -> list[str]:
    """Whether rows ask for what their robot cannot do, of a few that are looked at."""
    numbers = np.unique(np.linspace(0, plan.rows - 1, PROBED).astype(np.int64))
    rows = plan.rows_at(numbers)
    told = [(row.row, faults) for row in rows if (faults := foreseen(plan.scenario_of(row)))]
    if not told:
        return []
    (row, (fault, *_)), count = told[0], len(told)
    share = f"{count} of the {len(rows)} rows that were looked at" if len(rows) > 1 else "the row"
    ask = "asks" if count == 1 else "ask"
    return [f"{share} {ask} for what the robot cannot do; row {row}: {fault}"]


def _idle_seeds(plan: Plan) -> list[str]:
    """Whether seeds differ in nothing."""
    first = plan.rows_at(np.arange(min(plan.rows, len(plan.seeds) * len(plan.variant_names))))
    varied = plan.sampling == "grid" and any(axis.drawn for axis in plan.axes)
    if len(plan.seeds) == 1 or varied or any(map(_random, _one_of_each(plan, first))):
        return []
    return [
        "nothing in this scenario is random: all seeds give the same run; "
        "use one seed, or add noise, jitter, losses or pushes"
    ]


def _one_of_each(plan: Plan, rows: list[Row]) -> list[Scenario]:
    """A scenario of each variant."""
    return [plan.scenario_of(row) for row in {row.variant: row for row in rows}.values()]


def _random(scenario: Scenario) -> bool:
    """Whether the seed of a scenario decides about anything."""
    sensing, control = scenario.sensing, scenario.control
    if scenario.world == "unkind" or sensing.kind == "camera":
        return True
    noises = [value for key, value in sensing.model_dump().items() if "noise" in key]
    pushes = [p.random_direction or p.random_within_s for p in scenario.plant.pushes]
    lost = [sensing.latency_jitter_s, sensing.drop_probability]
    lost += [control.command_jitter_s, control.command_drop_probability]
    return any([*noises, *pushes, *lost]) or scenario.controller.of_others


def estimated_time_s(plan: Plan, workers: int) -> float | None:
    """Wall time of all rows in that many processes; None if it is not known.

    Laws of others are run in a process that is watched.
    """
    if not any(plan.scenario_of(row).controller.of_others for row in kinds_of_rows(plan)):
        return time_of_rows_s(plan, workers)
    job = Job("time", time_of_rows_s, (plan, workers), PROBED * plan.timeout_s)
    with closing(run_jobs([job], preload=PRELOAD)) as events:
        event = next(events)
    return event.result if isinstance(event, Done) else None


def time_of_rows_s(plan: Plan, workers: int) -> float | None:
    """Wall time of all rows in that many processes, from a few that are run for a moment.

    A batch shares its work, which the few make use of only in part: the time is at most this, if
    all rows take alike.
    """
    short_s, long_s = PROBES_S
    numbers = np.unique(np.linspace(0, plan.rows - 1, PROBED).astype(np.int64))
    try:
        scenarios = [plan.scenario_of(row) for row in plan.rows_at(numbers)]
        _probed(scenarios, plan, short_s)  # imports and caches
        short_took, long_took = (_probed(scenarios, plan, s) for s in PROBES_S)
    except TtwmrError:
        return None
    rate = max(0.0, long_took - short_took) / (long_s - short_s)
    mean_s = sum(scenario.duration_s for scenario in scenarios) / len(scenarios)
    took_s = short_took + rate * max(0.0, mean_s - short_s)
    return took_s / len(numbers) * plan.rows / workers


def _probed(scenarios: list[Scenario], plan: Plan, duration_s: float) -> float:
    """Wall time of the beginnings of some rows in one batch [s]."""
    short = [s.model_copy(update={"duration_s": min(duration_s, s.duration_s)}) for s in scenarios]
    began = perf_counter()
    run_batch(short, plan.beside, nthread=1)
    return perf_counter() - began


def duration(seconds: float) -> str:
    """A time in words: in whole units, below ten of them in two digits."""
    sizes = {"days": 86_400, "hours": 3_600, "minutes": 60, "seconds": 1}
    unit = next((unit for unit, size in sizes.items() if seconds >= 2 * size), "seconds")
    amount = seconds / sizes[unit]
    return f"{amount:.0f} {unit}" if amount >= 10 else f"{amount:.2g} {unit}"
