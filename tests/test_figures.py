from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from ttwmr_mj.figures.run import write_run_figures
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters

NAMES = ("paths", "x", "y", "theta1", "theta2", "wheel_speeds", "errors", "hitch_angle")
ROBOT = RobotParameters()
WIDTH_PX = 720  # 4.8 in at 150 dpi


@pytest.fixture(scope="module")
def run() -> Trajectory:
    """A run that comes to a circle from 20 mm and 0.1 rad beside it."""
    time_s = 0.033 * np.arange(300)
    circle = Circle(radius_m=0.43, angular_rate_rad_s=0.125, theta2="outward").sample(time_s)
    rows = Trajectory.empty(time_s, 1)
    rows.ref_q[:] = circle.q
    rows.q[:] = circle.q + np.exp(-time_s)[:, None, None] * [0.02, 0.0, -0.1, -1.0]
    rows.wheel_command_rad_s[:] = 2.35, 1.78
    rows.wheel_speed_rad_s[:] = rows.wheel_command_rad_s * (1 - np.exp(-5 * time_s))[:, None, None]
    return rows


@pytest.fixture(scope="module")
def folder(run: Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "figures"
    written = write_run_figures(run, ROBOT, folder, "circle & <seed 7>")
    assert sorted(written) == sorted(folder.iterdir())  # and no drafts left behind
    return folder


def test_every_figure_is_there_twice(folder: Path) -> None:
    expected = {f"{name}.{ending}" for name in NAMES for ending in ("png", "svg")}
    assert {path.name for path in folder.iterdir()} == expected


@pytest.mark.parametrize("name", NAMES)
def test_pictures_show_something(folder: Path, name: str) -> None:
    picture = cv2.imread(str(folder / f"{name}.png"))
    height, width, _ = picture.shape
    assert width == WIDTH_PX
    assert 400 < height < 800
    assert (picture[0, 0] == 255).all()
    saturation = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)[:, :, 1]
    assert (saturation > 100).sum() > 500  # coloured curves, beside grey grid and black text


@pytest.mark.parametrize("name", NAMES)
def test_drawings_keep_their_text(folder: Path, name: str) -> None:
    root = ET.parse(folder / f"{name}.svg").getroot()
    assert root.tag.endswith("svg")
    texts = ["".join(element.itertext()) for element in root.iter() if element.tag.endswith("text")]
    assert "circle & <seed 7>" in texts
    assert any("[" in text for text in texts), "no unit in any label"


def test_same_trajectory_same_bytes(folder: Path, run: Trajectory, tmp_path: Path) -> None:
    for path in write_run_figures(run, ROBOT, tmp_path, "circle & <seed 7>"):
        assert path.read_bytes() == (folder / path.name).read_bytes(), path.name


def texts(path: Path) -> str:
    return " ".join(ET.parse(path).getroot().itertext())


def test_an_undefined_reference_is_not_drawn(folder: Path, run: Trajectory, tmp_path: Path) -> None:
    ref_q = run.ref_q.copy()
    ref_q[..., 3] = np.nan
    write_run_figures(replace(run, ref_q=ref_q), ROBOT, tmp_path, "circle")
    assert "reference" in texts(folder / "theta2.svg")
    assert "reference" not in texts(tmp_path / "theta2.svg")
    assert "trailer COM" in texts(folder / "errors.svg")
    assert "trailer COM" not in texts(tmp_path / "errors.svg")


def test_a_run_without_reference_says_so(run: Trajectory, tmp_path: Path) -> None:
    rows = replace(run, ref_q=np.full_like(run.ref_q, np.nan))
    write_run_figures(rows, ROBOT, tmp_path, "free")
    assert "no reference" in texts(tmp_path / "errors.svg")


def test_a_failed_figure_leaves_no_file(
    run: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure

    def half_written(self: Figure, path: Path, **options: object) -> None:
        del self, options
        path.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", half_written)
    with pytest.raises(OSError, match="disk full"):
        write_run_figures(run, ROBOT, tmp_path, "circle")
    assert not list(tmp_path.iterdir())


def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = "import sys, ttwmr_mj.figures.run; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
