"""A trajectory that grows is readable whenever its writer ends, and what it scores to is told."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.metrics import METRICS
from ttwmr_mj.results.metrics_file import MEASURED
from ttwmr_mj.results.row_stream import ROWS_FILE, RowStream, read_rows, read_run
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.files.folder import write_resolved
from ttwmr_mj.runs.files.lock import locked

QUIET = ["plant.kind=analytic", "output.recording=false", "output.figures=false"]


@pytest.fixture(scope="module")
def rows() -> Trajectory:
    scenario = tt.load_scenario("lab_circle", ["plant.kind=analytic", "duration_s=2.0"])
    return tt.simulate(scenario).trajectory


def same(a: Trajectory, b: Trajectory) -> bool:
    """In every column, bit for bit."""
    table, other = a.to_columns(), b.to_columns()
    return list(table) == list(other) and all(
        np.array_equal(table[name], other[name], equal_nan=True) for name in table
    )


def grown(path: Path, rows: Trajectory) -> list[int]:
    """Write rows in three pieces; the file's size after each."""
    stream, sizes = RowStream(path), []
    for start, stop in ((0, 20), (20, 21), (21, len(rows)), (len(rows), len(rows))):
        stream.append(rows.rows(start, stop))
        sizes.append(path.stat().st_size)
    stream.close()
    stream.close()
    return sizes


def test_what_was_appended_is_read_bit_for_bit(rows: Trajectory, tmp_path: Path) -> None:
    assert rows.signals  # the law's are there too
    sizes = grown(tmp_path / ROWS_FILE, rows)
    assert sizes == sorted(sizes)
    assert sizes[-1] == sizes[-2]
    assert same(read_rows(tmp_path / ROWS_FILE), rows)
    assert same(read_run(tmp_path), rows)
    pq.write_table(rows.rows(0, 5).to_table(), tmp_path / "trajectory.parquet")
    assert len(read_run(tmp_path)) == 5  # what is complete comes first


def test_a_torn_end_costs_the_last_piece_and_no_more(rows: Trajectory, tmp_path: Path) -> None:
    first, second, third, _ = grown(tmp_path / "whole", rows)
    content = (tmp_path / "whole").read_bytes()
    for end, left in ((first, 20), (second - 1, 20), (second, 21), (third - 1, 21), (third, 61)):
        (tmp_path / "torn").write_bytes(content[:end])
        assert same(read_rows(tmp_path / "torn"), rows.rows(0, left))
    for end in (0, 1, 100, first - 1):
        (tmp_path / "torn").write_bytes(content[:end])
        with pytest.raises(InputError, match="torn: "):
            read_rows(tmp_path / "torn")


def test_no_rows_no_file(rows: Trajectory, tmp_path: Path) -> None:
    stream = RowStream(tmp_path / ROWS_FILE)
    stream.append(rows.rows(3, 3))
    stream.delete()
    assert list(tmp_path.iterdir()) == []
    stream.append(rows)
    stream.delete()
    assert list(tmp_path.iterdir()) == []


def test_rows_on_a_full_disk_are_an_error_of_the_system(rows: Trajectory) -> None:
    stream = RowStream(Path("/dev/full"))
    with pytest.raises(OSError, match="No space left on device"):
        stream.append(rows)
    stream.close()


@pytest.fixture
def run(tmp_path: Path) -> Path:
    scenario = tt.load_scenario("lab_circle", [*QUIET, "duration_s=2.0"])
    tt.run(scenario, tmp_path / "run")
    return tmp_path / "run"


def test_a_run_scores_to_what_it_said(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = (run / "metrics.json").read_bytes()
    assert not (run / ROWS_FILE).exists()
    assert main(["score", str(run)]) == 0
    assert (run / "metrics.json").read_bytes() == said
    assert json.loads(said)["verdict_reason"] in capsys.readouterr().out
    assert main(["score", "--quiet", str(run)]) == 0
    assert capsys.readouterr().out == f"{run}\n"


@pytest.mark.parametrize(
    "damage", [None, b"", b"[1]", b'{"status": "ok"}', b'{"status": 3}', b"\xff"]
)
def test_a_run_without_sound_metrics_scores_to_what_its_rows_tell(
    damage: bytes | None, run: Path
) -> None:
    metrics = run / "metrics.json"
    said = json.loads(metrics.read_text())
    metrics.unlink() if damage is None else metrics.write_bytes(damage)
    assert main(["score", "--quiet", str(run)]) == 0
    assert json.loads(metrics.read_text()) == said | dict.fromkeys(MEASURED)


def test_a_run_that_was_killed_says_so(run: Path) -> None:
    rows = Trajectory.read(run / "trajectory.parquet")
    grown(run / ROWS_FILE, rows.rows(0, 30))
    (run / "trajectory.parquet").unlink()
    (run / "metrics.json").unlink()
    with locked(run):  # it still goes on
        assert main(["score", str(run)]) == 2
    assert main(["score", "--quiet", str(run)]) == 0
    told = json.loads((run / "metrics.json").read_text())
    assert (told["status"], told["verdict"]) == ("killed", "killed")
    assert told["reason"] == "its process was killed before 2 s"
    assert told["end_time_s"] == rows.time_s[29]
    scenario = tt.load_scenario(str(run / "scenario.resolved.toml"))
    (numbers,) = tt.score(rows.rows(0, 30), scenario.robot)
    assert {name: told[name] for name in METRICS} == numbers
    assert same(Trajectory.read(run / "trajectory.parquet"), rows.rows(0, 30))
    assert not (run / ROWS_FILE).exists()
    again = (run / "metrics.json").read_bytes()
    assert main(["score", "--quiet", str(run)]) == 0
    assert (run / "metrics.json").read_bytes() == again


def test_what_is_no_run_is_not_scored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", str(tmp_path)]) == 2
    assert "no run folder" in capsys.readouterr().err
    scenario = tt.load_scenario("lab_circle")
    write_resolved(tmp_path, scenario, tmp_path)
    assert main(["score", str(tmp_path)]) == 2
    assert "there is no trajectory.parquet and no trajectory.arrows" in capsys.readouterr().err


@pytest.mark.slow
def test_kill_9_loses_no_row_that_was_reported(tmp_path: Path) -> None:
    words = ["run", "lab_circle", "--out", "out", "--set", "duration_s=3600.0"]
    process = subprocess.Popen(
        [sys.executable, "-m", "ttwmr_mj", *words, "--set", "output.recording=false"],
        cwd=tmp_path,
        stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    with process:
        rows, deadline = 0, time.monotonic() + 60
        while not rows:  # who looks on reads it while it grows
            assert time.monotonic() < deadline
            time.sleep(0.1)
            with suppress(InputError):  # there is no file yet, or nothing in it
                rows = len(read_rows(tmp_path / "out" / ROWS_FILE))
        process.send_signal(signal.SIGKILL)
    assert main(["score", "--quiet", str(tmp_path / "out")]) == 0
    told = json.loads((tmp_path / "out" / "metrics.json").read_text())
    left = Trajectory.read(tmp_path / "out" / "trajectory.parquet")
    assert told["status"] == "killed"
    assert len(left) >= rows
    assert told["end_time_s"] == left.time_s[-1]
    assert np.isfinite(left.wheel_command_rad_s).all()  # whole rows
    assert [path.name for path in (tmp_path / "out").glob("*.part")] == []
