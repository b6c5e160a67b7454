"""Suites: every row a real run that can be repeated, broken rows alone in their misfortune."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ttwmr_mj.cli.main import main

SUITE = """
name = "mine"
seeds = [0, 1]
timeout_s = 10.0

[controller.lyapunov]
overrides = ['controller={kind="lyapunov"}']

[controller.broken]
overrides = ['controller={kind="custom", target="misbehaving:Broken"}']

[controller.endless]
overrides = [
  'controller={kind="custom", target="misbehaving:Endless"}',
  "control.controller_time_limit_s=0.5",
]

[controller.stuck]
overrides = ['controller={kind="custom", target="misbehaving:Stuck"}']

[controller.away]
overrides = ['controller={kind="custom", target="misbehaving:Away"}']

[task.circle]
scenario = "mine.toml"
overrides = [
  "duration_s=2.0",
  "sensing.position_noise_m=0.001",
  "robot.servo.preset=fast",
  'initial={kind="on_reference"}',
]

[plant.analytic]
overrides = ["plant.kind=analytic"]

[[block]]
controller = ["lyapunov", "broken"]

[[block]]
controller = ["lyapunov", "endless", "stuck", "away"]
seeds = [0]
"""


def bench(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", "bench", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    (folder / "suite.toml").write_text(SUITE)
    (folder / "misbehaving.py").write_text((Path(__file__).parent / "misbehaving.py").read_text())
    (folder / "mine.toml").write_text(
        'name = "mine"\nduration_s = 2.0\n[reference]\nkind = "circle"\nradius_m = 0.43\n'
        'angular_rate_rad_s = 0.125\ntheta2 = "outward"\n[controller]\nkind = "lyapunov"\n'
    )
    done = bench("suite.toml", "--out", "out", "--workers", "2", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_failures_stay_alone_and_say_why(finished: Path) -> None:
    table = pq.read_table(finished / "out" / "leaderboard.parquet").to_pylist()
    lines = {line["controller"]: line for line in table}
    # the one that works is ranked first; its first seed stands in both blocks and is one run
    assert table[0]["controller"] == "lyapunov"
    assert (lines["lyapunov"]["failures"], lines["lyapunov"]["runs"]) == (0, 2)
    assert lines["lyapunov"]["P rms, mm"] > 0
    assert "ZeroDivisionError: of its own making" in lines["broken"]["reason"]
    assert (lines["broken"]["failures"], lines["broken"]["lost"]) == (2, 0)
    assert lines["broken"]["P rms, mm"] is None
    assert (
        "the controller timed out after 0.5 s at its sample at t = 0.099 s"
        in lines["endless"]["reason"]
    )
    assert "timed out after 10 s" in lines["stuck"]["reason"]
    assert lines["stuck"]["failures"] == 1
    # it came to its end, a metre away
    assert (lines["away"]["failures"], lines["away"]["lost"]) == (1, 1)
    assert lines["away"]["reason"].startswith("seed 0: lost: P 1")
    assert lines["broken"]["reason"].count("of its own making") == 2
    assert lines["away"]["verdict"] == "lost"
    row = json.loads((finished / "out/runs/away-circle-analytic-truth-none-0/row.json").read_text())
    assert (row["status"], row["verdict"]) == ("ok", "lost")
    assert lines["lyapunov"]["verdict"] == "followed"
    assert lines["stuck"]["verdict"] == "failed"
    assert lines["away"]["P rms, mm"] > 500
    page = (finished / "out" / "leaderboard.md").read_text()
    assert "7 of 7 rows run" in page
    assert "- away, seed 0: lost: P 1" in page
    assert "- analytic · truth · away: lost: P 1" in page
    assert "the law is not made" in page


@pytest.mark.slow
def test_every_row_names_a_manifest_and_a_command_that_repeats_it(finished: Path) -> None:
    page = (finished / "out" / "leaderboard.html").read_text()
    line = pq.read_table(finished / "out" / "leaderboard.parquet").to_pylist()[0]
    manifest = json.loads((finished / "out" / line["manifest"]).read_text())
    assert manifest["scenario"] == "mine"
    assert line["manifest"] in page
    words = shlex.split(line["command"])
    assert words[:2] == ["ttwmr", "run"]
    again = [sys.executable, "-m", "ttwmr_mj", *words[1:], "--out", "again"]
    again += ["--set", "output.figures=false", "--quiet"]
    assert subprocess.run(again, cwd=finished, check=False).returncode == 0
    stored = (finished / "out" / line["manifest"]).parent / "trajectory.parquet"
    assert (finished / "again" / "trajectory.parquet").read_bytes() == stored.read_bytes()


@pytest.mark.slow
def test_rescoring_simulates_nothing_and_finished_rows_are_reused(finished: Path) -> None:
    first = (finished / "out" / "leaderboard.md").read_text()
    (finished / "out" / "leaderboard.md").unlink()
    before = {path: path.stat().st_mtime_ns for path in finished.glob("out/runs/*/*")}
    for extra in (["--rescore"], []):
        done = bench("suite.toml", "--out", "out", *extra, cwd=finished)
        assert done.returncode == 0, done.stderr
        assert (finished / "out" / "leaderboard.md").read_text() == first
    assert {path: path.stat().st_mtime_ns for path in before} == before


@pytest.mark.slow
def test_rescoring_finds_the_runs_from_any_folder(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished / "out", tmp_path / "out")
    there = os.path.relpath(finished / "suite.toml", tmp_path)
    for suite, out in ((there, "out"), (str(finished / "suite.toml"), str(tmp_path / "out"))):
        done = bench(suite, "--out", out, "--rescore", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "7 of 7 rows run" in (tmp_path / "out" / "leaderboard.md").read_text()
    one_more = (finished / "suite.toml").read_text().replace("duration_s=2.0", "duration_s=2.1")
    (finished / "longer.toml").write_text(one_more)  # other runs, beside the same scenario
    done = bench(str(finished / "longer.toml"), "--out", "out", "--rescore", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("was run as `ttwmr run ")) == (1, 7)


@pytest.mark.slow
def test_a_stopped_suite_goes_on_where_it_was(finished: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in finished.glob("out/runs/*/row.json")}
    shutil.copytree(finished / "out", finished / "stopped", copy_function=shutil.copy2)
    (gone,) = (finished / "stopped" / "runs").glob("lyapunov-*-1")
    shutil.rmtree(gone)
    # and one of another law, as its module was once
    (stale,) = (finished / "stopped" / "runs").glob("away-*-0")
    made_of = json.loads((stale / "made_of.json").read_text())
    made_of["code"]["misbehaving"] = "0" * 16
    (stale / "made_of.json").write_text(json.dumps(made_of))
    command = [sys.executable, "-m", "ttwmr_mj", "bench", "suite.toml", "--out", "stopped"]
    process = subprocess.Popen([*command, "--workers", "1"], cwd=finished, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not (gone / "manifest.json").is_file() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 1
    done = bench("suite.toml", "--out", "stopped", cwd=finished)
    assert done.returncode == 0, done.stderr
    again = {path: path.stat().st_mtime_ns for path in finished.glob("stopped/runs/*/row.json")}
    changed = {path.parent.name for path in again if again[path] not in before.values()}
    assert changed == {gone.name, stale.name}
    for name in ("lyapunov-circle-analytic-truth-none-1", "away-circle-analytic-truth-none-0"):
        first, second = (
            finished / f / "runs" / name / "trajectory.parquet" for f in ("out", "stopped")
        )
        assert first.read_bytes() == second.read_bytes()


def test_rows_that_cannot_run_are_refused_before_any_is_started(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "a"\n[controller.x]\n[task.s]\nscenario = "lab_circle"\n'
        '[disturbance.wrong]\noverrides = ["plant.kind=wood"]\n[disturbance.right]\n'
    )
    done = bench("suite.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "1 row cannot run" in done.stderr
    assert "row x-s-contact-truth-wrong-0: " in done.stderr
    assert "plant.kind: got 'wood'; allowed: 'contact' or 'analytic'" in done.stderr
    assert not (tmp_path / "out" / "runs").exists()


def test_rescoring_an_empty_folder_is_refused(tmp_path: Path) -> None:
    done = bench("quick", "--out", "out", "--rescore", cwd=tmp_path)
    assert done.returncode == 2
    assert "no finished runs" in done.stderr


def test_a_folder_of_something_else_is_not_spread_into(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert main(["bench", "quick", "--out", str(tmp_path), "--quiet"]) == 2
    assert "the folder holds something, and no runs of a suite" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
