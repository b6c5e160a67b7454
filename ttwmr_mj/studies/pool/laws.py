"""Laws of others, loaded before the first row starts: what `ttwmr run` refuses, studies refuse."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TypeVar

from ttwmr_mj.config import frozen
from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.jobs import Failed, Job, run_jobs

K = TypeVar("K", bound=Hashable)


def refused_laws(
    rows: Mapping[K, tuple[Scenario, Path]],
    timeout_s: float,
    *,
    workers: int | None = None,
    preload: Sequence[str] = (),
) -> dict[K, list[Fault]]:
    """Import and make each law that is not this package's, in a process that is watched.

    One that ends its process, or is not there in time, may do otherwise in its run: it is no fault.

    Args:
        rows: name of a row → its scenario, and where a law is looked for first.
        timeout_s: wall time for each law.
        workers: processes at a time; None: one per processor.
        preload: modules, as of `run_jobs`.

    Returns:
        The first row of each law that is refused → what is wrong with the law.
    """
    first: dict[tuple[Hashable, Path], K] = {}
    for name, (scenario, folder) in rows.items():
        if scenario.controller.of_others:
            first.setdefault((frozen(scenario.controller), folder), name)
    names, refused = list(first.values()), dict[int, list[Fault]]()
    jobs = (Job(str(i), load_law, rows[name], timeout_s) for i, name in enumerate(names))
    with closing(run_jobs(jobs, workers=workers, preload=preload)) as events:
        for event in events:
            if isinstance(event, Failed) and isinstance(event.error, InputError):
                refused[int(event.job.name)] = list(event.error.faults)
    return {names[i]: refused[i] for i in sorted(refused)}


def load_law(scenario: Scenario, folder: Path) -> None:
    """In the process: make the law as a run does."""
    from ttwmr_mj.runs.build import make_controller

    make_controller(scenario, folder)
