"""Folders of names that libraries take for something else: a home, a service, a pattern."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from sweeps import SMALL, here, plan_of
from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.recording.stream import viewer
from ttwmr_mj.recording.video.encode import write_video
from ttwmr_mj.results.parquet import read_parquet
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.execute import fill
from ttwmr_mj.studies.sweep.folder.extend import extend
from ttwmr_mj.studies.sweep.folder.merge import merge
from ttwmr_mj.studies.sweep.folder.plan_file import write_plan
from ttwmr_mj.studies.sweep.record import Wish, rows_to_record
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.footage import open_footage

NAMES = ("~", "part:1", "s3:")


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's, which stays empty; the working directory is beside it."""
    for name in ("home", "work"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.mark.parametrize("name", NAMES)
def test_a_sweep_is_in_the_folder_of_its_name(name: str, home: Path) -> None:
    plan, folder, joined = plan_of(home.parent, SMALL), Path(name, "out"), Path(name, "all")
    write_plan(folder, plan)
    assert fill(plan, folder, here, chunk=4)
    assert merge((folder,), joined) == plan
    grown = plan_of(home.parent, SMALL.replace("seeds = 2", "seeds = 3"))
    extend(joined, plan, grown)
    assert fill(grown, joined, here)
    assert fill(grown, joined, here, warn=pytest.fail), "it was taken for damaged"
    assert len(Sweep.read(joined)) == read_parquet(joined / "results.parquet").num_rows == 18
    assert len(rows_to_record(plan, folder, Wish.of("worst:2"))) == 2
    assert [path.name for path in Path().iterdir()] == [name]
    assert not list(home.iterdir())


@pytest.mark.parametrize("name", NAMES)
def test_a_video_is_in_the_folder_of_its_name(name: str, home: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    camera = load_calibration(scenarios_folder() / "calibration" / "lab_camera.yaml").camera
    film = Path(name, f"{name[:-1]}1:%d.mp4")
    film.parent.mkdir()
    write_video(film, [np.zeros((480, 640, 3), np.uint8)] * 3, (640, 480), 30.0)
    with open_footage(str(film), camera) as frames:
        assert len(list(frames)) == 3
    assert list(film.parent.iterdir()) == [film]
    assert not list(home.iterdir())


def test_a_viewer_is_told_where_a_recording_is_in_full(monkeypatch: pytest.MonkeyPatch) -> None:
    """To Rerun's viewer http:run.rrd would be an address, and -v.rrd an option."""
    asked: list[list[str]] = []

    def run(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        asked.append(command)
        return subprocess.CompletedProcess(command, 0)

    Path("http:run.rrd").write_bytes(viewer.MAGIC)
    monkeypatch.setattr(viewer, "display", lambda: "X11 :0")
    monkeypatch.setattr(viewer, "window", lambda: viewer.Viewer(("rerun",)))
    monkeypatch.setattr(viewer.subprocess, "run", run)
    assert viewer.open_window(Path("http:run.rrd")) == 0
    assert asked == [["rerun", str(Path.cwd() / "http:run.rrd")]]
