"""Rows that cannot be one motion of their scenario's robot are refused; what is odd but real, not.

How far real rows are from what is refused is told in `ttwmr_mj/scenario/stored/continuity.py`.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_folders import Columns, edit, made

from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.stored.run import StoredRun

POSE = ("x_m", "y_m", "theta1_rad", "theta2_rad")
NOISY = "sensing.position_noise_m=1e-3"  # where the law is not told the state as it is
START = r"\w+ is \S+ at 0 s, and \S+ where its scenario starts"
LAW = r"est_x_m is \S+ at 0\.\d+ s, and \S+ is the nearest that its scenario's sensing can tell"
RATES = r"\w+ is \S+ at 0\.\d+ s, and \S+ by its own rates"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """From rest to a circle: one that is told the state as it is, one that is not, and others."""
    folder, start = tmp_path_factory.mktemp("runs"), "initial.x_offset_m"
    made_with = {"exact": [], "noisy": [NOISY], "from elsewhere": [f"{start}=-0.03"]}
    for name, overrides in made_with.items():
        (folder / name).mkdir()
        made(folder / name, "outer_circle", *overrides)
    return {name: folder / name for name in made_with}


@pytest.fixture
def run(runs: dict[str, Path], tmp_path: Path) -> Callable[[str], Path]:
    return lambda name: shutil.copytree(runs[name], tmp_path / "run")


def poses(change: Callable[[Any, str], Any], first: int = 0) -> Callable[[Columns], Columns]:
    """Another pose from a row on."""

    def changed(columns: Columns) -> Columns:
        after = {name: columns[name].copy() for name in POSE}
        for name in POSE:
            after[name][first:] = change(columns, name)[first:]
        return columns | after

    return changed


SWAPPED = {"x_m": "y_m", "y_m": "x_m", "theta1_rad": "theta2_rad", "theta2_rad": "theta1_rad"}
CHANGES: dict[str, Callable[[Any, str], Any]] = {
    "of the reference": lambda c, name: c[f"ref_{name}"],
    "millimetres": lambda c, name: c[name] * (1e3 if name.endswith("_m") else 1.0),
    "degrees": lambda c, name: c[name] if name.endswith("_m") else np.degrees(c[name]),
    "x and y swapped": lambda c, name: c[SWAPPED[name] if name.endswith("_m") else name],
    "headings swapped": lambda c, name: c[name if name.endswith("_m") else SWAPPED[name]],
    "mirrored": lambda c, name: c[name] * (1.0 if name == "x_m" else -1.0),
    "shifted": lambda c, name: c[name] + (0.2 if name.endswith("_m") else 0.0),
}


@pytest.mark.parametrize("told", ["exact", "noisy"])
@pytest.mark.parametrize("change", CHANGES)
def test_other_poses_than_the_robots_are_refused(
    change: str, told: str, run: Callable[[str], Path]
) -> None:
    for first, expected in ((0, START), (1, RATES), (15, RATES)):
        if (change, first) == ("of the reference", 15):
            expected = LAW  # 34 mm, after half a second, may be what no row shows
        folder = run(told)
        edit(folder, poses(CHANGES[change], first))
        with pytest.raises(InputError, match=rf"run/trajectory\.parquet: its column {expected}"):
            StoredRun.read(folder)
        shutil.rmtree(folder)


@pytest.mark.parametrize("told", ["exact", "noisy"])
def test_rows_of_a_run_from_elsewhere_are_refused(
    told: str, run: Callable[[str], Path], runs: dict[str, Path]
) -> None:
    folder = run(told)
    shutil.copy(runs["from elsewhere"] / "trajectory.parquet", folder)
    with pytest.raises(InputError, match=f"its column {START}"):
        StoredRun.read(folder)


PUSH = "plant.pushes=[{{start_s=1.0, duration_s={duration}, force_n=[{force}, 20.0]}}]"


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("lab_circle", [PUSH.format(duration=0.1, force=-300.0), "duration_s=2.0"]),
        (
            "lab_circle",
            [
                PUSH.format(duration=0.5, force=20.0),
                "control.sampling_time_s=0.5",
                "duration_s=4.0",
            ],
        ),
        (
            "open_loop_turn",
            [
                PUSH.format(duration=1.0, force=30.0),
                "control.sampling_time_s=1.0",
                "duration_s=4.0",
            ],
        ),
        ("lab_circle", ["control.sampling_time_s=0.001", "duration_s=0.3"]),
        ("inverted_trailer_torque", ["duration_s=2.0"]),
        ("triple_inverted", ["plant.kind=analytic", "duration_s=1.0"]),
        ("outdoor_circle", ["duration_s=0.3"]),
    ],
    ids=["thrown", "pushed in a period", "in one of 1 s", "1 ms", "torque", "train", "terrain"],
)
def test_odd_motions_are_read(name: str, overrides: list[str], tmp_path: Path) -> None:
    made(tmp_path, name, *overrides)
    StoredRun.read(tmp_path)
    (tmp_path / "metrics.json").unlink()  # killed, for all that is known
    StoredRun.read(tmp_path)
