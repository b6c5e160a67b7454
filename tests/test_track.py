"""Calibrate and track as a user does: real image files, a real video, real processes."""

from __future__ import annotations

import itertools
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.vision import footage
from ttwmr_mj.vision.calibration.file import load_calibration, save_calibration
from ttwmr_mj.vision.camera.frame import Image

CALIBRATION = scenarios_folder() / "calibration" / "lab_camera.yaml"
RATE_HZ = 1.0 / 0.033


def ttwmr(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Trajectory]:
    """A compressed video of a driven robot through the lab-like camera, and the truth."""
    scenario = load_scenario("lab_circle_camera", ["duration_s=4.0", "sensing.latency_s=0.0"])
    experiment = Experiment(scenario, scenarios_folder())
    path = tmp_path_factory.mktemp("video") / "lab.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, (640, 480))
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, 90)
    assert writer.isOpened()

    def film(rows: Trajectory) -> None:
        del rows
        for record in experiment.sensor.drain_log():
            writer.write(record.frame.image)

    trajectory = experiment.run(film).trajectory
    writer.release()
    return path, trajectory


@pytest.mark.slow
def test_a_video_is_tracked_to_the_truth(video: tuple[Path, Trajectory], tmp_path: Path) -> None:
    path, truth = video
    done = ttwmr("track", path, "--calibration", CALIBRATION, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    poses = pq.read_table(tmp_path / "out" / "poses.parquet")
    assert poses.num_rows == len(truth)
    assert (poses["valid"].to_numpy()[1:] == 1.0).all()
    miss = np.stack([poses["x_m"].to_numpy(), poses["y_m"].to_numpy()], -1) - truth.q[:, 0, :2]
    # the lab-like camera's single frames are good to 0.5 mm rms, and JPEG costs a little
    assert np.sqrt((miss**2).sum(axis=1).mean()) < 0.001
    for name, column in (("theta1_rad", 2), ("theta2_rad", 3)):
        off = np.angle(np.exp(1j * (poses[name].to_numpy() - truth.q[:, 0, column])))
        assert np.degrees(np.sqrt((off**2).mean())) < 0.5
    assert (tmp_path / "out" / "track.rrd").stat().st_size > 500_000


@pytest.mark.slow
def test_tracking_stops_after_as_many_frames_as_asked(
    video: tuple[Path, Trajectory], tmp_path: Path
) -> None:
    arguments = ["track", video[0], "--calibration", CALIBRATION, "--frames", "7", "--out", "out"]
    assert "7 frames" in ttwmr(*arguments, cwd=tmp_path).stdout
    assert pq.read_table(tmp_path / "out" / "poses.parquet").num_rows == 7


@pytest.mark.parametrize(
    ("stopped_at", "told", "left"),
    [
        (0, "stopped; nothing was recorded", set()),
        (40, "stopped; what was recorded is in out", {"poses.parquet", "track.rrd"}),
    ],
)
def test_a_source_that_is_not_tracked_to_its_end_is_no_success(
    stopped_at: int,
    told: str,
    left: set[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for i in range(50):
        cv2.imwrite(str(tmp_path / f"{i:02d}.png"), np.zeros((480, 640, 3), np.uint8))
    read, count = footage.read_picture, itertools.count()

    def stopping(path: Path) -> Image:
        if next(count) == stopped_at:
            raise KeyboardInterrupt
        return read(path)

    monkeypatch.setattr("ttwmr_mj.vision.footage.read_picture", stopping)
    assert main(["track", ".", "--calibration", str(CALIBRATION), "--out", "out", "--quiet"]) == 1
    assert capsys.readouterr().err == f"ttwmr: {told}\n"
    assert {path.name for path in tmp_path.glob("out/*")} == left


def small(path: Path) -> None:
    cv2.imwrite(str(path), np.zeros((24, 32, 3), np.uint8))


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda path: path.write_bytes(b"no picture"), "cannot be read as an image"),
        (small, "got 32×24 px"),
    ],
)
def test_pictures_before_one_that_is_none_are_tracked(
    spoil: Callable[[Path], object],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for i in range(12):
        cv2.imwrite(f"{i}.png", np.zeros((480, 640, 3), np.uint8))
    spoil(Path("7.png"))
    Path("._7.png").write_bytes(b"of a Mac")
    words = ["track", ".", "--calibration", str(CALIBRATION), "--out", "out"]
    assert main(words) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"ttwmr: 7.png: {told}")
    assert error.endswith("ended before it, after 7 of 12 pictures; what was tracked is in out\n")
    assert pq.read_table("out/poses.parquet").num_rows == 7
    assert main([*words, "--frames", "7", "--force"]) == 0
    assert "tracked in 0\nno robot: are the pictures in colour" in capsys.readouterr().out


def test_a_picture_that_is_missing_is_told_before_any_is_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("images").mkdir()
    for i in (0, 1):
        cv2.imwrite(f"images/{i}.png", np.zeros((480, 640, 3), np.uint8))
    listed = [{"file_name": f"{i}.png", "time_s": i / 30.0} for i in range(3)]
    Path("annotations.json").write_text(json.dumps({"images": listed}))
    assert main(["track", ".", "--calibration", str(CALIBRATION), "--out", "out"]) == 2
    assert "images/2.png: no picture file of this name" in capsys.readouterr().err
    assert not Path("out").exists()


@pytest.mark.slow
def test_a_video_that_is_cut_off_is_no_success(
    video: tuple[Path, Trajectory], tmp_path: Path
) -> None:
    whole = video[0].read_bytes()
    (tmp_path / "half.avi").write_bytes(whole[: len(whole) // 2])
    words = ["track", "half.avi", "--calibration", str(CALIBRATION), "--out", "out"]
    done = ttwmr(*words, cwd=tmp_path)
    assert done.returncode == 1
    said = re.search(r"ended after (\d+) frames, (.*) of (.*) s: damaged or cut off", done.stderr)
    assert said is not None, done.stderr
    count, until_s, whole_s = map(float, said.groups())
    assert 0.0 < until_s < whole_s
    assert pq.read_table(tmp_path / "out" / "poses.parquet").num_rows == count
    assert ttwmr(*words, "--frames", "2", "--force", cwd=tmp_path).returncode == 0


@pytest.mark.slow
def test_calibrate_reaches_a_tenth_of_the_allowed_error(tmp_path: Path) -> None:
    done = ttwmr("calibrate", "lab_circle_camera", "--out", "mine.yaml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    storage = cv2.FileStorage(str(tmp_path / "mine.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("views").real() >= 20
    assert storage.getNode("reprojection_rms_px").real() <= 0.15
    matrix = storage.getNode("camera_matrix").mat()
    # the true focal length: 240 px / tan(41.1°/2); a thousandth is 0.4 mm at the picture's edge
    assert matrix[0, 0] == pytest.approx(240 / np.tan(np.radians(41.1 / 2)), rel=1e-3)


def test_the_board_can_be_printed(tmp_path: Path) -> None:
    assert ttwmr("calibrate", "--board", "board.png", cwd=tmp_path).returncode == 0
    board = cv2.imread(str(tmp_path / "board.png"), cv2.IMREAD_GRAYSCALE)
    assert set(np.unique(board)) <= set(range(256))
    assert min(board.shape) > 500
    (tmp_path / "board.png").write_bytes(b"mine")
    again = ttwmr("calibrate", "--board", "board.png", cwd=tmp_path)
    told = "ttwmr: --board: there is board.png already; name another, or add --force"
    assert (again.returncode, again.stderr.strip()) == (2, told)
    assert (tmp_path / "board.png").read_bytes() == b"mine"
    assert ttwmr("calibrate", "--board", "board.png", "--force", cwd=tmp_path).returncode == 0
    assert (tmp_path / "board.png").read_bytes() != b"mine"


@pytest.mark.parametrize(
    ("make", "arguments", "expected"),
    [
        ("", ["track", "no.avi", "--calibration", "CAL"], "no.avi: no such video file"),
        ("torn.avi", ["track", "torn.avi", "--calibration", "CAL"], "torn.avi: "),
        ("", ["track", ".", "--calibration", "CAL"], "no picture in this folder; allowed: .png"),
        ("away.json", ["track", "frames", "--calibration", "CAL"], "images.0.file_name: it is not"),
        ("late.json", ["track", "frames", "--calibration", "CAL"], "images.0.time_s: it is not"),
        ("same.json", ["track", "frames", "--calibration", "CAL"], "1.png and 2.png are both at"),
        ("no.json", ["track", "frames", "--calibration", "CAL"], "it is no file, or larger than"),
        ("gone.json", ["track", "frames", "--calibration", "CAL"], "1.png: no picture file of"),
        ("pipe.png", ["track", "frames", "--calibration", "CAL"], "1.png: no picture file of"),
        ("small.png", ["track", "frames", "--calibration", "CAL"], "1.png: got 320×240 px"),
        ("small.avi", ["track", "small.avi", "--calibration", "CAL"], "got 320×240 px"),
        ("bad.yaml", ["track", "small.avi", "--calibration", "bad.yaml"], "bad.yaml: "),
        ("", ["track", "small.avi", "--calibration", "no.yaml"], "no such calibration file"),
        (
            "",
            ["track", "99", "--calibration", "CAL"],
            "99: no camera of this index can be opened; there may be none, it may be in use",
        ),
        ("", ["calibrate", "--images", "nowhere"], "needs pictures in nowhere/held (got 0)"),
        ("blank", ["calibrate", "--images", "blank"], "the board was found in 0 views"),
        ("", ["calibrate", "lab_circle"], "has no camera to calibrate"),
        (
            "there.yaml",
            ["calibrate", "--out", "there.yaml"],
            "--out: there is there.yaml already; na",
        ),
        ("", ["calibrate", "--board", "b.png", "--images", "x"], "--images would not be used"),
        ("", ["calibrate", "x", "--board", "b.png", "--seed", "1"], "SCENARIO, --seed would not"),
        ("", ["calibrate", "x", "--images", "blank"], "--images: SCENARIO would not be used"),
        (
            "pipe.png",
            ["track", "frames", "--calibration", "CAL", "--out", ".", "--force"],
            "SOURCE: got frames; --force would replace what is in ., this too",
        ),
    ],
)
def test_bad_input_is_exit_code_2_with_what_to_do(
    make: str,
    arguments: list[str],
    expected: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    _make(make, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    assert main([str(CALIBRATION) if word == "CAL" else word for word in arguments]) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"focal_px": np.full(2, 6.4e4)}, "a label is 1259 px wide; allowed: 1 to 160 px"),
        ({"focal_px": np.full(2, 9e5)}, "a label is 1.77e+04 px wide"),
        (
            {"focal_px": np.full(2, 3.6e-3)},
            "lengths of 0.0036 and 0.0036 px; allowed: at least 6.4",
        ),
        ({"position_m": np.array([0.0, 0.0, 0.09])}, "this camera, 0.09 m above the floor"),
        ({"position_m": np.array([0.0, 0.0, 0.06])}, "0.06 m above the floor, and the robot's lab"),
        ({"position_m": np.array([0.0, 0.0, 1900.0])}, "are its lengths in metres, and its focal"),
    ],
)
def test_a_camera_that_cannot_see_the_labels_is_told_before_any_picture(
    change: dict[str, np.ndarray],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("1.png", np.zeros((480, 640, 3), np.uint8))
    good = load_calibration(CALIBRATION)
    camera = replace(good.camera, **change)  # type: ignore[arg-type]  # arrays, all
    save_calibration(replace(good, camera=camera), Path("mine.yaml"))
    assert main(["track", ".", "--calibration", "mine.yaml", "--out", "out"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("ttwmr: mine.yaml: ")
    assert told in error
    assert not Path("out").exists()


LISTED = {
    "away.json": [{"file_name": "../1.png", "time_s": 0.0}],
    "late.json": [{"file_name": "1.png", "time_s": 1e7}],
    "same.json": [{"file_name": f"{i}.png", "time_s": 0.5} for i in (1, 2)],
    "gone.json": [{"file_name": "1.png", "time_s": 0.0}],
}


def _make(name: str, folder: Path) -> None:
    if name == "there.yaml":
        (folder / name).touch()
    if name in LISTED:
        (folder / "frames").mkdir()
        listed = json.dumps({"images": LISTED[name]})
        (folder / "frames" / "annotations.json").write_text(listed)
    if name == "no.json":
        (folder / "frames" / "annotations.json").mkdir(parents=True)
    if name == "pipe.png":
        (folder / "frames").mkdir()
        os.mkfifo(folder / "frames" / "1.png")
    if name == "small.png":
        (folder / "frames").mkdir()
        cv2.imwrite(str(folder / "frames" / "1.png"), np.zeros((240, 320, 3), np.uint8))
    if name == "torn.avi":
        (folder / name).write_bytes(b"RIFF" + bytes(5000))
    if name == "small.avi":
        writer = cv2.VideoWriter(
            str(folder / name), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (320, 240)
        )
        writer.write(np.zeros((240, 320, 3), np.uint8))
        writer.release()
    if name == "bad.yaml":
        (folder / name).write_text("%YAML:1.0\n---\nimage_width: [640\n")
    if name == "blank":
        for part in ("held", "origin"):
            (folder / name / part).mkdir(parents=True)
            for i in range(10):
                blank = np.full((480, 640, 3), 200, np.uint8)
                cv2.imwrite(str(folder / name / part / f"{i}.png"), blank)
