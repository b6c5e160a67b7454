"""A disk that is really full: one message, what was kept, exit code 1, and no hang.

Each command runs in a mount namespace of its own, on a file system of a few kB in memory.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main

SCRIPT = """
mount -t tmpfs -o size=$1 none "$2" || exit 99
cd "$2"; shift 2
"$@"; code=$?
find . -name '*.part*' > ../parts; find . -type f > ../left
[ -d out ] && cp -r out ../kept
exit $code
"""
FILLED = "head -c 1000000 /dev/zero > filler 2>/dev/null; "


class Ended(NamedTuple):
    code: int
    err: str
    left: list[str]


def namespaces() -> bool:
    """Whether this system lets us mount something for ourselves."""
    if shutil.which("unshare") is None:
        return False
    command = ["unshare", "-rm", "sh", "-c", "mount -t tmpfs -o size=4k none /mnt"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


pytestmark = pytest.mark.skipif(not namespaces(), reason="no namespaces to mount a small disk in")


def on_small_disk(tmp_path: Path, size: str, line: str) -> Ended:
    """Run a shell's line, in which ttwmr is the command, in a folder of this size."""
    (tmp_path / "small").mkdir()
    line = line.replace("ttwmr", f"{sys.executable} -m ttwmr_mj")
    command = ["unshare", "-rm", "sh", "-c", SCRIPT, "sh", size, tmp_path / "small"]
    done = subprocess.run(
        [*command, "sh", "-c", line],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    )
    assert (tmp_path / "parts").read_text() == ""
    assert "Traceback" not in done.stderr
    return Ended(done.returncode, done.stderr, (tmp_path / "left").read_text().split())


@pytest.mark.slow
def test_a_recorded_run_keeps_what_it_had(tmp_path: Path) -> None:
    words = "ttwmr run lab_circle --out out --quiet --set duration_s=100.0"
    ended = on_small_disk(tmp_path, "600k", words)
    told = "No space left on device; what was recorded is in out and can be scored: ttwmr score out"
    assert ended.code == 1
    assert ended.err.count("\n") == 1
    assert told in ended.err
    assert "./out/metrics.json" not in ended.left
    assert main(["score", "--quiet", str(tmp_path / "kept")]) == 0  # with room for it
    assert len(tt.Trajectory.read(tmp_path / "kept" / "trajectory.parquet")) > 1


@pytest.mark.parametrize(
    ("line", "left"),
    [
        ("ttwmr new mine --controller", []),
        ("ttwmr calibrate --board board.png", []),
        ("ttwmr export-schema --out schema.json", []),
        ("ttwmr run lab_circle --out out --set plant.kind=analytic", []),
    ],
)
def test_files_are_there_or_not(line: str, left: list[str], tmp_path: Path) -> None:
    ended = on_small_disk(tmp_path, "4k", FILLED + line)
    assert ended.code == 1
    assert ended.err.count("\n") == 1
    assert "No space left on device" in ended.err
    assert ended.left == ["./filler", *left]


@pytest.mark.slow
def test_what_libraries_keep_for_later_may_find_no_room(tmp_path: Path) -> None:
    """OpenGL's shaders in a file that is mapped into memory, Matplotlib's list of fonts."""
    caches = "export XDG_CACHE_HOME=$PWD/cache MPLCONFIGDIR=$PWD/fonts; "
    line = "ttwmr run lab_circle_camera --quiet --set duration_s=0.3 --out ../run"
    ended = on_small_disk(tmp_path, "4k", FILLED + caches + line)
    assert (ended.code, ended.err) == (0, "")
    assert (tmp_path / "run" / "summary.png").is_file()


@pytest.mark.parametrize(
    "words",
    [
        "run lab_circle --out out --set duration_s=1.0",
        "new mine",
        "export-schema --out schema.json",
        "calibrate --board board.png",
        "bench quick --out out --quiet",
        "sweep hitch_friction --out out --quiet",
    ],
)
def test_a_read_only_disk_is_told_before_anything_runs(words: str, tmp_path: Path) -> None:
    ended = on_small_disk(tmp_path, "64k", f"mount -o remount,ro $PWD; ttwmr {words}")
    assert ended.code in (1, 2)
    assert ended.err.count("\n") == 1, ended.err
    assert "Read-only file system" in ended.err or "nothing can be written in" in ended.err
    assert ended.left == []


@pytest.mark.slow
def test_a_track_is_whole_or_not_there(tmp_path: Path) -> None:
    film = cv2.VideoWriter(
        str(tmp_path / "dark.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (640, 480)
    )
    for _ in range(60):
        film.write(np.zeros((480, 640, 3), np.uint8))
    film.release()
    calibration = Path(tt.__file__).parents[1] / "scenarios/calibration/lab_camera.yaml"
    line = f"ttwmr track ../dark.avi --calibration {calibration} --out out --quiet"
    ended = on_small_disk(tmp_path, "64k", line)
    assert ended.code == 1
    assert ended.err.count("\n") == 1
    assert "No space left on device" in ended.err
    assert "./out/poses.parquet" not in ended.left


@pytest.mark.slow
def test_a_plan_is_whole_or_not_there(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("x_m,y_m\n0,0\n0.4,0\n0.4,0.4\n")
    ended = on_small_disk(tmp_path, "4k", FILLED + "ttwmr plan ../points.csv --out p.csv --quiet")
    assert ended.code == 1
    assert ended.err.count("\n") == 1
    assert "No space left on device" in ended.err
    assert ended.left == ["./filler"]


@pytest.mark.slow
def test_a_comparison_has_no_recording_that_is_cut_off_unsaid(tmp_path: Path) -> None:
    words = "ttwmr compare lab_circle --no-attribution --out out --quiet --set duration_s=20.0"
    ended = on_small_disk(tmp_path, "600k", words)
    assert ended.code == 1
    assert ended.err.count("\n") == 1
    assert "No space left on device; nothing was recorded" in ended.err
    assert ended.left == []


@pytest.mark.slow
def test_a_calibration_stays_as_it_was(tmp_path: Path) -> None:
    again = "ttwmr calibrate --force; cat calibration.yaml >&2"
    ended = on_small_disk(tmp_path, "8k", f"echo good > calibration.yaml; {FILLED}{again}")
    assert "No space left on device" in ended.err
    assert ended.err.endswith("good\n")
    assert "written to" not in ended.err


@pytest.mark.slow
def test_a_video_is_whole_or_not_there(tmp_path: Path) -> None:
    scenario = tt.load_scenario("lab_circle", ["duration_s=3.0", "output.figures=false"])
    tt.run(scenario, tmp_path / "run")
    for ending in ("mp4", "gif"):
        line = f"ttwmr video ../run -o film.{ending} --view overhead --quiet"
        shutil.rmtree(tmp_path / "small", ignore_errors=True)
        ended = on_small_disk(tmp_path, "16k", line)
        assert ended.code == 1
        assert ended.err.count("\n") == 1
        assert "the video encoder failed, no video is left: " in ended.err
        assert ended.left == []


@pytest.mark.slow
def test_studies_say_it_is_the_machine(tmp_path: Path) -> None:
    (tmp_path / "three.toml").write_text(
        'name = "three"\nscenario = "lab_circle"\nmetric = "tractor_rmse_m"\n'
        'overrides = ["plant.kind=analytic", "duration_s=1.0"]\n'
        '[parameters]\n"controller.alpha1" = { values = [10.0, 20.0, 30.0] }\n'
    )
    for size, line in (
        ("24k", "ttwmr sweep ../three.toml --out out --quiet"),
        ("24k", "ttwmr bench quick --out out --quiet --workers 2"),
        ("24k", "ttwmr reproduce --only fig7 --out out --quiet"),
    ):
        shutil.rmtree(tmp_path / "small", ignore_errors=True)
        shutil.rmtree(tmp_path / "kept", ignore_errors=True)
        ended = on_small_disk(tmp_path, size, line)
        assert ended.code == 1, line
        assert "No space left on device" in ended.err, line
