"""Laws and references are found by their files, and in packages that are installed beside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ttwmr_mj.controllers.base import CONTROLLERS
from ttwmr_mj.references.shared.reference import REFERENCES

PLUGIN = '''
"""A law that stands still, and a reference that spins on the spot of the origin."""

from pathlib import Path
from typing import Literal

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, ControllerOptions, Task
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.references.straight_line import StraightLine


class StillOptions(ControllerOptions):
    """Stands still."""

    kind: Literal["still"] = "still"
    brake: float = 1.0

    def make(self, folder: Path) -> Controller:
        return Still()

    def path_faults(self, reference: Reference, path: ReferencePath) -> list[Fault]:
        if self.brake > 0:
            return []
        return [Fault(key=("controller", "brake"), got=f"{self.brake:g}", allowed="above 0")]


class Still(Controller):
    def start(self, task: Task) -> None:
        self.nsim = task.nsim

    def command(self, k: int, estimate) -> Command:
        return self.plain(np.zeros((self.nsim, 2)))


class Slow(Reference):
    """A line at 1 mm/s."""

    kind: Literal["slow"] = "slow"

    def sample(self, time_s, robot):
        return StraightLine(speed_m_s=0.001).sample(time_s)
'''
SCENARIO = """
name = "plugged"
duration_s = 1.0
[plant]
kind = "analytic"
[output]
recording = false
figures = false
[reference]
kind = "slow"
[controller]
kind = "still"
"""


def install(folder: Path, controllers: str, references: str = "slow = plugin:Slow") -> None:
    """What pip leaves of a distribution: its module, and its entry points."""
    (folder / "plugin.py").write_text(PLUGIN)
    info = folder / "plugin-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin\nVersion: 1.0\n")
    points = f"[ttwmr_mj.controllers]\n{controllers}\n[ttwmr_mj.references]\n{references}\n"
    (info / "entry_points.txt").write_text(points)
    (folder / "plugged.toml").write_text(SCENARIO)


def ttwmr(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "ttwmr_mj", *words]
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.slow
def test_an_installed_package_adds_a_law_and_a_reference(tmp_path: Path) -> None:
    install(tmp_path, "still = plugin:StillOptions")
    done = ttwmr(tmp_path, "run", "plugged.toml", "--out", "out")
    assert done.returncode == 0, done.stderr
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    # it starts at (0.6, -0.3) and stays, while the reference moves by 1 mm
    assert metrics["tractor_final_error_m"] == pytest.approx((0.599**2 + 0.3**2) ** 0.5, abs=2e-5)
    assert "Stands still" in ttwmr(tmp_path, "list").stdout
    schema = json.loads(ttwmr(tmp_path, "export-schema").stdout)
    assert {"StillOptions", "Slow"} <= set(schema["$defs"])
    wrong = ttwmr(tmp_path, "validate", "plugged.toml", "--set", "controller.brake=-1.0")
    assert (wrong.returncode, wrong.stderr.strip().splitlines()[-1].strip()) == (
        2,
        "controller.brake: got -1; allowed: above 0",
    )


def test_every_kind_is_a_file_of_its_own() -> None:
    for registry in (CONTROLLERS, REFERENCES):
        modules = [cls.__module__ for cls in registry.values()]
        assert len(set(modules)) == len(modules) == len(registry)
        for cls in registry.values():
            assert 0 < len(cls.summary()) <= 70
