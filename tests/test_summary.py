"""The figure of a run: what is in it, its size, and that it is there whole or not at all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn import drawn, labels
from trains import train
from trajectories_of_figures import ROBOT, circle_run

from ttwmr_mj.errors import InputError
from ttwmr_mj.figures.silhouettes import last_round
from ttwmr_mj.figures.summary import LOOKS, WIDTH_IN, write_summary
from ttwmr_mj.results.curves import Curves, centre_of_oscillation
from ttwmr_mj.results.trajectory import Trajectory

TITLE = ["circle: followed", "contact · lyapunov & <camera> · seed 7", "2 mm: trailer, rms error"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    written = write_summary(circle_run(), ROBOT, folder, TITLE)
    assert sorted(written) == sorted(folder.iterdir())  # and no drafts left behind
    return folder


def test_it_is_as_wide_as_a_column_and_its_letters_are_read_there(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == {
        f"summary.{e}" for e in ("png", "svg", "pdf")
    }
    picture = cv2.imread(str(folder / "summary.png"))
    height, width, _ = picture.shape
    assert width == 1600
    assert 1.2 * width < height < 2.2 * width
    assert pytest.approx(85.0) == 25.4 * WIDTH_IN
    assert min(size for key, size in LOOKS.items() if "size" in key) >= 8.0
    assert (folder / "summary.pdf").read_bytes().startswith(b"%PDF")


def test_it_says_what_ran_and_what_is_drawn(folder: Path) -> None:
    shown = labels(folder / "summary.svg")
    assert set(TITLE) <= set(shown)
    assert {"x [m]", "y [m]", "time [s]", "error [mm]", "θ2 [rad]", "wheels [rad/s]"} <= set(shown)
    assert {"reference", "tractor (P)", "trailer (F)", "right", "left", "limit"} <= set(shown)
    assert "estimate of P" not in shown  # the law saw the truth


@pytest.mark.slow
def test_same_trajectory_same_bytes(folder: Path, tmp_path: Path) -> None:
    for path in write_summary(circle_run(), ROBOT, tmp_path, TITLE):
        assert path.read_bytes() == (folder / path.name).read_bytes(), path.name


def test_curves_are_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn_of = drawn(monkeypatch, "ttwmr_mj.figures.summary")
    run = circle_run()
    run = replace(run, est_q=run.q + [0.003, 0.004, 0.0, 0.0])
    write_summary(run, ROBOT, tmp_path, TITLE)
    curves, of = drawn_of["summary"], Curves.of(run, ROBOT)
    np.testing.assert_array_equal(curves["reference"], run.ref_q[:, 0, :2].T)
    np.testing.assert_array_equal(curves["tractor (P)"], run.q[:, 0, :2].T)
    f = centre_of_oscillation(run.q, ROBOT)[:, 0]
    np.testing.assert_array_equal(curves["trailer (F)"], f.T)
    errors_mm = np.array([line[1] for name, line in curves.items() if "error [mm]" in name])
    np.testing.assert_array_equal(errors_mm[0], 1e3 * of.oscillation_error_m[:, 0])
    np.testing.assert_array_equal(errors_mm[1], 1e3 * of.tractor_error_m[:, 0])
    np.testing.assert_allclose(curves["estimate of P"][1], 5.0)  # mm
    np.testing.assert_array_equal(curves["θ2"], [run.time_s, run.q[:, 0, 3]])
    np.testing.assert_array_equal(curves["right"][1], run.wheel_speed_rad_s[:, 0, 0])
    np.testing.assert_array_equal(curves["left"][1], run.wheel_speed_rad_s[:, 0, 1])
    assert curves["limit"][1] == [ROBOT.servo.speed_limit_rad_s] * 2


def test_a_run_without_reference_has_no_errors(tmp_path: Path) -> None:
    run = circle_run()
    free = replace(run, ref_q=np.full_like(run.ref_q, np.nan))
    write_summary(free, ROBOT, tmp_path, ["free"])
    shown = labels(tmp_path / "summary.svg")
    assert not {"error [mm]", "reference"} & set(shown)
    assert {"θ2 [rad]", "tractor (P)", "trailer (COM)"} <= set(shown)


def test_poses_are_those_of_the_last_round() -> None:
    turns = np.linspace(0.0, 3.25 * 2.0 * np.pi, 1301)  # 400 rows a round
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    assert last_round(circle) == pytest.approx(900, abs=1)
    assert last_round(circle[:200]) == 0  # half a round


def test_of_a_train_the_hitches_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn_of = drawn(monkeypatch, "ttwmr_mj.figures.summary")
    q = np.concatenate([circle_run().q, circle_run().q[..., 3:] + 0.25], axis=-1)
    run = replace(circle_run(), q=q, ref_q=q.copy(), est_q=q.copy())
    robot = train(2)
    write_summary(run, robot, tmp_path, ["train"])
    curves = drawn_of["summary"]
    assert "last trailer (F)" in curves
    np.testing.assert_allclose(curves["θ3 − θ2"][1], 0.25)
    np.testing.assert_allclose(curves["θ2 − θ1"][1], q[:, 0, 3] - q[:, 0, 2])


@pytest.mark.slow
def test_a_run_that_broke_or_stood_still_is_drawn(tmp_path: Path) -> None:
    run = circle_run()
    broken = replace(run, q=run.q.copy())
    broken.q[200:] = np.nan
    write_summary(broken, ROBOT, tmp_path, ["broken"])
    still = replace(
        run, q=np.tile(run.q[:1], (len(run), 1, 1)), wheel_speed_rad_s=0.0 * run.q[..., :2]
    )
    write_summary(still, ROBOT, tmp_path, ["still"])


@pytest.mark.slow
def test_long_titles_are_wrapped(tmp_path: Path) -> None:
    write_summary(circle_run(), ROBOT, tmp_path, ["x" * 20 + " " + "y" * 40, "z"])
    assert {"x" * 20, "y" * 40} <= set(labels(tmp_path / "summary.svg"))


def test_several_simulations_are_refused(tmp_path: Path) -> None:
    two = Trajectory.empty(circle_run().time_s, nsim=2)
    with pytest.raises(InputError, match="simulation: got None"):
        write_summary(two, ROBOT, tmp_path, ["two"])
    assert not list(tmp_path.iterdir())
