"""Videos of runs: real files, decoded again, and what their pictures show."""

from __future__ import annotations

import errno
import shutil
import sys
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene.robot import force_scale_m_n
from ttwmr_mj.recording.video import encode
from ttwmr_mj.recording.video.cameras import chase
from ttwmr_mj.recording.video.film import SIZE_PX, STRIP_SHARE, Film
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.recording.video.map import BOTTOM_PX, SHIFT, TOP_PX, Map
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.scenario.file import load_scenario

UPPER = round((1.0 - STRIP_SHARE) * SIZE_PX[1])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    run_scenario(load_scenario("lab_circle", ["duration_s=3.0", "output.figures=false"]), folder)
    return folder


def frames_of(path: Path) -> tuple[list[np.ndarray], float]:
    """All pictures (rows, columns, 3) RGB of a video, and its rate [1/s]."""
    stream, pictures = cv2.VideoCapture(str(path)), []
    while (read := stream.read())[0]:
        pictures.append(read[1][..., ::-1])
    return pictures, float(stream.get(cv2.CAP_PROP_FPS))


@pytest.mark.parametrize(
    ("suffix", "size", "rate"),
    [
        (".mp4", (720, 1280, 3), 30.0),
        (".webm", (720, 1280, 3), 30.0),
        (".gif", (360, 640, 3), 12.5),
    ],
)
def test_a_video_has_its_frames(
    suffix: str,
    size: tuple[int, ...],
    rate: float,
    run: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / f"film{suffix}"
    words = ["video", str(run), "-o", str(out), "--start", "1", "--stop", "1.6", "--quiet"]
    assert main([*words, "--view", "overhead", "--speed", "0.5"]) == 0
    assert capsys.readouterr() == (f"{out}\n", "")
    pictures, fps = frames_of(out)
    assert fps == pytest.approx(rate, rel=1e-3)
    assert len(pictures) == round(0.6 / 0.5 * rate) + 1
    assert pictures[0].shape == size
    assert (pictures[0] != pictures[-1]).any()
    assert [path.name for path in tmp_path.iterdir()] == [out.name]  # nothing half-made is left


def coloured(picture: np.ndarray, colour: style.Colour) -> np.ndarray:
    """(rows, columns) which pixels have nearly that colour."""
    return np.asarray((np.abs(picture.astype(int) - colour) < 12).all(axis=2))


def test_the_map_shows_where_the_robot_is(run: Path) -> None:
    footage = Footage.of(run, 10.0, 1.0, 0.0, None)
    film = Film(footage, "overhead", 1.0)
    first, last = (film.frame(k)[:UPPER] for k in (0, len(footage.time_s) - 1))
    film.close()
    centres = [
        np.argwhere(coloured(shot[60:-40], style.TRACTOR)).mean(axis=0) for shot in (first, last)
    ]
    moved_m = footage.q[-1, :2] - footage.q[0, :2]
    scale = film._map._scale if film._map else np.nan  # pixels per metre
    expected = scale * np.array([-moved_m[1], moved_m[0]])  # rows go down
    # the driven path has the tractor's colour and draws the centre back by less than it is long
    assert np.dot(centres[1] - centres[0], expected) > 0.5 * np.dot(expected, expected)
    for colour in (style.TRAILER, style.REFERENCE_BAND):
        assert coloured(first, colour).sum() > 100


@pytest.mark.parametrize("preset", ["table", "outdoor"])
def test_the_map_has_room_for_the_whole_robot(preset: str, tmp_path: Path) -> None:
    line = "reference={kind='straight_line', speed_m_s=0.1, theta2='aligned'}"
    values = ["duration_s=0.3", "output.figures=false", f"robot.preset={preset!r}", line]
    start = "initial={kind='on_reference'}"
    run_scenario(load_scenario("lab_circle", [*values, start]), tmp_path)
    footage = Footage.of(tmp_path, 10.0, 1.0, 0.0, None)
    drawn = Map(footage, 480, UPPER)
    for frame in range(len(footage.time_s)):
        for name in ("tractor", "trailer"):
            corners_px = drawn._corners(name, drawn._now, frame) / (1 << SHIFT)
            assert (corners_px >= [0, TOP_PX]).all()
            assert (corners_px <= [480, UPPER - BOTTOM_PX]).all()


def test_the_chase_shows_robot_paths_and_forces(run: Path) -> None:
    footage = Footage.of(run, 10.0, 1.0, 0.0, None)
    film = Film(footage, "both", 1.0)
    picture = film.frame(len(footage.time_s) - 1)
    stage = film._stage
    assert stage is not None
    kinds = [geom.type for geom in stage._scene.geoms[stage._first_moving : stage._scene.ngeom]]
    shapes = mujoco.mjtGeom.mjGEOM_ARROW, mujoco.mjtGeom.mjGEOM_CAPSULE
    arrows, stems = (kinds.count(int(shape)) for shape in shapes)
    assert arrows == stems == footage.arrows_m.shape[1] > 0  # tied to where each force acts
    film.close()
    assert picture.shape == (720, 1280, 3)
    scene = picture[80 : UPPER - 40, :800]
    assert 0.01 < (scene.max(axis=2) < 80).mean() < 0.4  # the robot
    blue, violet = scene[..., 2].astype(int), scene.astype(int)
    assert ((blue - violet[..., 0] > 90) & (violet[..., 1] > 100)).sum() > 200  # the driven path
    force = (blue - violet[..., 1] > 60) & (violet[..., 0] - violet[..., 1] > 10)
    assert force.sum() > 200
    # the hand-over from one row to the next is a cut: forces of the row before the frame
    robot = RobotParameters()
    weight_n = 9.81 * (robot.tractor.mass_kg + robot.trailer.mass_kg)
    lifted_n = footage.arrows_m[-1, :, 1, 2].sum() / force_scale_m_n(robot)
    assert lifted_n == pytest.approx(weight_n, rel=0.05)


def test_every_trailer_of_a_train_is_shown(tmp_path: Path) -> None:
    overrides = ["duration_s=0.3", "output.figures=false"]
    run_scenario(load_scenario("two_trailers_turn", overrides), tmp_path)
    footage = Footage.of(tmp_path, 10.0, 1.0, 0.0, None)
    eye, x_m = chase(footage)(0), footage.q[0, 0]
    assert eye.distance == pytest.approx(0.5 + 0.23)  # farther away by the first trailer's length
    assert eye.lookat[0] == pytest.approx(x_m - 0.09 - 0.5 * 0.23, abs=0.01)  # and at its middle
    film = Film(footage, "both", 1.0)
    picture = film.frame(2)[60:UPPER, film._left :]
    shades = film._stage._bodies if film._stage else []
    film.close()
    violet = coloured(picture, style.TRAILER).astype(np.uint8)
    areas = cv2.connectedComponentsWithStats(violet)[2][1:, cv2.CC_STAT_AREA]
    assert (areas > 100).sum() == 2  # apart by their dark edges
    assert len(shades) == 3


def test_plots_are_uncovered_as_time_goes_on(run: Path) -> None:
    footage = Footage.of(run, 10.0, 1.0, 0.0, None)
    film = Film(footage, "overhead", 1.0)
    strips = [film.frame(k)[UPPER:] for k in (0, 15, 29)]
    film.close()
    bright = [int((strip[40:-30].max(axis=2) > 140).sum()) for strip in strips]
    assert bright[0] < bright[1] < bright[2]


def test_an_interpolated_pose_lies_between_its_rows(run: Path) -> None:
    footage = Footage.of(run, 30.0, 1.0, 0.5, 1.0)
    rows = Trajectory.read(run / "trajectory.parquet")
    for k, time_s in enumerate(footage.time_s):
        before = int(np.searchsorted(rows.time_s, time_s, side="right")) - 1
        ends = np.sort(rows.q[before : before + 2, 0], axis=0)
        assert (ends[0] - 1e-12 <= footage.q[k]).all()
        assert (footage.q[k] <= ends[1] + 1e-12).all()


def test_a_run_without_recording_has_a_video_without_forces(run: Path, tmp_path: Path) -> None:
    for name in ("trajectory.parquet", "scenario.resolved.toml"):
        shutil.copy(run / name, tmp_path / name)
    assert Footage.of(tmp_path, 30.0, 1.0, 0.0, None).arrows_m.shape[1] == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-o", "film.avi"], r"-o: got film.avi; allowed: a file name with .mp4, .webm, .gif"),
        (["-o", "film.mp4", "--speed", "0"], "--speed: got 0"),
        (["-o", "film.mp4", "--start", "9"], "nothing between 9 s and 2.9"),
        (["-o", "film.mp4", "--speed", "1e-9"], "--speed: got 1e-09; makes 8.91e+10 pictures"),
        (["-o", "film.mp4", "--start", "-1"], "--start: got -1; allowed: 0 or more"),
        (["-o", "film.mp4", "--start", "nan"], "--start: got nan; allowed: 0 or more"),
        (["-o", "film.mp4", "--stop", "-1"], "nothing between 0 s and -1 s, the run has 2.97 s"),
        (["-o", "nowhere/film.mp4"], "-o: got nowhere/film.mp4; there is no folder nowhere"),
    ],
)
def test_what_cannot_be_shown_is_refused(
    words: list[str], said: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["video", str(run), *words]) == 2
    assert said in capsys.readouterr().err


def test_a_film_of_one_frame(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "film.gif"
    words = ["video", str(run), "-o", str(out), "--view", "overhead", "--speed", "100"]
    out.write_text("mine")
    assert main([*words, "--quiet"]) == 2
    assert out.read_text() == "mine"
    assert main([*words, "--force", "--quiet"]) == 0
    assert len(frames_of(out)[0]) == 1


def test_a_folder_is_no_film(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "film.mp4").mkdir()
    assert main(["video", str(run), "-o", str(tmp_path / "film.mp4")]) == 2
    assert "allowed: a file name with" in capsys.readouterr().err


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no run folder"):
        Footage.of(tmp_path, 30.0, 1.0, 0.0, None)


def test_the_film_is_named_that_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(**_: object) -> None:  # root may write anywhere
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path / ".video-1"))

    monkeypatch.setattr(encode, "TemporaryDirectory", refused)
    with pytest.raises(PermissionError) as error:
        encode.write_video(tmp_path / "film.mp4", [], (64, 48), 30.0)
    assert error.value.filename == str(tmp_path / "film.mp4")


def test_a_machine_without_encoder_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MachineError, match=r"pip install 'ttwmr-mj\[video\]'"):
        encode.check_format(Path("film.mp4"))


def test_progress_goes_to_the_end(run: Path, tmp_path: Path) -> None:
    from ttwmr_mj.recording.video.film import make_video

    shares: list[float] = []
    out = tmp_path / "film.mp4"
    make_video(run, out, view="overhead", stop_s=0.3, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(frames_of(out)[0]) == len(shares)
