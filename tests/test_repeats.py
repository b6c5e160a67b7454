"""A run that every seed repeats is one run: in intervals, comparisons and on the pages."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sweeps_drawn import FRICTION, MASS, drawn_sweep
from test_leaderboard import ORDER, line

from ttwmr_mj.studies.bench.leaderboard import to_markdown
from ttwmr_mj.studies.bench.lines import TIME, Line, ranked, without_repeats
from ttwmr_mj.studies.bench.page import to_html
from ttwmr_mj.studies.bench.scoring import Board
from ttwmr_mj.studies.sweep.answers.findings import find
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.report import write_report

SEEDS = 10


@pytest.fixture
def half_quiet(tmp_path: Path) -> Path:
    """A sweep of two variants: of "quiet" all seeds are the same run, of "random" none."""
    columns = drawn_sweep(
        tmp_path, {FRICTION: {"values": [0.0, 1e-3]}}, variants=("quiet", "random"), seeds=SEEDS
    )
    for name, values in columns.items():
        if name not in ("row", "seed"):
            first = [values[i - i % SEEDS] for i in range(len(values))]
            quiet = [variant == "quiet" for variant in columns["variant"]]
            columns[name] = [a if q else b for q, a, b in zip(quiet, first, values, strict=True)]
    pq.write_table(pa.table(columns), tmp_path / "results.parquet")
    return tmp_path


def test_each_variant_of_a_sweep_is_looked_at_by_itself(half_quiet: Path) -> None:
    sweep = Sweep.read(half_quiet).without_repeats()
    assert {name: len(runs) for name, runs in sweep.variants.items()} == {
        "quiet": 2,
        "random": 2 * SEEDS,
    }
    findings = find(sweep)
    assert findings.variants["quiet"].runs == 2
    assert findings.variants["random"].runs == 2 * SEEDS
    (pair,) = findings.pairs
    assert pair.found.pairs == 2 * SEEDS  # the run that stands for every seed


def test_the_report_says_which_variants_are_counted_once(half_quiet: Path) -> None:
    write_report(half_quiet)
    page = (half_quiet / "report.html").read_text()
    assert "All seeds gave the same runs of quiet: only those of the first are counted" in page
    assert f"and {2 * SEEDS - 2} repeats are left out. Each stands for every seed" in page
    assert f"2 draws × 2 variants × 1 or {SEEDS} seeds" in page


def test_seeds_that_draw_are_no_repeats_though_nothing_comes_of_it(tmp_path: Path) -> None:
    """A parameter that does not matter; eight draws without failure are eight."""
    given = {MASS: {"distribution": "uniform", "low": 0.3, "high": 0.4}}
    drawn_sweep(tmp_path, given, seeds=8, samples=1)
    plan = json.loads((tmp_path / "plan.json").read_text())
    plan["sampling"] = "grid"
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    columns = pq.read_table(tmp_path / "results.parquet").to_pydict()
    alike = {name: [values[0]] * 8 for name, values in columns.items()}
    alike |= {name: columns[name] for name in ("row", "seed")}
    alike[MASS] = np.linspace(0.3, 0.4, 8).tolist()
    pq.write_table(pa.table(alike), tmp_path / "results.parquet")
    assert write_report(tmp_path).startswith("drawn: 8 runs, 0 failed: 0 % [0, 36.9]")


def test_runs_without_numbers_show_no_repeat(half_quiet: Path) -> None:
    table = pq.read_table(half_quiet / "results.parquet")
    for i, name in enumerate(table.column_names):
        if pa.types.is_floating(table[name].type) and name != FRICTION:
            nothing = pa.array(np.full(len(table), np.nan), from_pandas=True)
            table = table.set_column(i, name, nothing)
    pq.write_table(table, half_quiet / "results.parquet")
    assert len(Sweep.read(half_quiet).without_repeats()) == 4 * SEEDS


def repeated(name: str, error_mm: float) -> Line:
    """A line of equal runs, of which each took its own time."""
    runs = line(name, [error_mm] * SEEDS).runs
    alike = (
        replace(run, sentence="followed: at most 1 mm", values=run.values | {TIME: 1.0 + run.seed})
        for run in runs
    )
    return replace(line(name, [error_mm]), runs=tuple(alike))


def test_repeats_of_a_suite_count_once_and_make_no_law_the_best() -> None:
    one, other = without_repeats(repeated("a", 1.0)), without_repeats(repeated("b", 2.0))
    assert (len(one.runs), one.repeats) == (1, tuple(range(1, SEEDS)))
    assert not any(found.best for found in ranked([one, other], ORDER))
    (broken,) = line("c", [None], ["failed"]).runs
    broke_off = line("c", [None] * SEEDS, ["failed"] * SEEDS)
    same = (replace(broken, seed=run.seed) for run in broke_off.runs)
    broke_off = without_repeats(replace(broke_off, runs=tuple(same)))
    assert len(broke_off.runs) == SEEDS  # nothing shows that these are the same
    assert not any(found.best for found in ranked([one, broke_off], ORDER))
    # against a law of which every seed is another run each seed is a pair
    random = without_repeats(line("b", [2.0 + i for i in range(SEEDS)]))
    assert not random.repeats
    assert [found.names["controller"] for found in ranked([one, random], ORDER) if found.best] == [
        "a"
    ]


def test_the_leaderboard_says_which_lines_are_counted_once() -> None:
    lines = [without_repeats(repeated("a", 1.0)), line("b", [2.0 + i for i in range(SEEDS)])]
    board = Board(ranked(lines, ORDER), 20, Counter({"version 1": 20}))
    said = "a, seeds 0, 1, 2, 3, 4, 5, 6, 7, 8, 9: the very same run, which counts once"
    assert said in to_html(board, "mine")
    page = to_markdown(board, "mine")
    assert f"- {said}" in page
    assert "| 1/1 | followed |" in page
