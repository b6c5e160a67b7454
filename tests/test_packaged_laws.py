"""Laws and references of installed packages run as others do: alone, in batches and in studies."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import packaged
import pyarrow.parquet as pq
import pytest
from pydantic import ConfigDict

from ttwmr_mj.config import Config, batch_shape, frozen, stacked

ROWS = """
import ttwmr_mj as tt

def same(a, b):
    ours, theirs = a.trajectory.to_columns(), b.trajectory.to_columns()
    assert list(ours) == list(theirs)
    assert all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)
    assert a.outcomes == b.outcomes and a.outcomes[0].status == "ok"

for overrides in GROUPS:
    rows = [tt.load_scenario("packaged.toml", of) for of in overrides]
    for among in (rows, rows[::-1], [rows[0], rows[0]]):
        for row, together in zip(among, tt.run_batch(among), strict=True):
            same(together, tt.simulate(row))
    ends = {tuple(tt.simulate(row).trajectory.q[-1, 0].tolist()) for row in rows}
    assert len(ends) == len(rows), "what differs between rows does something"
"""
LISTS = [
    "controller.gains=[1.0, 2.0]",
    "controller.gains=[1.0, 3.0]",
    "controller.table={more=[0.5]}",
]
LINES = ["reference.table={speeds=[0.1, 0.2]}", "reference.table={speeds=[0.3]}"]


class Part(Config):
    """What a package's table may hold."""

    size: float = 1.0
    names: list[str] = []


class Options(Config):
    """What a package's options may be made of."""

    model_config = ConfigDict(arbitrary_types_allowed=True)
    same_in_batch: ClassVar[frozenset[str]] = frozenset({"fixed"})
    anything: Any = None
    parts: list[Part] = []
    fixed: list[float] = []


class Word(Enum):
    """A choice."""

    ONE = 1


def test_a_key_tells_values_and_types_apart() -> None:
    values: list[Any] = [
        None,
        1,
        True,
        1.0,
        0.0,
        -0.0,
        "1",
        Word.ONE,
        [1],
        (1,),
        [1.0],
        {1},
        {"1": 1},
    ]
    values += [{"1": 1.0}, {"a": 1, "b": 2}, {"b": 2, "a": 1}, [[1], []], [[], [1]], frozenset({1})]
    values += [Part(), Part(names=["a"]), {"a": [Part(size=2.0)]}, float("inf"), b"1", np.zeros(2)]
    options = [Options(anything=value) for value in values]
    assert len({frozen(one) for one in options}) == len(values)
    for one in options:
        assert frozen(one) == frozen(one.model_copy())
    assert frozen(Options(parts=[Part()])) == frozen(Options(parts=[Part()]))


def test_lists_and_tables_of_numbers_share_a_batch_and_are_stacked() -> None:
    rows = [
        Options(anything={"a": [x, 1.0]}, parts=[Part(size=x, names=["n"])], fixed=[1.0])
        for x in (1.0, 2.0)
    ]
    assert batch_shape(rows[0]) == batch_shape(rows[1])
    one = stacked(rows)
    np.testing.assert_array_equal(one.anything["a"][0], [1.0, 2.0])
    assert one.anything["a"][1] == 1.0
    np.testing.assert_array_equal(one.parts[0].size, [1.0, 2.0])
    assert one.parts[0].names == ["n"]
    shapes = [{"a": [0.0]}, {"a": [-0.0]}, {"a": [1.0]}, {"a": [1]}, {"a": [True]}, {"b": [1.0]}]
    shapes += [{"a": [1.0, 1.0]}, {"a": ["1"]}]
    options = [
        *(Options(anything=shape) for shape in shapes),
        Options(fixed=[1.0]),
        Options(fixed=[2.0]),
    ]
    assert len(set(map(batch_shape, options))) == len(options)


def test_a_row_with_lists_and_tables_is_the_same_as_alone(tmp_path: Path) -> None:
    groups = [
        [[one] for one in LISTS],
        [["controller={kind='listed_stack'}", one] for one in LISTS],
        [["controller={kind='lyapunov'}", one] for one in LINES],
        [["reference.anything=1"], ["reference.anything=true"]],
    ]
    packaged.install(tmp_path)
    packaged.python(tmp_path, "-c", ROWS.replace("GROUPS", repr(groups)))


def test_a_row_of_anothers_law_is_the_same_as_alone(tmp_path: Path) -> None:
    seeds = [[f"seed={seed}"] for seed in range(3)]
    noise = "sensing.position_noise_m=1e-3"
    groups = [
        [["controller={kind='dither'}", *seed] for seed in seeds],
        [["controller={kind='dither_stack'}", *seed] for seed in seeds],
        [["controller={kind='first'}", noise, *seed] for seed in seeds],
        [[f"controller={{kind='first', name='n{seed[0][-1]}'}}", noise, *seed] for seed in seeds],
    ]
    packaged.install(tmp_path)
    packaged.python(tmp_path, "-c", ROWS.replace("GROUPS", repr(groups)))


GRABBED = """
import ttwmr_mj as tt
for kind in ("grabby", "listed"):
    scenario = tt.load_scenario("packaged.toml", [f"controller={{kind='{kind}'}}"])
    before = scenario.model_dump_json()
    tt.simulate(scenario)
    assert scenario.model_dump_json() == before
own = tt.load_scenario("packaged.toml", ["controller={kind='lyapunov'}"])
before = own.model_dump_json()

class Grabby(tt.Controller):
    def start(self, task):
        self.nsim = task.nsim
        object.__setattr__(task.robot.tractor, "mass_kg", 99.0)
    def command(self, k, estimate):
        return self.plain(estimate.state.q[:, :2])
tt.simulate(own, controller=Grabby())
assert own.model_dump_json() == before
"""


def test_what_a_packages_law_does_to_its_task_and_options_is_its_own(tmp_path: Path) -> None:
    packaged.install(tmp_path)
    packaged.python(tmp_path, "-c", GRABBED)


def test_seeds_of_anothers_law_are_not_called_idle(tmp_path: Path) -> None:
    packaged.install(tmp_path)
    (tmp_path / "s.toml").write_text('name = "s"\nscenario = "packaged.toml"\nseeds = 2\n')
    words = "-m", "ttwmr_mj", "sweep", "s.toml", "--dry-run"
    told = [
        packaged.python(tmp_path, *words, "--set", f"controller.kind={kind}")
        for kind in ("dither", "lyapunov")
    ]
    assert ["all seeds give the same run" in text for text in told] == [False, True]


@pytest.mark.slow
def test_a_packages_law_that_leaves_is_its_runs_failure(tmp_path: Path) -> None:
    packaged.install(tmp_path)
    suite = 'name = "b"\ntask.t.scenario = "packaged.toml"\n'
    (tmp_path / "b.toml").write_text(f"{suite}controller.a.overrides = ['controller.kind=leaving']")
    packaged.python(tmp_path, "-m", "ttwmr_mj", "bench", "b.toml", "--out", "bench")
    (row,) = (json.loads(path.read_text()) for path in tmp_path.rglob("row.json"))
    assert row["verdict"] == "failed"
    assert "exit code 3" in row["reason"]


@pytest.mark.slow
def test_studies_of_lists_and_tables_have_the_runs_of_run(tmp_path: Path) -> None:
    packaged.install(tmp_path)
    variants = [LISTS[1], LINES[1]]
    told = "".join(f"[variants.v{i}]\noverrides = [{one!r}]\n" for i, one in enumerate(variants))
    (tmp_path / "s.toml").write_text(f'name = "s"\nscenario = "packaged.toml"\n{told}')
    told = "".join(f"[controller.v{i}]\noverrides = [{one!r}]\n" for i, one in enumerate(variants))
    (tmp_path / "b.toml").write_text(f'name = "b"\n[task.t]\nscenario = "packaged.toml"\n{told}')
    for command in ("sweep", "bench"):
        packaged.python(tmp_path, "-m", "ttwmr_mj", command, f"{command[0]}.toml", "--out", command)
    table = pq.read_table(tmp_path / "sweep" / "results.parquet").to_pylist()
    benched = sorted((tmp_path / "bench").rglob("trajectory.parquet"))
    assert len(table) == len(benched) == len(variants)
    for i, one in enumerate(variants):
        words = "-m", "ttwmr_mj", "run", "packaged.toml", "--set", one, "--out", f"run{i}"
        packaged.python(tmp_path, *words)
        alone = (tmp_path / f"run{i}" / "trajectory.parquet").read_bytes()
        assert benched[i].read_bytes() == alone
        metrics = json.loads((tmp_path / f"run{i}" / "metrics.json").read_text())
        assert table[i]["tractor_rmse_m"] == metrics["tractor_rmse_m"]
