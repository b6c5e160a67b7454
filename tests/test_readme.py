"""The README's code runs as it stands."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import ttwmr_mj
from ttwmr_mj.scenario.file import load_scenario

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.M | re.S)


def run_python(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_the_first_example_runs(tmp_path: Path) -> None:
    done = run_python(blocks("python")[0], tmp_path)
    assert done.returncode == 0, done.stderr
    *simulated, ran, deviation = done.stdout.splitlines()
    assert len(simulated) == 3
    assert all(line.startswith("ok 0.") for line in simulated)
    assert ran == "ok lyapunov_v_rate_eq36_1_s"
    assert 0.0 < float(deviation) < 1e-3


def test_the_examples_use_the_public_api_only() -> None:
    for code in blocks("python"):
        assert "from ttwmr_mj" not in code
        used = set(re.findall(r"\btt\.(\w+)", code))
        assert used <= set(ttwmr_mj.__all__)
        assert used


@pytest.mark.slow
def test_the_complete_scenario_is_followed_by_tractor_and_trailer(tmp_path: Path) -> None:
    """1.8 and 0.8 mm, as the page says."""
    (tmp_path / "inside_circle.toml").write_text(blocks("toml")[0])
    scenario = load_scenario(str(tmp_path / "inside_circle.toml"))
    result = ttwmr_mj.simulate(scenario)
    (metrics,) = ttwmr_mj.score(result.trajectory, scenario.robot)
    assert result.verdicts[0].name == "followed"
    assert metrics["steady_tractor_rmse_m"] == pytest.approx(1.8e-3, rel=0.1)
    assert metrics["steady_centre_of_oscillation_rmse_m"] == pytest.approx(0.8e-3, rel=0.1)


@pytest.mark.slow
def test_the_controller_example_works_in_under_40_lines(tmp_path: Path) -> None:
    controller = blocks("python")[1]
    assert len(controller.splitlines()) < 40
    (tmp_path / "chase.py").write_text(controller)
    (tmp_path / "chase.toml").write_text(blocks("toml")[1])
    command = [sys.executable, "-m", "ttwmr_mj", "run", "chase.toml", "--out", "out"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("followed: ")
    # as the page says: 0.02 mm, and the trailer is carried along within 7 mm
    for name, most_mm in (("P", 0.03), ("trailer's F", 7.5)):
        found = re.search(rf"{name}, rms error, 2nd half\s+([\d.]+) mm", done.stdout)
        assert found
        assert float(found.group(1)) < most_mm


def test_the_drawing_is_what_its_script_draws() -> None:
    drawn = runpy.run_path(str(ROOT / "docs" / "drawing.py"))["drawing"]()
    assert (ROOT / "docs" / "images" / "robot.svg").read_text(encoding="utf-8") == drawn


def test_bootstrap_knows_both_commands_and_names_them() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "bootstrap.py")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    for command in ("bootstrap.py run", "bootstrap.py test"):
        assert command in done.stdout
        assert command in README


def test_quick_tests_are_for_everyone_and_slow_ones_for_ci() -> None:
    """Between them they run every test once."""
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    bootstrap = runpy.run_path(str(ROOT / "bootstrap.py"))
    shared = ["-n", "2", "--dist", "loadfile"]  # a file's tests in one process, with its fixtures
    assert bootstrap["TEST"][-1][1:] == [*shared, "-m", "not slow"]
    assert "python3 bootstrap.py test\n" in ci
    slow = f".venv/bin/pytest {' '.join(shared)} -m slow"
    assert slow in ci
    assert slow in README
