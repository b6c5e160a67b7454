"""A number that one variant of a sweep cannot have is undefined there, and nobody's failure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from sweeps_drawn import FRICTION, HEADLINE, drawn_sweep

from ttwmr_mj.studies.sweep.answers.findings import find
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.report import write_report

SLIPPING = "slipping_share"


def without(folder: Path, variant: str, metric: str) -> None:
    """Take a metric from all runs of a variant."""
    columns = pq.read_table(folder / "results.parquet").to_pydict()
    pairs = zip(columns["variant"], columns[metric], strict=True)
    columns[metric] = [None if name == variant else value for name, value in pairs]
    pq.write_table(pa.table(columns), folder / "results.parquet")


def test_what_a_variants_plant_does_not_have_is_no_failure_of_its_runs(tmp_path: Path) -> None:
    """Slip, say, of the second one; errors of both are compared as ever."""
    drawn_sweep(
        tmp_path,
        {FRICTION: {"values": [0.0, 5e-4, 1e-3]}},
        variants=("a", "b"),
        seeds=8,
        headline=SLIPPING,
    )
    without(tmp_path, "b", SLIPPING)
    found = find(Sweep.read(tmp_path))
    assert np.isfinite(found.metrics["a"][SLIPPING][1].value)
    assert np.isnan(found.metrics["b"][SLIPPING]).all()
    assert np.isnan(found.variants["b"].median.value)
    (pair,) = found.pairs
    assert (pair.found.pairs, pair.found.unknown, pair.found.favours) == (24, 24, 0)
    assert np.isfinite(found.metrics["b"][HEADLINE][1].value)
    write_report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "No pair of b and a has a slipping share to compare." in page
    assert "nan" not in page
    # a time that no run of a variant reached is worse than any, not undefined
    without(tmp_path, "b", "settling_time_s")
    assert find(Sweep.read(tmp_path)).metrics["b"]["settling_time_s"][1].value == np.inf
