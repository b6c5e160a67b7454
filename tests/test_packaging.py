"""The built wheel works alone: models and scenarios inside, from any folder."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.slow
def test_the_wheel_alone_runs_a_shipped_scenario(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    for needed in ("models/ttwmr.xml", "models/scene.xml", "scenarios/lab_circle.toml"):
        assert f"ttwmr_mj/_data/{needed}" in names
    assert "ttwmr_mj/py.typed" in names
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    zipfile.ZipFile(wheel).extractall(site)
    elsewhere.mkdir()
    # -P and PYTHONPATH: the wheel's package comes first, before the checkout of this test
    command = [sys.executable, "-P", "-m", "ttwmr_mj", "run", "lab_circle", "--out", "out"]
    command += ["--set", "duration_s=1.0"]
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        command, cwd=elsewhere, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (elsewhere / "out" / "run.rrd").stat().st_size > 100_000
    where = subprocess.run(
        [sys.executable, "-P", "-c", "import ttwmr_mj; print(ttwmr_mj.__file__)"],
        cwd=elsewhere,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(where.stdout.strip()).is_relative_to(site)
