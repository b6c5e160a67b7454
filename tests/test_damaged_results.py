"""Stored results that were damaged: named, made again or reported, never the end of the rest."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.files import remove
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.pool.task import RUN_FILES, Kept

SUITE = """
name = "pair"
seeds = [0]
[controller.article]
overrides = ['controller={kind="lyapunov"}']
[controller.tuned]
overrides = ['controller={kind="lyapunov", alpha1=50.0}']
[task.circle]
scenario = "lab_circle"
overrides = ["duration_s=2.0", "output.recording=false", "output.figures=false"]
[plant.analytic]
overrides = ["plant.kind=analytic"]
"""
SWEEP = """
name = "three"
scenario = "lab_circle"
overrides = ["plant.kind=analytic", "duration_s=1.0"]
metric = "tractor_rmse_m"
[parameters]
"controller.alpha1" = { values = [10.0, 20.0, 30.0] }
"""


def garbage(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 4)


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def other_types(path: Path) -> None:
    """Every value of another type."""
    if path.suffix == ".parquet":
        names = pq.read_table(path).column_names
        pq.write_table(pa.table({name: ["x", "y"] for name in names}), path)
    elif path.suffix == ".json":
        path.write_text(json.dumps({key: [{}] for key in json.loads(path.read_text())}))
    else:
        path.write_text("name = 3\n")


def other_keys(path: Path) -> None:
    if path.suffix == ".parquet":
        pq.write_table(pa.table({"theta99999999_rad": [0.0]}), path)
    else:
        path.write_text("[]" if path.suffix == ".json" else "[[x]]\n")


def not_utf8(path: Path) -> None:
    """The last column's name; the file is sound otherwise."""
    if path.suffix == ".parquet":
        name = pq.read_schema(path).names[-1].encode()
        path.write_bytes(path.read_bytes().replace(name, name[:-1] + b"\xa0"))
    else:
        path.write_bytes(b"\xa0")


def looped(path: Path) -> None:
    """A link to itself."""
    path.symlink_to(path)


DAMAGES = [garbage, truncated, emptied, other_types, other_keys, not_utf8]
Damage = Callable[[Path], None]


@pytest.fixture(scope="module")
def benched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    (folder / "pair.toml").write_text(SUITE)
    assert main(["bench", str(folder / "pair.toml"), "--out", str(folder / "out"), "--quiet"]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["row.json", *RUN_FILES])
@pytest.mark.parametrize("damage", DAMAGES)
def test_rescoring_names_damaged_rows_and_scores_the_others(
    damage: Damage, name: str, benched: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = sorted((benched / "out" / "runs").iterdir())
    before = {file: file.read_bytes() for file in rows[0].iterdir() if file.is_file()}
    damage(rows[0] / name)
    words = ["bench", str(benched / "pair.toml"), "--out", str(benched / "out"), "--rescore"]
    try:
        code = main([*words, "--quiet"])
        err = capsys.readouterr().err
        harmless = name == "manifest.json"  # of which only the version is shown
        assert code == (0 if harmless else 1)
        assert (rows[0].name in err) != harmless
        assert "Traceback" not in err
        assert rows[1].name in (benched / "out" / "leaderboard.md").read_text() or rows[1].exists()
    finally:
        for file, content in before.items():
            file.write_bytes(content)
    assert main([*words, "--quiet"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("row.json", "status", "foo"),
        ("row.json", "status", "failed"),  # with the verdict of a run that was finished
        ("row.json", "run", "ttwmr"),
        ("metrics.json", "status", "failed"),
        ("metrics.json", "control_time_per_sample_us", None),
        ("metrics.json", "control_time_per_sample_us", True),
        ("metrics.json", "control_time_per_sample_us", -5.0),
        ("metrics.json", "control_time_per_sample_us", float("nan")),
        pytest.param("metrics.json", "control_time_per_sample_us", 10**400, id="large"),
        ("trajectory.parquet", "ref_x_m", float("nan")),
        ("trajectory.parquet", "saturated", 2.0),
    ],
)
def test_rescoring_leaves_out_a_row_that_cannot_be_and_scores_the_others(
    name: str, key: str, value: object, benched: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = sorted((benched / "out" / "runs").iterdir())
    file = rows[0] / name
    before = file.read_bytes()
    if file.suffix == ".json":
        file.write_text(json.dumps(json.loads(before) | {key: value}))
    else:
        table = pq.read_table(file)
        place = table.schema.get_field_index(key)
        pq.write_table(table.set_column(place, key, pa.array([value] * len(table))), file)
    words = ["bench", str(benched / "pair.toml"), "--out", str(benched / "out"), "--rescore"]
    try:
        assert main([*words, "--quiet"]) == 1
        (told,) = (line for line in capsys.readouterr().err.splitlines() if rows[0].name in line)
        assert name in told
        board = pq.read_table(benched / "out" / "leaderboard.parquet").to_pylist()
        assert [row["controller"] for row in board] == ["tuned"]
    finally:
        file.write_bytes(before)


@pytest.mark.slow
def test_bench_runs_damaged_rows_again(benched: Path) -> None:
    rows = sorted((benched / "out" / "runs").iterdir())
    words = ["bench", str(benched / "pair.toml"), "--out", str(benched / "out"), "--quiet"]
    for name in ("row.json", "trajectory.parquet", "metrics.json", "made_of.json"):
        whole = Trajectory.read(rows[0] / "trajectory.parquet")
        kept = (rows[1] / "metrics.json").stat().st_mtime_ns
        truncated(rows[0] / name)
        assert main(words) == 0
        assert np.array_equal(Trajectory.read(rows[0] / "trajectory.parquet").q, whole.q)
        assert (rows[1] / "metrics.json").stat().st_mtime_ns == kept  # the other is used again


@pytest.mark.slow
@pytest.mark.parametrize("name", ["row.json", "made_of.json", "metrics.json"])
@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, looped])
def test_bench_makes_rows_again_whose_files_are_none(
    make: Callable[[Path], None], name: str, benched: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["bench", str(benched / "pair.toml"), "--out", str(benched / "out"), "--quiet"]
    row = sorted((benched / "out/runs").iterdir())[0]
    said = (row / "row.json").read_bytes()
    (row / name).unlink()
    make(row / name)
    rescored = main([*words, "--rescore"])
    assert rescored == (name != "made_of.json")
    assert "TypeError" not in capsys.readouterr().err
    assert main(words) == 0
    assert (row / name).is_file()
    assert (row / "row.json").read_bytes() == said


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_result_that_was_damaged_is_not_used_again(damage: Damage, tmp_path: Path) -> None:
    file = tmp_path / "result.json"
    file.write_text('{"result": 1}')
    kept = Kept({"code": {"a": "1"}}, tmp_path / "made_of.json", (file,))
    assert not kept.is_done
    kept.mark_done()
    assert kept.is_done
    damage(file)
    assert kept.changes() == ["files.result.json"]
    file.unlink()
    assert not kept.is_done
    damage(kept.mark)
    assert not kept.is_done


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_sweep_makes_damaged_parts_again(
    damage: Damage, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "three.toml").write_text(SWEEP)
    words = ["sweep", str(tmp_path / "three.toml"), "--out", str(tmp_path / "out"), "--chunk", "1"]
    assert main([*words, "--quiet"]) == 0
    table = (tmp_path / "out" / "results.parquet").read_bytes()
    shard = sorted((tmp_path / "out" / "shards").glob("*/*.parquet"))[1]
    (shard.parent / "notes.parquet").touch()  # a stranger's
    capsys.readouterr()
    for path in (shard, tmp_path / "out" / "results.parquet"):
        damage(path)
        assert main([*words, "--quiet"]) == 0
        assert f"{path}: damaged; it is made again" in capsys.readouterr().err
        assert (tmp_path / "out" / "results.parquet").read_bytes() == table
    damage(tmp_path / "out" / "plan.json")
    assert main([*words, "--quiet"]) == 2
    assert "plan.json: no plan that this version can read" in capsys.readouterr().err


@pytest.fixture(scope="module")
def a_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenario = tt.load_scenario("lab_circle", ["duration_s=1.0", "output.figures=false"])
    folder = tmp_path_factory.mktemp("run") / "out"
    tt.run(scenario, folder)
    return folder


@pytest.mark.parametrize("name", ["trajectory.parquet", "scenario.resolved.toml", "metrics.json"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_run_is_no_traceback(
    damage: Damage, name: str, a_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (a_run / name).read_bytes()
    said = (a_run / "metrics.json").read_bytes()
    damage(a_run / name)
    try:
        code = main(["score", str(a_run), "--quiet"])
        assert code == (0 if name == "metrics.json" else 2)
        film = str(a_run / "film.mp4")
        if name != "metrics.json":  # which no video looks at
            assert name in capsys.readouterr().err
            assert main(["video", str(a_run), "-o", film, "--quiet"]) == 2
            assert name in capsys.readouterr().err
            assert not Path(film).exists()
    finally:
        (a_run / name).write_bytes(before)
        (a_run / "metrics.json").write_bytes(said)


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo])
@pytest.mark.parametrize(
    ("name", "commands"),
    [
        ("scenario.resolved.toml", ("score", "video")),
        ("trajectory.parquet", ("score", "video")),
        ("metrics.json", ("score",)),
        ("run.rrd", ("view",)),
    ],
)
def test_what_is_no_file_in_a_run_folder_is_told_and_not_waited_for(
    make: Callable[[Path], None],
    name: str,
    commands: tuple[str, ...],
    a_run: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = (a_run / name).read_bytes()
    (a_run / name).unlink()
    make(a_run / name)
    told = "is a pipe or a device" if make is os.mkfifo else "is a folder"
    try:
        for command in commands:
            out = ["-o", f"{a_run}.mp4"] if command == "video" else []
            assert main([command, str(a_run), *out]) == 2
            assert f"{a_run / name}: {told}" in capsys.readouterr().err
    finally:
        remove(a_run / name)
        (a_run / name).write_bytes(before)


@pytest.mark.parametrize("damage", [garbage, truncated, emptied])
def test_a_damaged_recording_is_told(
    damage: Damage, a_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = a_run / "run.rrd"
    before = recording.read_bytes()
    damage(recording)
    film = tmp_path / "film.mp4"
    try:
        words = ["video", str(a_run), "-o", str(film), "--view", "overhead", "--quiet"]
        assert main(words) == 1
        assert "no forces" in capsys.readouterr().err
        assert film.stat().st_size > 1000  # the rest is shown
        if damage is not truncated:  # whose beginning is sound: the viewer shows what is left
            assert main(["view", str(a_run)]) == 2
            assert "no recording of Rerun, or a damaged one" in capsys.readouterr().err
    finally:
        recording.write_bytes(before)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"x_m": ["a", "b"]}, "its column x_m holds no numbers, but string"),
        ({"x_m": [0.0, None]}, "its column x_m is empty in 1 of 2 rows, the first of them row 1, "),
        ({"est_x_m": [0.0, -1e308]}, r"its column est_x_m holds -1e\+308"),
        ({"time_s": [0.0, 0.0]}, "its times do not increase"),
        ({"time_s": [0.0, float("nan")]}, "its times do not increase"),
        ({"time_s": [1.0, 0.5]}, "its times do not increase"),
        ({"est_valid": [None, True]}, "its column est_valid is empty in 1 of 2 rows"),
    ],
)
def test_a_table_that_is_no_trajectory_is_refused(
    change: dict[str, list[object]], told: str
) -> None:
    scenario = tt.load_scenario("lab_circle", ["plant.kind=analytic", "duration_s=0.033"])
    table = tt.simulate(scenario).trajectory.to_table()
    assert len(Trajectory.of_table(table, "a file")) == 2
    with pytest.raises(InputError, match="a file: not a trajectory: it has no rows"):
        Trajectory.of_table(table.slice(0, 0), "a file")
    for name, values in change.items():
        place = table.schema.get_field_index(name)
        table = table.set_column(place, name, pa.array(values))
    with pytest.raises(InputError, match=f"a file: not a trajectory: {told}"):
        Trajectory.of_table(table, "a file")
    with pytest.raises(InputError, match=r"a file: .* it lacks x_m, y_m, .* and others"):
        Trajectory.of_table(table.select(["time_s"]), "a file")
