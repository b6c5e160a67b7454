"""OpenGL that works no longer ends a run with one message; what was recorded is kept."""

from __future__ import annotations

import gc
import json
from itertools import count
from pathlib import Path

import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.results.row_stream import read_run

WORDS = ["run", "lab_circle_camera", "--quiet", "--set", "duration_s=60.0"]


def lose_opengl(after: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's call that reads pictures fails from one on."""
    read, calls = mujoco.mjr_readPixels, count()

    def lost(*given: object) -> None:
        if next(calls) >= after:
            raise mujoco.FatalError("OpenGL error 0x505 in or before mjr_readPixels")
        read(*given)

    monkeypatch.setattr(mujoco, "mjr_readPixels", lost)


def test_a_run_ends_and_can_be_scored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lose_opengl(60, monkeypatch)
    out = tmp_path / "out"
    assert main([*WORDS, "--out", str(out)]) == 1
    told = capsys.readouterr().err.strip()
    assert told.startswith("ttwmr: the camera's OpenGL works no longer: FatalError: OpenGL error")
    assert f"ttwmr score {out}" in told
    assert len(told.splitlines()) == 1
    rows = read_run(out)
    assert len(rows) > 10  # of the first second, in which none is reported
    assert main(["score", "--quiet", str(out)]) == 0
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["end_time_s"] == rows.time_s[-1]


def test_without_a_first_frame_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lose_opengl(0, monkeypatch)
    assert main([*WORDS, "--out", str(tmp_path / "out")]) == 2
    gc.collect()  # the camera that came never up is freed in another thread than its own
    (told,) = capsys.readouterr().err.splitlines()
    assert told.startswith("ttwmr: the camera's OpenGL works no longer: FatalError: OpenGL error")
    assert not (tmp_path / "out").exists()
