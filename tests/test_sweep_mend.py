"""What is damaged, or no file, in a sweep's folder: named and made again, or refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from test_sweep_folder import filled, told

from sweeps import SMALL, plan_of
from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.sweep.execute import fill
from ttwmr_mj.studies.sweep.folder.merge import merge
from ttwmr_mj.studies.sweep.folder.plan_file import refuse_foreign, write_plan
from ttwmr_mj.studies.sweep.folder.shards import shards_in
from ttwmr_mj.studies.sweep.plan.plan import Plan


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return plan_of(tmp_path, SMALL)


def test_a_damaged_shard_is_named_and_made_again(plan: Plan, tmp_path: Path) -> None:
    filled(plan, tmp_path / "out", chunk=6)
    whole = (tmp_path / "out" / "results.parquet").read_bytes()
    shard = shards_in(tmp_path / "out", plan)[0]
    shard.path.write_bytes(shard.path.read_bytes()[:-100])
    (tmp_path / "out" / "results.parquet").unlink()
    with pytest.raises(InputError, match=r"the file is damaged.*delete it"):
        shard.read()
    said: list[str] = []
    assert fill(plan, tmp_path / "out", told, warn=said.extend)
    assert said == [f"{shard.path}: damaged; it is made again"]
    assert (tmp_path / "out" / "results.parquet").read_bytes() == whole


def folder_at(path: Path) -> None:
    path.mkdir()
    (path / "a.txt").write_text("of somebody")


def link_to_itself(path: Path) -> None:
    path.symlink_to(path.name)


@pytest.mark.parametrize("make", [os.mkfifo, folder_at, link_to_itself])
def test_what_is_no_file_among_the_shards_is_made_again(
    make: Callable[[Path], None], plan: Plan, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    whole = filled(plan, out, chunk=6)
    shard = shards_in(out, plan)[0]
    shard.path.unlink()
    make(shard.path)
    (out / "results.parquet").unlink()
    with pytest.raises(InputError, match="the file is damaged"):
        merge((out,), tmp_path / "joined")
    assert not (tmp_path / "joined").exists()
    said: list[str] = []
    assert fill(plan, out, told, warn=said.extend)
    assert said == [f"{shard.path}: damaged; it is made again"]
    assert (out / "results.parquet").read_bytes() == whole


@pytest.mark.parametrize("make", [os.mkfifo, link_to_itself])
def test_what_is_no_file_where_the_table_should_be_is_replaced(
    make: Callable[[Path], None], plan: Plan, tmp_path: Path
) -> None:
    whole = filled(plan, tmp_path / "out")
    table = tmp_path / "out" / "results.parquet"
    table.unlink()
    make(table)
    assert fill(plan, tmp_path / "out", told)
    assert table.read_bytes() == whole


@pytest.mark.parametrize("name", ["results.parquet", "report.html"])
def test_a_folder_in_the_way_is_told_before_anything_runs(
    name: str, plan: Plan, tmp_path: Path
) -> None:
    write_plan(tmp_path / "out", plan)
    refuse_foreign(tmp_path / "out")
    (tmp_path / "out" / name).mkdir()
    with pytest.raises(InputError, match=rf"a folder is in the way of {name}"):
        refuse_foreign(tmp_path / "out")
