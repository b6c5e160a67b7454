"""A folder of results: of one process, of one run, as it was where nothing came of it."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, RunError
from ttwmr_mj.results.row_stream import RowStream
from ttwmr_mj.runs.files.lock import locked
from ttwmr_mj.runs.files.new_folder import OURS, kept, new_folder, settle_the_dead

HOLD = """
import sys, time
from pathlib import Path
from ttwmr_mj.runs.files.lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def files(folder: Path) -> dict[str, str]:
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_text() for path in found}


def a_run(folder: Path) -> dict[str, str]:
    """A run's files, and one that is none of them."""
    for name in ("metrics.json", "trajectory.parquet", "figures/paths.png", "figures/mine.png"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"old {name}")
    return files(folder)


def a_row(path: Path) -> None:
    stream = RowStream(path)
    stream.append(tt.Trajectory.empty(np.zeros(1), 1))
    stream.close()


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with (
        pytest.raises(InputError, match=r"^--out: got .*inside; cannot make the folder: [A-Z]"),
        new_folder(tmp_path / "file" / "inside", force=False),
    ):
        pass
    with new_folder(tmp_path / "deep" / "down", force=False):
        pass
    with new_folder(tmp_path / "deep" / "down", force=False):  # empty
        (tmp_path / "deep" / "down" / "note").touch()
    with (
        pytest.raises(InputError, match=r"the folder is not empty; .* --force to replace the run"),
        new_folder(tmp_path / "deep" / "down", force=False),
    ):
        pass


def test_force_replaces_the_run_as_a_whole_and_nothing_else(tmp_path: Path) -> None:
    a_run(tmp_path)
    with new_folder(tmp_path, force=True):
        assert set(files(tmp_path)) > {".replaced/metrics.json", "figures/mine.png"}
        (tmp_path / "metrics.json").write_text("new")
        (tmp_path / "run.rrd").write_text("new")
    left = {"metrics.json": "new", "run.rrd": "new", "figures/mine.png": "old figures/mine.png"}
    assert files(tmp_path) == left
    assert not (tmp_path / ".replaced").exists()


@pytest.mark.parametrize(
    ("error", "recorded", "stays_old"),
    [
        (InputError("wrong"), True, True),  # exit code 2: as if nothing had been asked
        (FileExistsError(17, "in the way"), True, True),
        (KeyboardInterrupt(), False, True),
        (KeyboardInterrupt(), True, False),
        (RunError("broke"), True, False),
        (OSError(28, "full"), True, False),
    ],
)
def test_a_run_that_came_to_nothing_leaves_the_folder_as_it_was(
    error: BaseException, recorded: bool, stays_old: bool, tmp_path: Path
) -> None:
    before = a_run(tmp_path / "old")

    def fill(folder: Path) -> None:
        with new_folder(folder, force=True):
            (folder / "manifest.json").write_text("new")
            if recorded:
                (folder / "trajectory.parquet").write_text("new")
            raise error

    for name in ("old", "deep/new"):
        with pytest.raises(type(error)):
            fill(tmp_path / name)
    assert (files(tmp_path / "old") == before) == stays_old
    assert (tmp_path / "deep").exists() == (not stays_old)
    if not stays_old:
        assert set(files(tmp_path / "old")) == {
            "manifest.json",
            "trajectory.parquet",
            "figures/mine.png",
        }


def test_a_run_of_relative_links_is_there_again_or_replaced(tmp_path: Path) -> None:
    folder, store = tmp_path / "run", tmp_path / "store"
    a_run(store)
    folder.mkdir()
    names = ("metrics.json", "trajectory.parquet", "summary.png")
    for name in names:  # the last one leads nowhere
        (folder / name).symlink_to(Path("..") / "store" / name)
    with pytest.raises(InputError, match="wrong"), new_folder(folder, force=True):
        raise InputError("wrong")
    assert {path.name for path in folder.iterdir()} == {*names}
    assert (folder / "metrics.json").read_text() == "old metrics.json"
    with new_folder(folder, force=True):
        (folder / "metrics.json").write_text("new")
    assert {path.name for path in folder.iterdir()} == {"metrics.json"}
    assert (store / "metrics.json").read_text() == "old metrics.json"


@pytest.mark.parametrize("name", ["report.html", "summary.pdf", "figures/paths.png"])
def test_force_replaces_nothing_where_there_is_no_run(name: str, tmp_path: Path) -> None:
    for mine in (name, "notes.txt"):
        (tmp_path / mine).parent.mkdir(exist_ok=True)
        (tmp_path / mine).write_text("mine")
    with (
        pytest.raises(InputError, match=rf"holds {name}, and no run .*; give another one"),
        new_folder(tmp_path, force=True),
    ):
        pass
    assert files(tmp_path) == dict.fromkeys((name, "notes.txt"), "mine")
    (tmp_path / name).unlink()
    with new_folder(tmp_path, force=True):  # nothing is in the way
        pass
    assert files(tmp_path) == {"notes.txt": "mine"}


@pytest.mark.parametrize(("link", "to"), [("dead", "nowhere"), ("loop", "loop")])
def test_a_link_that_leads_nowhere_is_told(link: str, to: str, tmp_path: Path) -> None:
    (tmp_path / link).symlink_to(to)
    for folder in (tmp_path / link, tmp_path / link / "inside"):
        with (
            pytest.raises(InputError, match=rf"/{link} is a link that leads nowhere$"),
            new_folder(folder, force=False),
        ):
            pass


def test_a_recording_without_a_row_replaces_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = a_run(tmp_path)

    def stopped(*_: object) -> None:
        (tmp_path / "run.rrd").touch()  # a recorder does, before there is anything to record
        raise KeyboardInterrupt

    monkeypatch.setattr("ttwmr_mj.runs.law.laws.Laws.start", stopped)
    words = ["--out", str(tmp_path), "--force", "--quiet", "--set", "output.recording=false"]
    assert main(["run", "lab_circle", *words]) == 1
    assert capsys.readouterr().err == "ttwmr: stopped; nothing was recorded\n"
    assert files(tmp_path) == before


@pytest.mark.parametrize(
    "left", [["manifest.json"], ["manifest.json", "run.rrd", "trajectory.arrows", "track.rrd"]]
)
@pytest.mark.parametrize("error", [KeyboardInterrupt, InputError])
@pytest.mark.parametrize("settled", [False, True])
def test_what_a_killed_process_has_set_aside_is_not_lost(
    left: list[str], error: type[BaseException], settled: bool, tmp_path: Path
) -> None:
    before = a_run(tmp_path)
    for name in ("metrics.json", "trajectory.parquet", "figures/paths.png"):
        (tmp_path / ".replaced" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).rename(tmp_path / ".replaced" / name)
    for name in left:  # of the one that was killed
        (tmp_path / name).touch()
    if settled:
        assert settle_the_dead(tmp_path)
        assert files(tmp_path) == before
    with pytest.raises(error), new_folder(tmp_path, force=True):
        raise error("wrong")
    assert files(tmp_path) == before


def test_a_disk_that_is_full_before_the_first_row_loses_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = a_run(tmp_path)

    def full(stream: RowStream, _: object) -> None:
        stream._path.touch()  # opened, and nothing written
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(RowStream, "append", full)
    words = ["--out", str(tmp_path), "--force", "--quiet", "--set", "duration_s=0.1"]
    assert main(["run", "sim_circle", *words]) == 1
    assert "No space left on device; nothing was recorded\n" in capsys.readouterr().err
    assert files(tmp_path) == before


def test_score_puts_back_what_a_killed_run_was_to_replace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lean = ["duration_s=0.1", "output.recording=false", "output.figures=false"]
    folder = tt.run(tt.load_scenario("sim_circle", lean), tmp_path / "run").folder
    whole = {path.name for path in folder.iterdir()}
    (tmp_path / "aside").mkdir()
    for name in whole:
        (folder / name).rename(tmp_path / "aside" / name)
    (tmp_path / "aside").rename(folder / ".replaced")
    (folder / "scenario.resolved.toml").write_text("of the one that was killed")
    assert main(["score", str(folder)]) == 0
    assert "the one that it was to replace is there again" in capsys.readouterr().err
    assert {path.name for path in folder.iterdir()} == whole
    assert main(["score", str(folder)]) == 0
    assert capsys.readouterr().err == ""


def test_a_lock_ends_with_its_process_however_that_ends(tmp_path: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD, tmp_path], stdout=subprocess.PIPE)
    assert holder.stdout is not None
    told = f"fills this folder: process {holder.pid} on"
    with holder:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(InputError, match=told), locked(tmp_path):
            pass
        holder.send_signal(signal.SIGKILL)
    assert (tmp_path / ".lock").is_file()  # what is left of it is in nobody's way
    with new_folder(tmp_path, force=False), pytest.raises(InputError), locked(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["run"], ["compare", "--no-attribution"]])
def test_a_folder_in_use_is_refused_and_left_alone(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = a_run(tmp_path)
    command = [*words, "lab_circle", "--out", str(tmp_path), "--force"]
    with locked(tmp_path):
        assert main(command) == 2
    assert "this process fills this folder already" in capsys.readouterr().err
    assert files(tmp_path) == before


@pytest.mark.parametrize("number", [errno.EACCES, errno.EPERM, errno.EROFS])
@pytest.mark.parametrize("words", [["score"], ["run", "lab_circle", "--force", "--out"]])
def test_a_folder_that_may_not_be_written_in_is_refused_as_that(
    words: list[str],
    number: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "scenario.resolved.toml").touch()
    before = a_run(tmp_path)
    opened = Path.open

    def forbidden(path: Path, mode: str = "r", *args: Any, **options: Any) -> Any:
        if mode.startswith("a"):  # root may write anywhere
            raise OSError(number, os.strerror(number), str(path))
        return opened(path, mode, *args, **options)

    monkeypatch.setattr(Path, "open", forbidden)
    assert main([*words, str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert f"got {tmp_path}; cannot be written in, so that it cannot be locked" in error
    assert f"{os.strerror(number)}); allowed: a folder that you may write in" in error
    assert files(tmp_path) == before


def test_exit_2_leaves_nothing_that_would_refuse_the_retry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["run", "lab_circle", "--quiet", "--set", "output.figures=false"]
    no_law = ["--set", "controller.kind=custom", "--set", "controller.target=nowhere:Law"]
    assert main([*words, *no_law]) == 2
    assert main([*words, *no_law, "--out", "out"]) == 2
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "frames").touch()  # where frames cannot be put, seen after the first files
    with_camera = ["--set", "sensing.kind=camera", "--save-frames", "--force", "--out", "out"]
    assert main([*words, *with_camera]) == 2
    assert set(files(tmp_path)) == {"out/frames"}


@pytest.mark.parametrize(
    ("write", "told"),
    [
        (lambda folder: folder.rmdir(), "is gone"),
        (lambda folder: (folder / "manifest.json").touch(), "nothing was recorded"),
        (lambda folder: (folder / "trajectory.arrows").touch(), "nothing was recorded"),
        (lambda folder: a_row(folder / "trajectory.arrows"), "can be scored: ttwmr score"),
        (lambda folder: (folder / "run.rrd").write_text("opened"), "nothing was recorded"),
        (lambda folder: (folder / "track.rrd").write_text("frames"), "what was recorded is in"),
        (
            lambda folder: (folder / "metrics.json").write_text('{"status": "ok"}'),
            "the run is complete in",
        ),
        (lambda folder: (folder / "metrics.json").write_text("[]"), "nothing was recorded"),
    ],
)
def test_what_is_kept_is_told(write: Callable[[Path], object], told: str, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write(tmp_path / "out")
    assert told in kept(tmp_path / "out")


@pytest.mark.parametrize(("figures", "paper_plots"), [(False, False), (True, False), (False, True)])
def test_figures_are_missed_where_they_are_wanted(
    figures: bool, paper_plots: bool, tmp_path: Path
) -> None:
    output = {"figures": figures, "paper_plots": paper_plots}
    (tmp_path / "metrics.json").write_text('{"status": "ok"}')
    (tmp_path / "scenario.resolved.toml").write_text(tomli_w.dumps({"output": output}))
    assert ("figures may be missing" in kept(tmp_path)) == (figures or paper_plots)


@pytest.mark.slow
def test_every_file_of_a_run_is_known_as_one(tmp_path: Path) -> None:
    scenario = tt.load_scenario(
        "lab_circle", ["duration_s=1.0", "output.paper_plots=true", "output.physics_rate=true"]
    )
    tt.run(scenario, tmp_path / "run")
    words = ["lab_circle", "--out", str(tmp_path / "compare"), "--quiet"]
    assert main(["compare", *words, "--set", "duration_s=3.0"]) == 0
    for folder in (tmp_path / "run", tmp_path / "compare"):
        known = {path for name in OURS for path in folder.glob(name)}
        assert {path for path in folder.rglob("*") if path.is_file()} == known
