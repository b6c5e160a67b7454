"""Suites on the engine: batches leave the files of lone runs, faults of the machine no trace."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ttwmr_mj.errors import InputError
from ttwmr_mj.files import read_json
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.runs.many import Placed, batches, run_into_folders, shareable
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.bench.execute import row_folder, run_suite, stored_row
from ttwmr_mj.studies.bench.overview import condition
from ttwmr_mj.studies.bench.scoring import collect
from ttwmr_mj.studies.bench.suite import load_suite, rows_of

LEAN = ["duration_s=0.5", "output.figures=false", "output.recording=false"]
NOISY = [*LEAN, "sensing.position_noise_m=0.001"]
TIMES = {
    "control_time_per_sample_us",
    "control_overruns",
    "control_slowest_s",
    "wall_time_s",
    "real_time_factor",
}
SUITE = """
name = "mine"
seeds = [0, 1, 2]
[controller.lyapunov]
overrides = ['controller={kind="lyapunov"}']
[controller.tvlqr]
overrides = ['controller={kind="tvlqr"}']
[task.circle]
scenario = "outer_circle"
overrides = ["duration_s=1.0"]
[plant.analytic]
overrides = ["plant.kind=analytic"]
[sensing.truth]
overrides = ["sensing.position_noise_m=0.001"]
[sensing.camera]
overrides = ["sensing.kind=camera", "sensing.preset=lab"]
[[block]]
sensing = ["truth"]
[[block]]
controller = ["tvlqr"]
sensing = ["camera"]
seeds = [0]
"""


def placed(scenario: Scenario, folder: Path) -> Placed:
    return Placed(scenario, folder, ("ttwmr", "run"), Path())


def test_runs_of_a_batch_leave_the_files_that_they_leave_alone(tmp_path: Path) -> None:
    rows = [
        load_scenario("lab_circle", [*NOISY, f"robot.trailer.mass_kg={mass}"], seed)
        for mass, seed in ((0.3, 1), (0.3, 2), (0.36, 1))
    ]
    (together,) = batches(
        [placed(row, tmp_path / "batch" / str(i)) for i, row in enumerate(rows)], 16
    )
    together[0].folder.mkdir(parents=True)
    (together[0].folder / "remains").touch()
    run_into_folders(together)
    for i, row in enumerate(rows):
        batch, alone = tmp_path / "batch" / str(i), tmp_path / "alone" / str(i)
        alone.mkdir(parents=True)
        run_scenario(row, alone, command_line=["ttwmr", "run"])
        assert sorted(p.name for p in batch.iterdir()) == sorted(p.name for p in alone.iterdir())
        for name in ("trajectory.parquet", "scenario.resolved.toml"):
            assert (batch / name).read_bytes() == (alone / name).read_bytes()
        ours, theirs = (json.loads((f / "metrics.json").read_text()) for f in (batch, alone))
        assert set(ours) == set(theirs)
        differing = {key for key in ours if ours[key] != theirs[key]}
        assert differing <= TIMES
        assert 0.0 < ours["wall_time_s"] < 60.0
        assert ours["control_time_per_sample_us"] > 0.0
        first, second = (json.loads((f / "manifest.json").read_text()) for f in (batch, alone))
        del first["created_utc"], second["created_utc"]
        assert first == second


@pytest.mark.parametrize(
    "change",
    [
        "output.figures=true",
        "output.recording=true",
        "output.paper_plots=true",
        "output.physics_rate=true",
        "sensing.kind=camera",
        'controller={kind="custom", target="mine:Mine"}',
    ],
)
def test_who_wants_more_than_numbers_runs_alone(change: str) -> None:
    assert shareable(load_scenario("lab_circle", LEAN))
    assert not shareable(load_scenario("lab_circle", [*LEAN, change]))


def test_batches_hold_what_can_share_one_and_not_too_much() -> None:
    base, law = load_scenario("lab_circle", LEAN), 'controller={kind="lyapunov_pid"}'
    other, drawn = (load_scenario("lab_circle", [*LEAN, x]) for x in (law, "output.figures=true"))
    runs = [placed(s, Path(str(i))) for i, s in enumerate([base, drawn, other, *[base] * 3, drawn])]
    names = [[run.folder.name for run in batch] for batch in batches(runs, 3)]
    assert names == [["0", "3", "4"], ["5"], ["1"], ["2"], ["6"]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "suite.toml").write_text(SUITE)
    (tmp_path / "out").mkdir()
    return tmp_path


def bench(folder: Path, **env: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", "bench", "suite.toml", "--out", "out", "--quiet"]
    return subprocess.run(
        command, cwd=folder, env={**os.environ, **env}, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_where_mujoco_cannot_start_nothing_is_run_and_nothing_said_of_the_laws(
    folder: Path,
) -> None:
    (folder / "broken").mkdir()
    (folder / "broken" / "mujoco.py").write_text("raise RuntimeError('this library is damaged')")
    paths = [str(folder / "broken"), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = bench(folder, PYTHONPATH=os.pathsep.join(paths))
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "ttwmr: 7 rows were not run, which is no fault of a law; the same command tries again:",
        "  lyapunov-circle-analytic-truth-none-0 and 6 more: "
        "RuntimeError: this library is damaged (mujoco.py:1)",
    ]
    assert not list(folder.glob("out/runs/*/row.json"))
    assert not (folder / "out" / "leaderboard.md").exists()


@pytest.mark.slow
def test_rows_without_opengl_are_not_run_and_the_next_call_runs_them(folder: Path) -> None:
    # MuJoCo itself starts with this one, and has no screen for it here
    without = {"MUJOCO_GL": "glfw", "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    done = bench(folder, **without)
    assert done.returncode == 1
    assert "1 row was not run, which is no fault of a law" in done.stderr
    assert "tvlqr-circle-analytic-camera-none-0: " in done.stderr
    assert "Traceback" not in done.stderr
    lines = pq.read_table(folder / "out" / "leaderboard.parquet").to_pylist()
    assert {(line["controller"], line["sensing"]) for line in lines} == {
        ("lyapunov", "truth"),
        ("tvlqr", "truth"),
    }
    assert [line["failures"] for line in lines] == [0, 0]
    assert "6 of 7 rows run" in (folder / "out" / "leaderboard.md").read_text()
    before = {p: p.stat().st_mtime_ns for p in folder.glob("out/runs/*/row.json")}
    assert len(before) == 6
    done = bench(folder)
    assert (done.returncode, done.stderr) == (0, "")
    after = {p: p.stat().st_mtime_ns for p in folder.glob("out/runs/*/row.json")}
    assert len(after) == 7
    assert before.items() <= after.items()


@pytest.mark.slow
def test_a_worker_that_is_killed_is_no_failure_of_its_row(folder: Path) -> None:
    suite = load_suite(str(folder / "suite.toml"))
    rows = [row for row in rows_of(suite) if row.names["sensing"] == "truth"]
    only = suite.model_copy(update={"block": suite.block[:1]})
    command = [sys.executable, "-m", "ttwmr_mj", "bench", "suite.toml", "--out", "out", "--quiet"]
    (folder / "suite.toml").write_text(SUITE.replace("duration_s=1.0", "duration_s=60.0"))
    process = subprocess.Popen(
        [*command, "--workers", "1"], cwd=folder, stderr=subprocess.PIPE, text=True
    )
    while process.poll() is None:
        for pid in workers_of(process.pid):
            os.kill(pid, signal.SIGKILL)
        time.sleep(0.05)
    _, told = process.communicate()
    assert process.returncode == 1
    assert "the process ended with SIGKILL" in told
    for row in rows:
        assert stored_row(row, folder / "out") is None
    (folder / "suite.toml").write_text(SUITE)
    assert run_suite(only, folder / "out", workers=1) == {}
    assert len(collect(only, folder / "out").lines) == 2


@pytest.mark.slow
def test_rows_that_timed_out_and_no_others_are_run_again_with_more_time(folder: Path) -> None:
    suite, out = load_suite(str(folder / "suite.toml")), folder / "out"
    only = suite.model_copy(update={"block": suite.block[:1], "seeds": [0]})
    mpc = only.controller["tvlqr"].model_copy(update={"overrides": ['controller={kind="mpc"}']})
    more = only.model_copy(update={"controller": {**only.controller, "mpc": mpc}})
    assert run_suite(only, out) == {}
    assert run_suite(more.model_copy(update={"timeout_s": 1e-3}), out) == {}

    def told() -> dict[str, str]:
        return {p.parent.name[:5]: read_json(p)["reason"] for p in out.glob("runs/*/row.json")}

    late = {"lyapu": "", "tvlqr": "", "mpc-c": "timed out after 0.001 s"}
    made = {path: path.stat().st_mtime_ns for path in out.glob("runs/*/trajectory.parquet")}
    assert run_suite(more.model_copy(update={"timeout_s": 1e-4}), out) == {}
    assert told() == late
    assert run_suite(more, out) == {}
    assert told() == late | {"mpc-c": ""}
    assert {path: path.stat().st_mtime_ns for path in made} == made


def workers_of(caller: int) -> list[int]:
    """Processes of a call's pool that are at a job: in a session of their own."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
            environ = stat.with_name("environ").read_bytes()
        except OSError:
            continue
        pid, parent, session = int(stat.parent.name), int(words[1]), int(words[3])
        if session == pid and parent in children_of(caller) and environ:
            found.append(pid)
    return found


def children_of(caller: int) -> set[int]:
    tasks = Path(f"/proc/{caller}/task/{caller}/children")
    return set(map(int, tasks.read_text().split())) if tasks.is_file() else set()


def test_a_second_bench_on_the_folder_is_refused(folder: Path) -> None:
    suite = load_suite(str(folder / "suite.toml"))
    with locked(folder / "out"), pytest.raises(InputError, match="this process fills"):
        run_suite(suite, folder / "out", workers=1)
    assert not (folder / "out" / "runs").exists()


@pytest.mark.slow
def test_scoring_leaves_out_rows_that_are_run_again_meanwhile_or_incomplete(folder: Path) -> None:
    suite = load_suite(str(folder / "suite.toml"))
    suite = suite.model_copy(update={"block": suite.block[:1]})
    out = folder / "out"
    assert run_suite(suite, out, workers=1) == {}
    first, second, third, *_ = rows_of(suite)
    (row_folder(first, out) / "row.json").unlink()
    lost = row_folder(second, out) / "trajectory.parquet"
    lost.unlink()
    board = collect(suite, out)
    assert [len(line.runs) for line in board.lines] == [3, 1]
    ended = f"{lost}: is missing, and row.json says that the run ended"
    assert board.damaged == {second.key: ended}
    (row_folder(third, out) / "trajectory.parquet").write_bytes(b"damaged")
    board = collect(suite, out)
    assert list(board.damaged) == [second.key, third.key]
    assert "trajectory.parquet" in board.damaged[third.key]
    assert sum(len(line.runs) for line in board.lines) == 3


@pytest.mark.slow
def test_where_a_suite_names_no_plant_and_no_sensor_lines_say_what_was_run(tmp_path: Path) -> None:
    text = """
name = "mine"
[controller.lyapunov]
[controller.elsewhere]
overrides = ["plant.kind=analytic"]
[task.circle]
scenario = "lab_circle"
overrides = ["duration_s=0.3"]
[task.seen]
scenario = "lab_circle_camera"
overrides = ["duration_s=0.3"]
skip = ["elsewhere"]
"""
    (tmp_path / "suite.toml").write_text(text)
    suite = load_suite(str(tmp_path / "suite.toml"))
    assert run_suite(suite, tmp_path / "out") == {}
    lines = collect(suite, tmp_path / "out").lines
    assert sorted((*x.names.values(), condition(x)) for x in lines) == [
        ("elsewhere", "circle", "analytic", "truth", "none", "analytic · truth"),
        ("lyapunov", "circle", "contact", "truth", "none", "contact · truth"),
        ("lyapunov", "seen", "contact", "camera", "none", "contact · camera"),
    ]
