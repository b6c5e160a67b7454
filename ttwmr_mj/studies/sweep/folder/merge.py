"""Folders of one plan joined: those of several machines, each with a part of the rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.studies.sweep.folder.mend import refuse_damaged
from ttwmr_mj.studies.sweep.folder.plan_file import PLAN_FILE, refuse_other, stored_plan, write_plan
from ttwmr_mj.studies.sweep.folder.shards import rows_done, shards_in, write_shard
from ttwmr_mj.studies.sweep.plan.build import MOST_ROWS, refuse_too_many_rows
from ttwmr_mj.studies.sweep.plan.plan import Plan


def merge(folders: tuple[Path, ...], into: Path, most_rows: int = MOST_ROWS) -> Plan:
    """Bring the shards of folders together in one, which may be one of them.

    Args:
        folders: of one plan.
        into: gets copies of what it lacks; need not be there.
        most_rows: of a plan that is taken.

    Raises:
        InputError: a folder holds no sweep, that of another plan or of too many rows, or a
            damaged shard, or another process fills the one to join them in; nothing was written.
    """
    plans = [(folder, _plan_of(folder)) for folder in folders]
    target = stored_plan(into)
    every = [*([target] if target else []), *(plan for _, plan in plans)]
    first = replace(every[0], timeout_s=max(plan.timeout_s for plan in every))
    for folder, plan in plans:
        refuse_other(folder, plan, first)
    refuse_too_many_rows(first, str(folders[0] / PLAN_FILE), most_rows)
    shards = [shard for folder, plan in plans for shard in shards_in(folder, plan)]
    for shard in shards:
        refuse_damaged(shard, first)
    into.mkdir(parents=True, exist_ok=True)
    with locked(into):
        if target is None:
            write_plan(into, first)
        done = rows_done(into, first)
        for shard in shards:
            rows = shard.rows
            if not done[rows].all():
                write_shard(into, first, rows, shard.path.read_bytes())
                done[rows] = True
    return first


def _plan_of(folder: Path) -> Plan:
    plan = stored_plan(folder)
    if plan is None:
        fault = Fault(problem=f"no sweep's folder: there is no {PLAN_FILE}")
        raise InputError(fault, file=str(folder))
    return plan
