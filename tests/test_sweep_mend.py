"""What is damaged, or no file, in a sweep's folder: named and made again, or refused."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_sweep_folder import filled, told

from sweeps import SMALL, plan_of
from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.pool.limits import reason_after
from ttwmr_mj.studies.sweep.compute import Broke, Compute, Outcome
from ttwmr_mj.studies.sweep.execute import fill
from ttwmr_mj.studies.sweep.folder.merge import merge
from ttwmr_mj.studies.sweep.folder.part import Part
from ttwmr_mj.studies.sweep.folder.plan_file import (
    PLAN_FILE,
    refuse_foreign,
    stored_plan,
    write_plan,
)
from ttwmr_mj.studies.sweep.folder.shards import shards_in
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray


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


@pytest.mark.parametrize("name", ["shards/*/*.parquet", "results.parquet"])
def test_a_table_whose_texts_are_not_utf_8_is_made_again(
    name: str, plan: Plan, tmp_path: Path
) -> None:
    whole, out = filled(plan, tmp_path / "out", chunk=12), tmp_path / "out"
    (path,) = out.glob(name)
    table = pq.read_table(path)
    bytes_of = pa.array([b"\xa0"] * len(table)).view(pa.string())
    place = table.schema.get_field_index("reason")
    pq.write_table(table.set_column(place, table.schema.field(place), bytes_of), path)
    said: list[str] = []
    assert fill(plan, out, told, warn=said.extend)
    assert said == [f"{path}: damaged; it is made again"]
    assert (out / "results.parquet").read_bytes() == whole


def late_at(*late: int) -> Compute:
    """Rows that take longer than they are allowed, among others that do not."""

    def compute(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        for rows in chunks:
            if set(rows.tolist()) & set(late):
                yield Broke(rows, reason_after(plan.timeout_s * len(rows)))
            else:
                yield from told(plan, [rows])

    return compute


def test_rows_that_timed_out_and_no_others_are_made_again_with_more_time(
    plan: Plan, tmp_path: Path
) -> None:
    whole, out = filled(plan, tmp_path / "whole"), tmp_path / "out"
    made: list[int] = []

    def noting(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        for rows in chunks:
            made.extend(rows.tolist())
            yield from told(plan, [rows])

    short = replace(plan, timeout_s=0.3)
    write_plan(out, short)
    assert fill(short, out, late_at(3, 8, 9), chunk=6)
    first = (out / "results.parquet").read_bytes()
    for no_more in (short, replace(plan, timeout_s=0.2)):
        assert fill(no_more, out, noting)
        assert (made, (out / "results.parquet").read_bytes()) == ([], first)
    assert not fill(plan, out, noting, part=Part(2, 2))  # of the others, one is in the other part
    assert made == [8, 9]
    assert not (out / "results.parquet").exists()
    assert fill(plan, out, noting)
    assert made == [8, 9, 3]
    assert (out / "results.parquet").read_bytes() == whole
    assert stored_plan(out) == plan
    assert fill(plan, out, noting)
    assert len(made) == 3


def test_folders_of_several_limits_are_joined_with_the_largest(plan: Plan, tmp_path: Path) -> None:
    short = replace(plan, timeout_s=0.3)
    write_plan(tmp_path / "a", short)
    fill(short, tmp_path / "a", late_at(3), part=Part(1, 2))
    write_plan(tmp_path / "b", plan)
    fill(plan, tmp_path / "b", told, part=Part(2, 2))
    joined = merge((tmp_path / "a", tmp_path / "b"), tmp_path / "all")
    assert joined.timeout_s == plan.timeout_s
    assert fill(joined, tmp_path / "all", told)
    whole = filled(plan, tmp_path / "whole")
    assert (tmp_path / "all" / "results.parquet").read_bytes() == whole


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


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [
        (("timeout_s",), None, "timeout_s: got None"),
        (("timeout_s",), float("inf"), "Infinity is no finite number"),
        (("folder",), 5, "folder: got 5"),
        (("name",), "<b>", "name: got '<b>'"),
        (("seeds", 0), 10**30, "does not fit into 64 bits"),
        (("headline_metric",), "x", "headline_metric: got 'x'; there is no such metric"),
        (("parameters", "reference.radius_m", "values", 0), None, "radius_m.values.0: got None"),
        (("parameters", "reference.radius_m", "axis"), "x", "does not say of which axis"),
        (("parameters", "reference.radius_m", "values", 0), 0.25, "digest: .* which was changed"),
        (("base", "duration_s"), 9.0, "digest: .* which was changed"),
    ],
)
def test_a_plan_that_was_edited_is_refused_whole(
    place: tuple[str | int, ...], value: object, told: str, tmp_path: Path
) -> None:
    plan = plan_of(tmp_path, SMALL)
    for name in ("one", "two"):
        write_plan(tmp_path / name, plan)
    stored = json.loads((tmp_path / "one" / PLAN_FILE).read_text())
    table = stored
    for key in place[:-1]:
        table = table[key]
    table[place[-1]] = value
    (tmp_path / "one" / PLAN_FILE).write_text(json.dumps(stored))
    with pytest.raises(InputError, match=rf"one/plan\.json: no plan that .*{told}"):
        merge((tmp_path / "one", tmp_path / "two"), tmp_path / "all")
    assert not (tmp_path / "all").exists()


STRANGE = {
    "not of a plan's rows": "999999990-999999999-10.parquet",
    "more than there is room for": "000000000-000000005-900000000.parquet",
    "none": "000000000-000000005-0.parquet",
    "from the end to the start": "000000005-000000000-6.parquet",
    "not counted": "000000000-000000005-x.parquet",
    "a copy": "000000000-000000005-6 (copy).parquet",
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_is_no_shards_name_is_no_shard(kind: str, plan: Plan, tmp_path: Path) -> None:
    whole, out = filled(plan, tmp_path / "out", chunk=6), tmp_path / "out"
    shard = shards_in(out, plan)[0]
    (shard.path.parent / STRANGE[kind]).write_bytes(shard.path.read_bytes())
    shard.path.unlink()
    (out / "results.parquet").unlink()
    assert fill(plan, out, told)
    assert (out / "results.parquet").read_bytes() == whole
    merge((out,), tmp_path / "joined")
    assert len(shards_in(tmp_path / "joined", plan)) == len(shards_in(out, plan))


def test_a_shard_that_holds_other_rows_than_its_name_says_is_not_merged(
    plan: Plan, tmp_path: Path
) -> None:
    filled(plan, tmp_path / "out", chunk=6)
    one, other = shards_in(tmp_path / "out", plan)[:2]
    one.path.write_bytes(other.path.read_bytes())
    with pytest.raises(InputError, match=r"does not hold the rows that its name says") as refused:
        merge((tmp_path / "out",), tmp_path / "joined")
    assert str(one.path) in str(refused.value)
    assert not (tmp_path / "joined").exists()
