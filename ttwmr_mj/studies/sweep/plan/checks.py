"""Can every row of a plan be run? All faults at once, each once, before anything is written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.jobs import Done, Failed, Job, run_jobs
from ttwmr_mj.studies.sweep.plan.parameters import Value
from ttwmr_mj.studies.sweep.plan.plan import Plan, Row
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

MOST_CHECKED = 20_000  # rows; of larger plans as many, drawn at random, and all ends of all axes
AT_ONCE = 250  # rows that a process checks
PRELOAD = ("ttwmr_mj.studies.sweep.plan.checks",)
SHOWN = 20  # faults

Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Found:
    """A fault, the first row that has it, and how many have."""

    fault: Fault
    row: int
    count: int = 1

    @property
    def kind(self) -> tuple[object, ...]:
        """Equal for faults that are one fault of the file."""
        return self.fault.key, self.fault.problem, self.fault.allowed


def check_plan(
    plan: Plan, source: str, *, workers: int | None = None, progress: Progress | None = None
) -> bool:
    """Check the axes one by one, then the rows; rows that differ by their seed only, once.

    Args:
        plan: what is to be run.
        source: the sweep's file, for messages.
        workers: processes at a time; None: one per processor.
        progress: called with the share of the work that is done.

    Returns:
        Whether every row was checked.

    Raises:
        InputError: some rows cannot be run.
    """
    _refuse(_ends(plan), source)
    rows = _rows_to_check(plan)
    _refuse(_in_processes(plan, rows, workers, progress), source)
    return len(rows) == _different(plan)


def checked_text(plan: Plan) -> str:
    """How many rows `check_plan` checks, in words."""
    different, rows = _different(plan), len(_rows_to_check(plan))
    if rows == different:
        same = "" if different == plan.rows else f", as seeds change nothing: {rows} different ones"
        return f"all {plan.rows} rows{same}"
    return (
        f"{rows} of {different} different rows, drawn at random, and the ends of every parameter; "
        "a row that turns out to be impossible is a failed run"
    )


def _refuse(found: Iterable[Found], source: str) -> None:
    """Tell of each kind of fault once."""
    kinds: dict[tuple[object, ...], Found] = {}
    for one in found:
        known = kinds.get(one.kind)
        first = one if known is None or one.row < known.row else known
        kinds[one.kind] = replace(first, count=one.count + (known.count if known else 0))
    if not kinds:
        return
    faults = [_told(one) for one in list(kinds.values())[:SHOWN]]
    if len(kinds) > SHOWN:
        faults.append(Fault(problem=f"and {len(kinds) - SHOWN} more kinds of faults"))
    raise InputError(*faults, file=source)


def _told(one: Found) -> Fault:
    if one.row < 0:
        return one.fault
    others = f" and {one.count - 1} more of those checked" if one.count > 1 else ""
    where = f"row {one.row}{others}"
    hint = f"{one.fault.hint}; in {where}" if one.fault.hint else f"in {where}"
    return replace(one.fault, hint=hint)


def _ends(plan: Plan) -> Iterator[Found]:
    """Faults at the values that each axis has at its ends, the other axes at their first."""
    first = {key: p.extremes[0] for key, p in plan.parameters.items()}
    changes = dict.fromkeys(range(len(plan.axes)), False)
    broken = False
    for variant in plan.variant_names:
        base = _tried(plan, variant, first)
        if isinstance(base, list):
            broken = True
            yield from base
            continue
        told = base.model_dump_json()
        for k, axis in enumerate(plan.axes):
            ends = {key: p.extremes for key, p in axis.parameters.items()}
            for cell in list(zip(*ends.values(), strict=True))[1:]:
                other = _tried(plan, variant, first | dict(zip(ends, cell, strict=True)))
                if isinstance(other, list):
                    yield from other
                    changes[k] = True  # it does something: it breaks
                else:
                    changes[k] |= other.model_dump_json() != told
    for k, changed in changes.items():
        if not changed and not broken:
            yield Found(_changes_nothing(plan.axes[k].name), -1)


def _changes_nothing(name: str) -> Fault:
    return Fault(
        key=("parameters", name),
        problem="changes nothing: with all of its values the scenario is the same",
        hint="leave it out, or look for what overrides it",
    )


def _tried(plan: Plan, variant: str, values: dict[str, Value]) -> Scenario | list[Found]:
    row = Row(-1, 0, variant, plan.seeds[0], values)
    try:
        return plan.scenario_of(row)
    except InputError as error:
        where = f"variant {variant}" if variant else ""
        return [Found(placed(fault, where), -1) for fault in error.faults]


def placed(fault: Fault, where: str) -> Fault:
    """The fault with where it is, such as in which variant, if that is not empty."""
    if not where:
        return fault
    return replace(fault, hint=f"{fault.hint}; in {where}" if fault.hint else f"in {where}")


def _seeds_matter(plan: Plan) -> bool:
    """Whether a row's seed may decide about its being sound."""
    drawn = plan.sampling == "grid" and any(axis.drawn for axis in plan.axes)
    worlds = (text for given in plan.variants.values() for text in given)
    told = [str(plan.base.get("world")), *plan.overrides, *worlds, *plan.parameters]
    return drawn or any("unkind" in text or text == "world" for text in told)


def _different(plan: Plan) -> int:
    """How many rows there are that may differ in whether they are sound."""
    return plan.rows if _seeds_matter(plan) else plan.rows // len(plan.seeds)


def _rows_to_check(plan: Plan) -> IntArray:
    """All rows, or one of each that differ by their seed, or MOST_CHECKED of these."""
    count = _different(plan)
    step = plan.rows // count
    if count <= MOST_CHECKED:
        return np.arange(count, dtype=np.int64) * step
    picked = np.random.default_rng(plan.sampling_seed).integers(count, size=MOST_CHECKED)
    return np.unique(picked) * step


def _in_processes(
    plan: Plan, rows: IntArray, workers: int | None, progress: Progress | None
) -> Iterator[Found]:
    if len(rows) <= AT_ONCE:
        yield from faults_in(plan, rows)
        return
    parts = np.array_split(rows, -(-len(rows) // AT_ONCE))
    jobs = (Job("check", faults_in, (plan, part)) for part in parts)
    with closing(run_jobs(jobs, workers=workers, preload=PRELOAD)) as events:
        for done, event in enumerate(events, start=1):
            match event:
                case Done(_, result):
                    yield from result
                case Failed(_, reason):
                    raise RuntimeError(f"rows could not be checked: {reason}")
            if progress is not None:
                progress(done / len(parts))


def faults_in(plan: Plan, rows: IntArray) -> list[Found]:
    """What keeps these rows from being run; rows in the order of their numbers."""
    found: dict[tuple[object, ...], Found] = {}
    for row in plan.rows_at(rows):
        try:
            plan.scenario_of(row)
        except InputError as error:
            for fault in error.faults:
                one = Found(placed(fault, f"variant {row.variant}" * bool(row.variant)), row.row)
                known = found.get(one.kind)
                found[one.kind] = replace(known, count=known.count + 1) if known else one
    return sorted(found.values(), key=lambda one: one.row)
