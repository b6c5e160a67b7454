"""Scripts that run scenarios in worker processes which were forked from one that did so, too."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import ttwmr_mj as tt

scenario = tt.load_scenario("SCENARIO", ["duration_s=0.33", "output.figures=false"])

def job(name):
    return tt.run(scenario, name).metrics["status"]

if __name__ == "__main__":
    kept = tt.run(scenario, "first")
    with ProcessPoolExecutor(2, multiprocessing.get_context("fork")) as pool:
        print(*pool.map(job, ["one", "other"]))
    print(kept.metrics["status"], job("last"))
"""


@pytest.mark.parametrize(
    "scenario", ["lab_circle", pytest.param("lab_circle_camera", marks=pytest.mark.slow)]
)
def test_workers_that_are_forked_after_a_run_record(scenario: str, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace("SCENARIO", scenario), encoding="utf-8")
    command = [sys.executable, str(script)]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout) == (0, "ok ok\nok ok\n"), done.stderr
    first = (tmp_path / "first" / "trajectory.parquet").read_bytes()
    for name in ("one", "other", "last"):
        assert (tmp_path / name / "trajectory.parquet").read_bytes() == first
        assert (tmp_path / name / "run.rrd").stat().st_size > 10_000
