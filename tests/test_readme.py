"""The README's code runs as it stands."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import ttwmr_mj
from ttwmr_mj.cli.main import parse
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


@pytest.mark.parametrize("index", range(len(blocks("toml"))))
def test_scenario_examples_are_valid(index: int, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(blocks("toml")[index])
    load_scenario(str(tmp_path / "mine.toml"))


def test_the_controller_example_works_in_under_40_lines(tmp_path: Path) -> None:
    controller = blocks("python")[1]
    assert len(controller.splitlines()) < 40
    (tmp_path / "chase.py").write_text(controller)
    (tmp_path / "chase.toml").write_text(blocks("toml")[2])
    command = [sys.executable, "-m", "ttwmr_mj", "run", "chase.toml", "--out", "out"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # it does chase: within 0.1 m of a reference that moves at 54 mm/s, by gain 0.8 1/s
    final = re.search(r"P, final error\s+([\d.]+) mm", done.stdout)
    assert final
    assert float(final.group(1)) < 100.0


def test_every_command_line_in_the_readme_parses() -> None:
    lines = [line.split("#")[0].split() for block in blocks("sh") for line in block.splitlines()]
    commands = [words[1:] for words in lines if words[:1] == ["ttwmr"]]
    assert len(commands) >= 5
    for words in commands:
        parse(words)  # argparse leaves with SystemExit on what it does not know


def test_every_file_the_readme_links_exists() -> None:
    links = re.findall(r"\]\((?!http)([^)#]+)\)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


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
    assert bootstrap["TEST"][-1][1:] == ["-n", "2", "-m", "not slow"]
    assert "python3 bootstrap.py test\n" in ci
    slow = ".venv/bin/pytest -n 2 -m slow"
    assert slow in ci
    assert slow in README
