"""Can the laws of a sweep be loaded? Of every variant, and of every word that is varied."""

from __future__ import annotations

from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.pool.laws import refused_laws
from ttwmr_mj.studies.sweep.compute import MODULES
from ttwmr_mj.studies.sweep.plan.build import kinds_of_rows
from ttwmr_mj.studies.sweep.plan.checks import placed
from ttwmr_mj.studies.sweep.plan.plan import Plan


def check_laws(plan: Plan, source: str, *, workers: int | None = None) -> None:
    """Load every law of others' once.

    Args:
        plan: whose rows are sound.
        source: the sweep's file, for messages.
        workers: processes at a time; None: one per processor.

    Raises:
        InputError: a law is not there, or cannot be made.
    """
    kinds = list(kinds_of_rows(plan))
    scenarios = {i: (plan.scenario_of(row), plan.beside) for i, row in enumerate(kinds)}
    refused = refused_laws(scenarios, plan.timeout_s, workers=workers, preload=MODULES)
    faults = [
        placed(fault, f"variant {kinds[i].variant}" if kinds[i].variant else "")
        for i, found in refused.items()
        for fault in found
    ]
    if faults:
        raise InputError(*dict.fromkeys(faults), file=source)
