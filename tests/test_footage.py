"""When frames of a video and pictures of a folder were taken, and in which order."""

from __future__ import annotations

import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.errors import RunError
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.footage import open_footage

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")

CAMERA = load_calibration(scenarios_folder() / "calibration" / "lab_camera.yaml").camera
GREY = 20  # between one picture and the next, which compression does not bridge


def pictures(folder: Path, count: int, name: str = "{:04d}.png") -> None:
    folder.mkdir()
    for i in range(count):
        cv2.imwrite(str(folder / name.format(i)), np.full((480, 640, 3), GREY * i, np.uint8))


def taken(source: Path) -> tuple[list[float], list[int]]:
    """Times, and which picture it was."""
    with open_footage(str(source), CAMERA) as footage:
        frames = list(footage)
    shades = [round(float(frame.image.mean()) / GREY) for frame in frames]
    return [frame.time_s for frame in frames], shades


def film(path: Path, options: list[str]) -> None:
    pictures(path.parent / "shots", 12)
    ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-framerate", "30"]
    source = ["-i", str(path.parent / "shots" / "%04d.png")]
    subprocess.run([*ffmpeg, *source, *options, str(path)], check=True)


@pytest.mark.parametrize(
    ("file", "options", "expected"),
    [
        ("even.mp4", ["-pix_fmt", "yuv420p"], np.arange(12) / 30.0),
        ("even.webm", [], np.arange(12) / 30.0),
        ("even.avi", ["-c:v", "mjpeg"], np.arange(12) / 30.0),
        (
            "uneven.mp4",
            ["-pix_fmt", "yuv420p", "-vf", "setpts='(N+N*N)/30/TB'", "-fps_mode", "vfr"],
            (np.arange(12) + np.arange(12) ** 2) / 30.0,
        ),
    ],
)
def test_frames_are_at_the_times_of_their_file(
    file: str, options: list[str], expected: np.ndarray, tmp_path: Path
) -> None:
    film(tmp_path / file, options)
    times, shades = taken(tmp_path / file)
    assert shades == list(range(12))
    np.testing.assert_allclose(times, expected, atol=6e-4)  # webm rounds to milliseconds


@pytest.mark.parametrize(
    ("file", "options"),
    [
        ("gap.webm", ["-fps_mode", "vfr"]),
        ("gap.mkv", ["-fps_mode", "vfr", "-c:v", "mjpeg"]),
        ("gap.ts", ["-fps_mode", "vfr", "-c:v", "mpeg2video"]),
        ("gap.avi", ["-fps_mode", "passthrough", "-c:v", "mjpeg"]),
    ],
)
def test_a_video_with_a_gap_is_whole_and_one_without_its_end_is_not(
    file: str, options: list[str], tmp_path: Path
) -> None:
    """These containers tell how long they are, and OpenCV makes a number of frames of it."""
    gap = ["-vf", "setpts='(N+20*gte(N,6))/30/TB'", *options]
    film(tmp_path / file, gap)
    times, shades = taken(tmp_path / file)
    assert shades == list(range(12))
    assert times[-1] == pytest.approx(31 / 30.0, abs=6e-4)
    if file != "gap.ts":  # a stream of packets, which tells no length beforehand
        whole = (tmp_path / file).read_bytes()
        (tmp_path / file).write_bytes(whole[: len(whole) * 2 // 3])
        with pytest.raises(RunError, match=rf"{file}: ended after \d+ frames, .* of 1\.1 s: dam"):
            taken(tmp_path / file)


def test_a_video_without_its_last_frames_is_told(tmp_path: Path) -> None:
    """Of 60 the last ones, less than a tenth; containers miscount by one or two."""
    path = tmp_path / "cut.avi"
    film(path, ["-c:v", "mjpeg", "-vf", "loop=loop=4:size=12:start=0"])
    whole = path.read_bytes()
    assert len(taken(path)[1]) == 60
    path.write_bytes(whole[: len(whole) * 93 // 100])
    with pytest.raises(RunError, match=r"ended after 5[4-7] frames, 1\.[89] of 2\.0 s: damaged"):
        taken(path)


@pytest.mark.parametrize("name", ["{}.png", "shot {} of 12.png", "{:04d}.png"])
def test_pictures_come_in_the_order_of_the_numbers_in_their_names(
    name: str, tmp_path: Path
) -> None:
    pictures(tmp_path / "shots", 12, name)
    times, shades = taken(tmp_path / "shots")
    assert shades == list(range(12))
    np.testing.assert_allclose(times, np.arange(12) / 30.0, atol=1e-12)


def test_names_of_any_kind_have_an_order(tmp_path: Path) -> None:
    (tmp_path / "shots").mkdir()
    for name in ("a.png", "10.png", "9.png", "٣.png", "²7.png", "a1b.png", "a01.png", "7.png"):
        cv2.imwrite(str(tmp_path / "shots" / name), np.zeros((480, 640, 3), np.uint8))
    assert len(taken(tmp_path / "shots")[0]) == 8
