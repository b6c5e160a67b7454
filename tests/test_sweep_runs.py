"""`ttwmr sweep` as a person uses it: real processes, real files, killed and started again."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sweeps import SMALL, written
from ttwmr_mj.cli.main import main
from ttwmr_mj.studies.sweep.engine import NUMBERS

CONTACT = SMALL.replace('"plant.kind=analytic"', '"output.figures=false"')
LAW = """
import os, signal
import ttwmr_mj as tt
import numpy as np

class Crash(tt.Controller):
    def __init__(self, radius_m=0.0):
        self.radius_m = radius_m
    def start(self, task):
        self.nsim = task.nsim
        if self.radius_m == 0.4:
            os.kill(os.getpid(), signal.SIGSEGV)
        if self.radius_m == 0.5:
            raise tt.InputError("of no use")
    def command(self, k, estimate):
        return self.plain(np.ones((self.nsim, 2)))
"""


def start(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "ttwmr_mj", "sweep", *arguments]
    return subprocess.Popen(command, cwd=cwd, stderr=subprocess.PIPE, text=True)


def rows_of(folder: Path) -> list[dict[str, object]]:
    table: list[dict[str, object]] = pq.read_table(folder / "results.parquet").to_pylist()
    return table


def digest(folder: Path) -> str:
    return hashlib.sha256((folder / "results.parquet").read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of contact physics with its worst, median and failed rows recorded."""
    folder = tmp_path_factory.mktemp("sweep")
    path = written(folder, CONTACT)
    out = ["--out", str(folder / "out"), "--quiet"]
    assert main(["sweep", path, *out, "--workers", "2", "--record", "worst:1"]) == 0
    assert main(["sweep", path, *out, "--record", "median"]) == 0
    assert main(["sweep", path, *out, "--record", "failed:2"]) == 0
    return folder / "out"


@pytest.mark.slow
def test_every_row_is_there_with_its_values(finished: Path) -> None:
    rows = rows_of(finished)
    assert [row["row"] for row in rows] == list(range(12))
    assert [row["reference.radius_m"] for row in rows] == [0.3] * 4 + [0.4] * 4 + [0.5] * 4
    assert [row["variant"] for row in rows[:4]] == ["omitted"] * 2 + ["published"] * 2
    assert [row["seed"] for row in rows[:4]] == [0, 1, 0, 1]
    assert {row["status"] for row in rows} == {"ok"}
    assert len({row["scenario_digest"] for row in rows}) == 12
    assert (finished / "report.html").is_file()


@pytest.mark.slow
def test_a_row_is_the_run_of_its_scenario(finished: Path) -> None:
    """Bit for bit, however it was batched; of rows with noise and with other seeds."""
    rows = rows_of(finished)
    recorded = sorted((finished / "recorded").iterdir())
    assert len(recorded) >= 3
    for run in recorded:
        row = rows[int(run.name.removeprefix("row-"))]
        metrics = json.loads((run / "metrics.json").read_text())
        assert {name: row[name] for name in NUMBERS} == {name: metrics[name] for name in NUMBERS}
        assert [row["status"], row["verdict"]] == [metrics["status"], metrics["verdict"]]
        assert row["reason"] in (metrics["reason"], metrics["verdict_reason"])
        assert (run / "run.rrd").is_file()
        manifest = json.loads((run / "manifest.json").read_text())
        assert manifest["seed"] == row["seed"]
        sets = manifest["command_line"]
        assert f"reference.radius_m={row['reference.radius_m']}" in sets


@pytest.mark.slow
def test_every_metric_that_can_be_repeated_is_a_column(finished: Path) -> None:
    run = next((finished / "recorded").iterdir())
    numbers = json.loads((run / "metrics.json").read_text())
    of_this_machine = {
        "control_time_per_sample_us",
        "control_overruns",
        "control_slowest_s",
        "wall_time_s",
        "real_time_factor",
    }
    words = {"status", "reason", "verdict", "verdict_reason"}
    assert numbers.keys() - of_this_machine - words == set(NUMBERS)


@pytest.mark.slow
def test_what_is_recorded_is_what_was_meant(finished: Path) -> None:
    rows = rows_of(finished)
    metric = json.loads((finished / "plan.json").read_text())["headline_metric"]
    ranked = sorted(rows, key=lambda row: float(str(row[metric])))
    failed = [row["row"] for row in rows if row["verdict"] != "followed"][:2]
    meant = {ranked[-1]["row"], ranked[5]["row"], *failed}
    assert {int(p.name.removeprefix("row-")) for p in (finished / "recorded").iterdir()} == meant


@pytest.mark.slow
def test_a_finished_sweep_is_not_computed_again(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in finished.rglob("*.parquet")}
    assert main(["sweep", str(finished.parent / "mine.toml"), "--out", str(finished)]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("small: 12 runs, ")
    assert "12 of 12 runs" in err
    assert {path: path.stat().st_mtime_ns for path in finished.rglob("*.parquet")} == before


def test_a_dry_run_says_what_would_be_done_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", written(tmp_path, SMALL), "--dry-run"]) == 0
    told = capsys.readouterr().out
    assert "rows       12 = 3 draws × 2 variants × 2 seeds" in told
    assert "reference.radius_m: 0.3, 0.4, 0.5" in told
    assert "metric     steady_centre_of_oscillation_rmse_m" in told
    assert "time: about " in told
    assert "checked: all 12 rows, as seeds change nothing: 6 different ones" in told
    last = next(line for line in told.splitlines() if line.startswith("row 11: "))
    words = shlex.split(last.partition(": ")[2])
    assert words[:3] == ["ttwmr", "run", "lab_circle"]
    assert words[-2:] == ["--seed", "1"]
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_seeds_that_change_nothing_are_remarked_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still = written(tmp_path, SMALL.replace(', "sensing.position_noise_m=1e-3"', ""))
    assert main(["sweep", still, "--dry-run"]) == 0
    assert "warning: nothing in this scenario is random" in capsys.readouterr().err
    assert main(["sweep", written(tmp_path, SMALL), "--dry-run"]) == 0
    assert "warning" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_law_that_crashes_is_a_failed_row_and_takes_no_other_with_it(tmp_path: Path) -> None:
    (tmp_path / "crash.py").write_text(LAW)
    (tmp_path / "own.toml").write_text(
        'name = "own"\nduration_s = 0.2\n[plant]\nkind = "analytic"\n[reference]\nkind = "circle"\n'
        "radius_m = 0.43\nangular_rate_rad_s = 0.125\n[controller]\nkind = 'custom'\n"
        "target = 'crash:Crash'\n"
    )
    path = written(
        tmp_path,
        'name = "mine"\nscenario = "own.toml"\n[parameters]\n'
        '"controller.options.radius_m" = { values = [0.3, 0.4, 0.5, 0.6] }\n',
    )
    assert main(["sweep", path, "--out", str(tmp_path / "out"), "--chunk", "4", "--quiet"]) == 0
    good, crashed, refused, last = rows_of(tmp_path / "out")
    assert (good["status"], last["status"]) == ("ok", "ok")
    assert crashed["status"] == refused["status"] == "failed"
    assert crashed["reason"] == "the process ended with SIGSEGV"
    assert "of no use" in str(refused["reason"])


@pytest.mark.slow
def test_killed_at_any_moment_the_same_command_goes_on(tmp_path: Path) -> None:
    path = written(tmp_path, CONTACT.replace("0.4, 0.5]", "0.4, 0.5, 0.6]"))
    assert main(["sweep", path, "--out", str(tmp_path / "whole"), "--quiet"]) == 0
    arguments = (path, "--out", "out", "--quiet", "--chunk", "1", "--workers", "2")
    shards = tmp_path / "out" / "shards"
    counts = []
    for goal in (1, 5):
        sweep = start(*arguments, cwd=tmp_path)
        deadline = time.monotonic() + 600
        while len(list(shards.glob("*/*.parquet"))) < goal:
            assert time.monotonic() < deadline
            assert sweep.poll() is None
            time.sleep(0.01)
        sweep.kill()
        sweep.communicate()
        counts.append(len(list(shards.glob("*/*.parquet"))))
        assert not (tmp_path / "out" / "results.parquet").exists()
    before = {p: p.stat().st_mtime_ns for p in shards.glob("*/*.parquet")}
    sweep = start(*arguments, cwd=tmp_path)
    sweep.communicate(timeout=600)
    assert sweep.returncode == 0
    assert {p: p.stat().st_mtime_ns for p in before} == before  # nothing was computed twice
    assert len(list(shards.glob("*/*"))) == 16
    assert digest(tmp_path / "out") == digest(tmp_path / "whole")


@pytest.mark.slow
def test_ctrl_c_says_how_to_go_on(tmp_path: Path) -> None:
    path = written(tmp_path, CONTACT.replace("duration_s=0.4", "duration_s=4.0"))
    arguments = (path, "--out", "out", "--quiet", "--chunk", "1", "--workers", "1")
    sweep = start(*arguments, cwd=tmp_path)
    shards = tmp_path / "out" / "shards"
    deadline = time.monotonic() + 600
    while not list(shards.glob("*/*.parquet")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(sweep.pid, signal.SIGINT)
    _, said = sweep.communicate(timeout=300)
    assert sweep.returncode == 1
    assert f"stopped; what is done is kept in out. To go on: ttwmr sweep {path} --out out" in said
    assert "Traceback" not in said
    assert len(list(shards.glob("*/*.parquet"))) < 12


@pytest.mark.slow
def test_camera_rows_are_the_runs_of_their_scenarios(tmp_path: Path) -> None:
    text = SMALL.replace("lab_circle", "lab_circle_camera").replace(
        '"plant.kind=analytic", "sensing.position_noise_m=1e-3"', "'output.figures=false'"
    )
    path = written(tmp_path, text)
    out = ["--quiet", "--out"]
    assert main(["sweep", path, *out, str(tmp_path / "a"), "--record", "best:1"]) == 0
    assert main(["sweep", path, *out, str(tmp_path / "b"), "--chunk", "5", "--workers", "1"]) == 0
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    (run,) = (tmp_path / "a" / "recorded").iterdir()
    row = rows_of(tmp_path / "a")[int(run.name.removeprefix("row-"))]
    metrics = json.loads((run / "metrics.json").read_text())
    assert {name: row[name] for name in NUMBERS} == {name: metrics[name] for name in NUMBERS}
    assert row["estimator_position_rmse_m"] != 0.0


STOPPED_AT_A_START = """
import os, signal, sys, time
from multiprocessing import forkserver
from ttwmr_mj.cli.main import main

send, started = forkserver.reduction.sendfds, []

def after_ctrl_c(*given):  # at the second, for which the server listens
    started.append(given)
    if len(started) == 2:
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)
    return send(*given)

forkserver.reduction.sendfds = after_ctrl_c
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such server")
def test_ctrl_c_while_a_process_starts_is_no_traceback(tmp_path: Path) -> None:
    path = written(tmp_path, CONTACT)
    sweep = ["sweep", path, "--out", "out", "--quiet", "--chunk", "1", "--workers", "1"]
    words = [sys.executable, "-c", STOPPED_AT_A_START, *sweep]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "stopped; what is done is kept in out" in done.stderr
    assert "Traceback" not in done.stderr
