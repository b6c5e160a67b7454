"""Run folders, and damage to them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

import ttwmr_mj as tt
from ttwmr_mj.runs.execute import run_scenario

Columns = dict[str, Any]
LEAN = ("output.recording=false", "output.figures=false", "duration_s=1.0")


def made(folder: Path, name: str, *overrides: str, beside: Path | None = None) -> Path:
    run_scenario(tt.load_scenario(name, [*LEAN, *overrides]), folder, scenario_folder=beside)
    return folder


def edit(folder: Path, change: Callable[[Columns], Columns]) -> None:
    file = folder / "trajectory.parquet"
    table = pq.read_table(file)
    columns = {name: table[name].to_numpy().copy() for name in table.column_names}
    pq.write_table(pa.table(change(columns)), file)
