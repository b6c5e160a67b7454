"""What the tests of sweeps share: a small sweep of short runs, and its plan."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from pathlib import Path

from ttwmr_mj.studies.sweep.compute import Outcome, computed, shard_of
from ttwmr_mj.studies.sweep.plan.build import build_plan, completed
from ttwmr_mj.studies.sweep.plan.file import load_sweep
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

SMALL = """
name = "small"
scenario = "lab_circle"
overrides = ["duration_s=0.4", "plant.kind=analytic", "sensing.position_noise_m=1e-3"]
seeds = 2

[parameters]
"reference.radius_m" = { values = [0.3, 0.4, 0.5] }

[variants.omitted]

[variants.published]
overrides = ["controller.singular_terms=published"]
"""


def written(folder: Path, text: str, name: str = "mine.toml") -> str:
    """The path of a new file."""
    (folder / name).write_text(text)
    return str(folder / name)


def plan_of(folder: Path, text: str) -> Plan:
    """The plan of a sweep, its rows not checked, its ingredients known."""
    return completed(build_plan(load_sweep(written(folder, text))))


def here(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
    """Computes chunks in this process."""
    for rows in chunks:
        yield computed(rows, shard_of(plan, rows))
