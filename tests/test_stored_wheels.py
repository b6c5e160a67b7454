"""Wheels that do not go with their commands, servos and robot are refused; what is odd, not."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from run_folders import Columns, edit, made

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.stored.run import StoredRun

COMMANDS = ("wheel_right_cmd_rad_s", "wheel_left_cmd_rad_s")
SPEEDS = ("wheel_right_rad_s", "wheel_left_rad_s")
ANALYTIC = "plant.kind=analytic"
EXTENDED = "plant.analytic.extended={wheel_radius_m=0.025, track_width_m=0.12}"
RUNS = {
    "contact": ("lab_circle",),
    "analytic": ("lab_circle", ANALYTIC),
    "extended": ("lab_circle", ANALYTIC, EXTENDED),
    "torques": ("inverted_trailer_torque",),
    "torques without slip": ("inverted_trailer_torque", ANALYTIC),
}
LIMIT = r"cmd_rad_s is \S+ at \S+ s, and 6\.5 is its servo's limit, though its column saturated"
MOST = r"rad_s is \S+ at \S+ s, and \S+ is more than its servo and its motion allow"
ROLLS = r"rad_s is \S+ at \S+ s, and \S+ where its wheel rolls as its body moves"
OBEYS = r"rad_s is \S+ at \S+ s, and \S+ by its servo's commands"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("runs")
    for name, given in RUNS.items():
        (folder / name).mkdir()
        made(folder / name, *given, "duration_s=0.5")
    return {name: folder / name for name in RUNS}


@pytest.fixture
def run(runs: dict[str, Path], tmp_path: Path) -> Callable[[str], Path]:
    return lambda name: shutil.copytree(runs[name], tmp_path / "run")


def times(factor: float, *names: str, first: int = 0, last: int = 99) -> Any:
    def changed(columns: Columns) -> Columns:
        for name in names:
            columns[name][first:last] *= factor
        return columns

    return changed


CHANGES = [
    ("contact", times(57.3, *COMMANDS, *SPEEDS), LIMIT),
    ("contact", times(57.3, *COMMANDS), LIMIT),
    ("contact", times(57.3, *SPEEDS), MOST),
    ("contact", times(1e3, *SPEEDS, first=9, last=10), MOST),
    ("contact", times(0.1, *SPEEDS), ROLLS),
    ("contact", times(-1.0, *SPEEDS), ROLLS),
    ("analytic", times(57.3, *COMMANDS), LIMIT),
    ("analytic", times(1.001, *SPEEDS, first=9, last=10), ROLLS),
    ("analytic", times(0.1, *COMMANDS), OBEYS),
    ("extended", times(57.3, *COMMANDS, *SPEEDS), LIMIT),
    ("extended", times(1.001, *SPEEDS, first=9, last=10), OBEYS),
    ("torques", times(57.3, *SPEEDS), ROLLS),
    ("torques", times(0.1, *SPEEDS), ROLLS),
    ("torques without slip", times(1.001, *SPEEDS, first=9, last=10), ROLLS),
]


@pytest.mark.parametrize(("name", "change", "told"), CHANGES)
def test_other_wheel_speeds_than_the_robots_are_refused(
    name: str, change: Callable[[Columns], Columns], told: str, run: Callable[[str], Path]
) -> None:
    folder = run(name)
    StoredRun.read(folder)
    edit(folder, change)
    before = (folder / "metrics.json").read_bytes()
    with pytest.raises(InputError, match=rf"run/trajectory\.parquet: its column wheel_\w+_{told}"):
        StoredRun.read(folder)
    assert main(["score", str(folder), "--quiet"]) == 2
    assert (folder / "metrics.json").read_bytes() == before


PUSH = "plant.pushes=[{{start_s=0.2, duration_s=0.15, force_n=[{}, 20.0]}}]"
ICE = "plant.contact.floor_friction={}"


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        # sliding, a tyre touches the floor at every other step: many a row tells no slip
        ("inverted_trailer", [ICE.format(0.05)]),
        ("sim_circle", [ICE.format(0.01)]),
        ("inverted_trailer_torque", [ICE.format(0.01)]),
        ("lab_circle", [PUSH.format(-300.0)]),
        ("lab_circle_motor", [PUSH.format(15.0)]),
        ("inverted_trailer_torque", [PUSH.format(60.0)]),
        # downhill at forty times the servo's speed, which is too weak to brake
        ("straight_line", ["ground.slope_rad=0.5", "robot.servo.stall_torque_n_m=0.02"]),
        ("lab_circle", ['robot.servo.motor={preset="fast"}']),
        ("lab_circle", ["robot.tractor.wheel_radius_difference_m=0.002", ANALYTIC]),
        ("sim_circle", ["robot.servo.speed_limit_rad_s=3.0", ANALYTIC]),
        ("lab_circle", ["control.command_latency_s=0.05", ANALYTIC]),
        ("lab_circle", ["control.command_drop_probability=0.3", ANALYTIC]),
        ("two_trailers_turn", [ANALYTIC, EXTENDED]),
    ],
)
def test_odd_wheel_speeds_are_read(name: str, overrides: list[str], tmp_path: Path) -> None:
    made(tmp_path, name, *overrides)
    StoredRun.read(tmp_path)
    (tmp_path / "metrics.json").unlink()  # killed, for all that is known
    StoredRun.read(tmp_path)
