from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from drawn import drawn, labels
from trajectories_of_figures import ROBOT, circle_run

from ttwmr_mj.errors import InputError
from ttwmr_mj.figures.canvas import canvas, panel_grid
from ttwmr_mj.figures.run import write_run_figures
from ttwmr_mj.results.trajectory import Trajectory

NAMES = ("paths", "x", "y", "theta1", "theta2", "wheel_speeds", "errors", "hitch_angle")
WIDTH_PX = 720  # 4.8 in at 150 dpi


@pytest.fixture(scope="module")
def run() -> Trajectory:
    return circle_run()


@pytest.fixture(scope="module")
def folder(run: Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "figures"
    written = write_run_figures(run, ROBOT, folder, "circle & <seed 7>")
    assert sorted(written) == sorted(folder.iterdir())  # and no drafts left behind
    return folder


class Logged(NamedTuple):
    """Figures of the same run, whose law logged v and 2·v, and the curves in them."""

    folder: Path
    curves: dict[str, dict[str, tuple[list, list]]]
    v: np.ndarray


@pytest.fixture(scope="module")
def logged(run: Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Logged:
    folder, v = tmp_path_factory.mktemp("logged"), np.exp(-run.time_s)
    rows = replace(run, signals={"lyapunov_v": v[:, None], "gain": 2.0 * v[:, None]})
    with pytest.MonkeyPatch.context() as patch:
        curves = drawn(patch)
        write_run_figures(rows, ROBOT, folder, "circle & <seed 7>")
    return Logged(folder, curves, v)


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


@pytest.mark.slow
def test_same_trajectory_same_bytes(folder: Path, logged: Logged) -> None:
    for path in folder.iterdir():
        assert path.read_bytes() == (logged.folder / path.name).read_bytes(), path.name


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


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("paths", ["x [m]", "y [m]", "P (tractor)", "COM of the trailer", "references"]),
        ("x", ["time [s]", "x of P [m]", "true", "reference"]),
        ("y", ["time [s]", "y of P [m]"]),
        ("theta1", ["θ1 of the tractor [rad]"]),
        ("theta2", ["θ2 of the trailer [rad]"]),
        ("wheel_speeds", ["wheel speed [rad/s]", "right, commanded", "left, real"]),
        ("errors", ["time [s]", "P error", "[mm]", "θ1 error", "[°]", "trailer COM", "error [mm]"]),
        ("hitch_angle", ["hitch angle θ2 − θ1 [°]"]),
    ],
)
def test_axes_and_curves_are_named(folder: Path, name: str, expected: list[str]) -> None:
    assert set(expected) <= set(labels(folder / f"{name}.svg"))


def test_curves_are_the_run(run: Trajectory, logged: Logged) -> None:
    curves = logged.curves
    time_s, q, ref_q = run.time_s.tolist(), run.q[:, 0], run.ref_q[:, 0]
    for name, i in (("x", 0), ("y", 1), ("theta1", 2), ("theta2", 3)):
        assert curves[name] == {
            "true": (time_s, q[:, i].tolist()),
            "reference": (time_s, ref_q[:, i].tolist()),
        }
    com = q[:, :2] - ROBOT.trailer.com_offset_m * np.array([np.cos(q[:, 3]), np.sin(q[:, 3])]).T
    np.testing.assert_allclose(curves["paths"]["P (tractor)"], q[:, :2].T)
    np.testing.assert_allclose(curves["paths"]["COM of the trailer"], com.T)
    wheels = curves["wheel_speeds"]
    assert wheels["right, commanded"] == (time_s, run.wheel_command_rad_s[:, 0, 0].tolist())
    assert wheels["left, real"] == (time_s, run.wheel_speed_rad_s[:, 0, 1].tolist())
    miss = np.hypot(*(q - ref_q)[:, :2].T)
    np.testing.assert_allclose(curves["errors"]["P error\n[mm] _child0"][1], 1e3 * miss)
    # 0.1 rad to the right at first, at 57.3° per rad
    turned = curves["errors"]["θ1 error\n[°] _child0"][1]
    assert turned[0] == pytest.approx(-0.1 * 180 / np.pi)
    hitch = curves["hitch_angle"]["hitch angle θ2 − θ1 [°] _child0"][1]
    np.testing.assert_allclose(hitch, np.degrees(q[:, 3] - q[:, 2]))


def test_signals_of_the_law_get_a_figure(run: Trajectory, logged: Logged) -> None:
    names = {path.name for path in logged.folder.glob("signals.*")}
    assert names == {"signals.png", "signals.svg"}
    assert {"lyapunov_v", "gain", "time [s]"} <= set(labels(logged.folder / "signals.svg"))
    signals = logged.curves["signals"]
    assert signals["lyapunov_v _child0"] == (run.time_s.tolist(), logged.v.tolist())
    assert signals["gain _child0"][1] == (2.0 * logged.v).tolist()


def test_several_simulations_are_refused(run: Trajectory, tmp_path: Path) -> None:
    two = Trajectory.empty(run.time_s, nsim=2)
    with pytest.raises(InputError, match="simulation: got None; the trajectory has 2 simulations"):
        write_run_figures(two, ROBOT, tmp_path, "circle")
    assert not list(tmp_path.iterdir())


def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = "import sys, ttwmr_mj.figures.run; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(("count", "columns"), [(5, 3), (6, 3), (2, 2), (1, 1)])
def test_the_lowest_panel_of_every_column_has_numbers(count: int, columns: int) -> None:
    with canvas() as figure:
        grid = panel_grid(figure, count, columns, "x [m]")
        figure.draw_without_rendering()
        for column in grid.T:
            seen = [axes for axes in column if axes.get_visible()]
            numbered = [axes.xaxis.get_tick_params()["labelbottom"] for axes in seen]
            assert numbered == [False] * (len(seen) - 1) + [True]
            assert [axes.get_xlabel() for axes in seen] == [""] * (len(seen) - 1) + ["x [m]"]
    assert sum(axes.get_visible() for axes in grid.flat) == count
