"""The times of a run's kept frames: tracked by them, the robot is where it was."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.cli.main import main

CALIBRATION = scenarios_folder() / "calibration" / "lab_camera.yaml"


def ttwmr(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_frames_that_a_run_keeps_are_tracked_at_their_times(tmp_path: Path) -> None:
    changes = ["--set", "duration_s=1.0", "--set", "output.figures=false"]
    ttwmr("run", "double_inverted_camera", *changes, "--save-frames", "--out", "run", cwd=tmp_path)
    higher = ttwmr("calibrate", "double_inverted_camera", "--out", "mine.yaml", cwd=tmp_path)
    assert higher.returncode == 0, higher.stderr
    arguments = ["--calibration", "mine.yaml", "--scenario", "double_inverted_camera"]
    done = ttwmr("track", "run/frames", *arguments, "--out", "timed", cwd=tmp_path)
    assert "30 frames, robot tracked in 30" in done.stdout, done.stderr
    assert "look at it: ttwmr view timed" in done.stdout
    poses = pq.read_table(tmp_path / "timed" / "poses.parquet")
    truth = pq.read_table(tmp_path / "run" / "trajectory.parquet")
    assert [name for name in poses.column_names if name.endswith("_std_rad")] == [
        f"theta{i}_std_rad" for i in (1, 2, 3)
    ]
    # single frames of two trailers are good to 0.1 mm and 0.05°; times off by the exposure's
    # middle, 4 ms, would be 2.4 mm and 0.2° off
    for name, good in (("x_m", 5e-4), ("y_m", 5e-4), ("theta3_rad", 2e-3)):
        true = np.interp(poses["time_s"], truth["time_s"], truth[name])
        assert np.abs(poses[name].to_numpy() - true)[1:].max() < good
    ttwmr("track", "run/frames/images", *arguments, "--out", "by_name", cwd=tmp_path)
    times = pq.read_table(tmp_path / "by_name" / "poses.parquet")["time_s"].to_numpy()
    np.testing.assert_allclose(times, np.arange(30) / 30.0, atol=1e-12)


@pytest.mark.parametrize(
    ("values", "late_s"),
    [
        (["sensing.clock_offset_s=0.05"], 0.037),  # the latency, 33 ms, and the exposure's middle
        (["sensing.clock_offset_s=-0.03"], -0.03),
        (["sensing.latency_jitter_s=0.066"], 0.033),
        (["belief.latency_s=0.1"], -0.067),
        (["sensing.clock_offset_s=0.03", "sensing.tracker.learn_latency=true"], 0.03),
    ],
)
def test_images_have_the_time_of_their_exposure_whatever_the_clock_says(
    values: list[str], late_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["duration_s=1.5", "output.figures=false", *values]
    changes = itertools.chain.from_iterable(("--set", word) for word in words)
    start = ["--set", 'initial={kind="on_reference"}']
    main(["run", "lab_circle_camera", *changes, *start, "--save-frames", "--out", "run", "--quiet"])
    listed = json.loads(Path("run/frames/annotations.json").read_text())["images"]
    late = np.array([image["stamp_s"] - image["time_s"] for image in listed])
    assert late[np.abs(late).argmax()] == pytest.approx(late_s, abs=1e-9)
    words = ["--calibration", str(CALIBRATION), "--out", "tracked", "--quiet"]
    assert main(["track", "run/frames", *words]) == 0
    poses = pq.read_table("tracked/poses.parquet")
    truth = pq.read_table("run/trajectory.parquet")
    off = [
        poses[name].to_numpy() - np.interp(poses["time_s"], truth["time_s"], truth[name])
        for name in ("x_m", "y_m")
    ]
    # single frames are good to 0.1 mm, the first to 0.2 mm; stamps were 1.5 mm off and more
    assert poses["valid"].to_numpy().all()
    assert np.hypot(*off).max() < 5e-4
