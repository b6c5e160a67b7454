"""The folder: shards are the state, and the table is the same however they came about."""

from __future__ import annotations

import io
from collections.abc import Generator, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sweeps import SMALL, here, plan_of, written
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, RunError
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.compute import Broke, Computed, Outcome, computed, shard_of
from ttwmr_mj.studies.sweep.engine import schema_of
from ttwmr_mj.studies.sweep.execute import chunk_size, fill
from ttwmr_mj.studies.sweep.folder import results
from ttwmr_mj.studies.sweep.folder.extend import extend
from ttwmr_mj.studies.sweep.folder.merge import merge
from ttwmr_mj.studies.sweep.folder.part import Part
from ttwmr_mj.studies.sweep.folder.plan_file import refuse_other, stored_plan, write_plan
from ttwmr_mj.studies.sweep.folder.shards import rows_done, shards_folder, shards_in, to_bytes
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

LARGER = SMALL.replace("seeds = 2", "seeds = [5, 0, 1]").replace(
    "[0.3, 0.4, 0.5]", "[0.35, 0.5, 0.3, 0.4]"
)


def told(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
    """Instead of running rows: tables that say which they are."""
    for rows in chunks:
        columns = {name: [None] * len(rows) for name in schema_of(plan).names}
        said = plan.rows_at(rows)
        columns |= {
            "row": rows.tolist(),
            "draw": [row.draw for row in said],
            "variant": [row.variant for row in said],
            "seed": [row.seed for row in said],
            "verdict": ["lost" if 0.3 in row.values.values() else "followed" for row in said],
            "reason": [repr((sorted(row.values.items()), row.variant, row.seed)) for row in said],
        }
        for key in plan.parameters:
            columns[key] = [row.values[key] for row in said]
        yield Computed(rows, to_bytes(pa.table(columns, schema_of(plan))))


def filled(plan: Plan, folder: Path, **options: object) -> bytes:
    """The table's file, of a new folder."""
    write_plan(folder, plan)
    assert fill(plan, folder, told, **options)  # type: ignore[arg-type]
    return (folder / "results.parquet").read_bytes()


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return plan_of(tmp_path, SMALL)


@pytest.mark.parametrize("chunk", [1, 5, 12, 100, None])
def test_the_table_is_the_same_at_any_chunk_size(
    chunk: int | None, plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(results, "GROUP", 5)  # of several row groups
    expected = filled(plan, tmp_path / "whole", chunk=12)
    assert filled(plan, tmp_path / "cut", chunk=chunk) == expected
    table = pq.read_table(tmp_path / "cut" / "results.parquet")
    assert table["row"].to_pylist() == list(range(12))
    assert pq.ParquetFile(tmp_path / "cut" / "results.parquet").num_row_groups == 3


def test_parts_are_disjoint_make_up_the_whole_and_merge_to_the_same_bytes(
    plan: Plan, tmp_path: Path
) -> None:
    expected = filled(plan, tmp_path / "whole")
    folders = [tmp_path / f"part-{i}" for i in range(1, 6)]
    rows = []
    for i, folder in enumerate(folders, start=1):
        write_plan(folder, plan)
        assert not fill(plan, folder, told, part=Part(i, 5), chunk=i)
        rows += np.flatnonzero(rows_done(folder, plan)).tolist()
        assert not (folder / "results.parquet").exists()
    assert sorted(rows) == list(range(12))
    merge((*folders, folders[0]), tmp_path / "merged")  # one of them twice
    assert fill(plan, tmp_path / "merged", told)
    assert (tmp_path / "merged" / "results.parquet").read_bytes() == expected
    merge(tuple(folders[1:]), folders[0])  # into one of them
    assert fill(plan, folders[0], told)
    assert (folders[0] / "results.parquet").read_bytes() == expected


def test_only_what_is_missing_is_computed(plan: Plan, tmp_path: Path) -> None:
    asked: list[int] = []

    def noting(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        def noted() -> Iterable[IntArray]:
            for rows in chunks:
                asked.extend(rows.tolist())
                yield rows

        yield from told(plan, noted())

    expected = filled(plan, tmp_path / "whole")
    folder = tmp_path / "cut"
    write_plan(folder, plan)
    fill(plan, folder, told, part=Part(2, 3), chunk=2)
    remains = shards_folder(folder, plan) / "000000000-000000003-4.parquet.77.0123abcd.part"
    remains.write_bytes(b"half of it")
    heard: list[tuple[int, int]] = []
    assert fill(plan, folder, noting, chunk=3, told=lambda *n: heard.append(n))
    assert asked == [0, 1, 2, 3, 8, 9, 10, 11]
    assert heard == [(4, 0), (7, 3), (10, 4), (12, 4)]  # of draw 0 all four fail
    assert not remains.exists()
    assert (folder / "results.parquet").read_bytes() == expected
    asked.clear()
    assert fill(plan, folder, noting)
    assert asked == []


def test_rows_that_two_processes_computed_count_once(plan: Plan, tmp_path: Path) -> None:
    expected = filled(plan, tmp_path / "whole")
    for chunk in (4, 5):  # as of two machines on one disk without locks
        write_plan(tmp_path / str(chunk), plan)
        fill(plan, tmp_path / str(chunk), told, chunk=chunk)
    for shard in shards_in(tmp_path / "5", plan):
        shard.path.rename(shards_folder(tmp_path / "4", plan) / shard.path.name)
    (tmp_path / "4" / "results.parquet").unlink()
    assert fill(plan, tmp_path / "4", told)
    assert (tmp_path / "4" / "results.parquet").read_bytes() == expected


def test_a_folder_is_filled_by_one_process_at_a_time(plan: Plan, tmp_path: Path) -> None:
    write_plan(tmp_path / "out", plan)
    with locked(tmp_path / "out"):
        with pytest.raises(InputError, match="this process fills this folder already"):
            fill(plan, tmp_path / "out", told)
        with pytest.raises(InputError, match="this process fills this folder already"):
            fill(plan, tmp_path / "out", told, part=Part(1, 2))
        with pytest.raises(InputError, match="this process fills this folder already"):
            extend(tmp_path / "out", plan, plan_of(tmp_path, LARGER))
        with pytest.raises(InputError, match="this process fills this folder already"):
            merge((tmp_path / "out",), tmp_path / "out")
    with locked(tmp_path / "out", Part(1, 2).name):
        with pytest.raises(InputError, match="this process fills this folder already"):
            fill(plan, tmp_path / "out", told)
        fill(plan, tmp_path / "out", told, part=Part(2, 2))  # its own rows
    assert fill(plan, tmp_path / "out", told)


@pytest.mark.parametrize("chunk", [1, 5, 12])
def test_a_larger_plan_keeps_the_rows_it_has(
    chunk: int, plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = filled(larger := plan_of(tmp_path, LARGER), tmp_path / "whole")
    folder = tmp_path / "grown"
    filled(plan, folder, chunk=chunk)
    monkeypatch.setattr("ttwmr_mj.studies.sweep.folder.extend.GROUP", 7)
    monkeypatch.setattr("ttwmr_mj.studies.sweep.folder.extend.write_plan", interrupted)
    with pytest.raises(KeyboardInterrupt):  # killed before it counts
        extend(folder, plan, larger)
    assert (stored_plan(folder) or larger).digest == plan.digest
    assert rows_done(folder, plan).all()
    monkeypatch.undo()
    extend(folder, plan, larger)
    assert (stored_plan(folder) or plan).digest == larger.digest
    assert rows_done(folder, larger).sum() == 12
    assert [path.name for path in (folder / "shards").iterdir()] == [larger.digest]
    assert fill(larger, folder, told, chunk=5)
    assert (folder / "results.parquet").read_bytes() == expected


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_samples_grow_in_number(sampling: str, tmp_path: Path) -> None:
    text = SMALL.replace("values = [0.3, 0.4, 0.5]", "low = 0.3, high = 0.5").replace(
        "seeds = 2", f'seeds = 2\nsampling = "{sampling}"\nsamples = 4'
    )
    expected = filled(plan_of(tmp_path, text.replace("= 4", "= 8")), tmp_path / "whole")
    plan, larger = plan_of(tmp_path, text), plan_of(tmp_path, text.replace("= 4", "= 8"))
    filled(plan, tmp_path / "grown", chunk=3)
    extend(tmp_path / "grown", plan, larger)
    assert rows_done(tmp_path / "grown", larger).tolist() == [True] * 16 + [False] * 16
    assert fill(larger, tmp_path / "grown", told)
    assert (tmp_path / "grown" / "results.parquet").read_bytes() == expected


@pytest.mark.parametrize(
    ("before", "after", "what"),
    [
        ("seeds = 2", "seeds = [1, 2]", "seeds: got 0; left out"),
        ("[0.3, 0.4, 0.5]", "[0.3, 0.5, 0.6]", r"parameters.reference.radius_m: got \(0.4,\)"),
        ("duration_s=0.4", "duration_s=0.5", "overrides: was .*0.4.*is .*0.5"),
        ("published]\n", "other]\n", "variants: got published; left out"),
        ("terms=published", "terms=regularized", "variants.published: has other overrides"),
        ('"reference.radius_m"', '"initial.x_m"', "parameters: other parameters"),
    ],
)
def test_a_plan_without_all_old_rows_is_no_larger_one(
    before: str, after: str, what: str, plan: Plan, tmp_path: Path
) -> None:
    other = plan_of(tmp_path, SMALL.replace(before, after))
    filled(plan, tmp_path / "out")
    for refuse in (
        lambda: extend(tmp_path / "out", plan, other),
        lambda: refuse_other(tmp_path / "out", plan, other),
    ):
        with pytest.raises(InputError, match="plan\\.json: ") as caught:
            refuse()
    assert "of another plan; give another --out" in str(caught.value)
    with pytest.raises(InputError, match=what):
        extend(tmp_path / "out", plan, other)
    assert rows_done(tmp_path / "out", plan).all()


def test_other_code_makes_another_plan(plan: Plan, tmp_path: Path) -> None:
    code = plan.made_of["code"] | {"ttwmr_mj.controllers.lyapunov": "0" * 16}
    other = replace(plan, made_of=plan.made_of | {"code": code})
    with pytest.raises(InputError, match=r"made_of.code.ttwmr_mj.controllers.lyapunov: was"):
        refuse_other(tmp_path, plan, other)
    with pytest.raises(InputError, match=r"made_of.code.ttwmr_mj.controllers.lyapunov: was"):
        extend(tmp_path, plan, other)


def test_folders_of_different_plans_are_not_merged(plan: Plan, tmp_path: Path) -> None:
    filled(plan, tmp_path / "a")
    filled(plan_of(tmp_path, LARGER), tmp_path / "b")
    with pytest.raises(InputError, match="seeds: was"):
        merge((tmp_path / "a", tmp_path / "b"), tmp_path / "c")
    with pytest.raises(InputError, match="nothing: no sweep's folder"):
        merge((tmp_path / "a", tmp_path / "nothing"), tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_a_plan_of_more_rows_than_are_allowed_is_not_merged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = replace(plan_of(tmp_path, LARGER), seeds=tuple(range(10**5)))
    write_plan(tmp_path / "a", plan)
    words = ["sweep", "--merge", str(tmp_path / "a"), "--out", str(tmp_path / "b")]
    assert main([*words, "--max-rows", str(plan.rows - 1)]) == 2
    assert f"got {plan.rows} rows; allowed: at most {plan.rows - 1}" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()
    assert main([*words, "--max-rows", str(plan.rows)]) == 1
    assert f"{plan.rows} of {plan.rows} rows are missing" in capsys.readouterr().err


def test_a_chunk_that_breaks_is_halved_until_one_row_is_to_blame(
    plan: Plan, tmp_path: Path
) -> None:
    def breaking(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        for rows in chunks:
            if {3, 9} & set(rows.tolist()):
                yield Broke(rows, "the process ended with SIGSEGV")
            else:
                yield from told(plan, [rows])

    write_plan(tmp_path / "out", plan)
    assert fill(plan, tmp_path / "out", breaking, chunk=12)
    table = pq.read_table(tmp_path / "out" / "results.parquet")
    bad = table.take([3, 9]).to_pylist()
    assert table["row"].to_pylist() == list(range(12))
    for row in bad:
        assert (row["status"], row["verdict"]) == ("failed", "failed")
        assert row["reason"] == "the process ended with SIGSEGV"
        assert row["tractor_rmse_m"] is None
    assert [row["reference.radius_m"] for row in bad] == [0.3, 0.5]
    assert "SIGSEGV" not in str(table.take([2, 4, 8, 10])["reason"])


def test_an_exception_of_the_code_stops_the_sweep_and_is_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks(*_: object) -> None:
        raise ValueError("one\ntwo")

    monkeypatch.setattr("ttwmr_mj.studies.sweep.compute.table_of", breaks)
    rows = np.array([2, 3, 4])
    result = shard_of(plan_of(tmp_path, SMALL), rows)
    told = r"rows 2 to 4 could not be computed: ValueError: one\\ntwo; a law"
    with pytest.raises(RunError, match=told) as caught:
        computed(rows, result)
    assert "\n" not in str(caught.value)
    assert caught.value.__notes__[0].startswith("Traceback")  # which --debug shows


@pytest.mark.parametrize(("part", "rows"), [("1/13", "which has no rows"), ("2/3", "rows 4 to 7")])
def test_a_part_says_which_rows_it_has(
    part: str,
    rows: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("ttwmr_mj.cli.commands.sweep.Sweep._compute", lambda _: here)
    words = ["sweep", written(tmp_path, SMALL), "--out", str(tmp_path / "out"), "--shard", part]
    assert main(words) == 0
    assert f"small: part {part}, {rows}, is done in {tmp_path}/out" in capsys.readouterr().out


def test_parts_and_their_names() -> None:
    assert Part.of(None) == Part(1, 1)
    assert Part.of("2/8") == Part(2, 8)
    for text in ("0/8", "9/8", "2", "2/", "a/b", "-1/3", "1/2/3"):
        with pytest.raises(InputError, match=r"--shard: got .* allowed: i/n"):
            Part.of(text)


def test_chunks_suit_what_is_run(plan: Plan, tmp_path: Path) -> None:
    assert chunk_size(plan, 12) == 2
    assert chunk_size(plan, 10**6) == 128  # a batch of each variant
    camera = SMALL.replace("lab_circle", "lab_circle_camera").replace(
        ', "sensing.position_noise_m=1e-3"', ""
    )
    seen = plan_of(tmp_path, camera.replace("plant.kind=analytic", "output.figures=false"))
    assert chunk_size(seen, 10**6) == 8


def test_what_is_run_here_is_what_is_run_alone(plan: Plan, tmp_path: Path) -> None:
    write_plan(tmp_path / "a", plan)
    write_plan(tmp_path / "b", plan)
    assert fill(plan, tmp_path / "a", here, chunk=12)
    assert fill(plan, tmp_path / "b", here, chunk=1)
    one, other = ((tmp_path / name / "results.parquet").read_bytes() for name in "ab")
    assert one == other
    assert pq.read_table(io.BytesIO(one)).schema.equals(schema_of(plan))


def test_what_changes_no_row_is_taken_from_the_file(plan: Plan, tmp_path: Path) -> None:
    whole = filled(plan, tmp_path / "out")
    other = replace(plan, metric="tractor_max_error_m", description="with another metric")
    refuse_other(tmp_path / "out", plan, other)
    assert fill(other, tmp_path / "out", told)
    assert stored_plan(tmp_path / "out") == other
    assert Sweep.read(tmp_path / "out").plan["headline_metric"] == "tractor_max_error_m"
    assert (tmp_path / "out" / "results.parquet").read_bytes() == whole
