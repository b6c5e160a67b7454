"""Laws of the user's in suites and sweeps: what cannot be loaded is refused before any run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from ttwmr_mj.cli.main import main

LAW = """
import os
import numpy as np
import ttwmr_mj as tt

class Straight(tt.Controller):
    def start(self, task):
        self.nsim = task.nsim
    def command(self, k, estimate):
        return self.plain(np.ones((self.nsim, 2)))

class Leaves(Straight):
    def __init__(self):
        os._exit(3)
"""
SCENARIO = """
name = "short"
duration_s = 0.2
plant.kind = "analytic"
reference = { kind = "circle", radius_m = 0.43, angular_rate_rad_s = 0.125, theta2 = "outward" }
"""
LAWS = {"absent": "absent:Law", "other": "mine:Other", "given": "mine:Straight", "bad": "bad:Law"}
SETS = {
    name: f"""'controller={{kind="custom", target="{law}"}}'""" for name, law in LAWS.items()
} | {"given": """'controller={kind="custom", target="mine:Straight", options={a=1}}'"""}
SAID = {
    "absent": "importing absent raised ModuleNotFoundError: No module named 'absent'; it must be",
    "other": "mine has no class Other that derives from ttwmr_mj.Controller",
    "given": "Straight(**controller.options) raised TypeError: Straight() takes no arguments",
    "bad": "importing bad raised ZeroDivisionError: of its own making",
}
SOUND = """'controller={kind="custom", target="mine:Straight"}'"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mine.py").write_text(LAW)
    (tmp_path / "bad.py").write_text("raise ZeroDivisionError('of its own making')")
    (tmp_path / "short.toml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(sets: dict[str, str]) -> None:
    told = "".join(f"[variants.{name}]\noverrides = [{text}]\n" for name, text in sets.items())
    Path("laws.toml").write_text(f'name = "laws"\nscenario = "short.toml"\n{told}')


def suite(sets: dict[str, str]) -> None:
    told = "".join(f"[controller.{name}]\noverrides = [{text}]\n" for name, text in sets.items())
    Path("laws.toml").write_text(f'name = "laws"\n[task.short]\nscenario = "short.toml"\n{told}')


@pytest.mark.slow
@pytest.mark.parametrize(("command", "write"), [("sweep", sweep), ("bench", suite)])
def test_laws_that_cannot_be_loaded_are_refused_all_at_once_and_as_run_does(
    command: str,
    write: Callable[[dict[str, str]], None],
    folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write(SETS | {"sound": SOUND})
    assert main([command, "laws.toml", "--out", "out", "--quiet"]) == 2
    told = capsys.readouterr().err
    for name, words in SAID.items():
        assert f"controller.target: got '{LAWS[name]}'; {words}" in told
    assert "sound" not in told
    assert not (folder / "out").exists()
    assert main(["run", "short.toml", "--set", SETS["other"][1:-1], "--out", "r"]) == 2
    assert f"controller.target: got 'mine:Other'; {SAID['other']}" in capsys.readouterr().err


@pytest.mark.slow
def test_a_law_that_ends_its_process_is_a_failure_of_its_run(folder: Path) -> None:
    sweep({"leaves": """'controller={kind="custom", target="mine:Leaves"}'""", "sound": SOUND})
    assert main(["sweep", "laws.toml", "--out", "out", "--quiet"]) == 0
    assert "the process ended with exit code 3" in (folder / "out" / "failed.csv").read_text()


@pytest.mark.slow
def test_how_long_a_sweep_takes_is_found_out_in_a_process_that_is_watched(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep({"leaves": """'controller={kind="custom", target="mine:Leaves"}'""", "sound": SOUND})
    assert main(["sweep", "laws.toml", "--dry-run"]) == 0  # and this process is still there
    assert "time: unknown" in capsys.readouterr().out
    sweep({"sound": SOUND})
    assert main(["sweep", "laws.toml", "--dry-run"]) == 0
    assert "time: about" in capsys.readouterr().out
    assert not (folder / "results").exists()
