"""The scenario of a run folder: a record of every value, which defaults must not complete."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from run_folders import made

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.stored.resolved import read_resolved

TWISTED = ("accept.end_theta2_rad=1e-4", "belief.robot.trailer.mass_kg=0.3")  # all but defaults
FILE = "scenario.resolved.toml"


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    return made(folder, "outer_circle", "plant.kind=analytic", "duration_s=0.2", *TWISTED)


@pytest.fixture
def folder(kept: Path, tmp_path: Path) -> Path:
    return shutil.copytree(kept, tmp_path / "run")


def test_a_resolved_scenario_that_is_cut_off_anywhere_is_refused(
    kept: Path, tmp_path: Path
) -> None:
    whole = (kept / FILE).read_bytes()
    assert read_resolved(kept / FILE).accept.end_theta2_rad == 1e-4
    lines = [i + 1 for i, letter in enumerate(whole[:-1]) if letter == ord("\n")]
    last = range(len(whole) - 6, len(whole))  # in a number, of which digits may be left
    for end in (*lines, *last):
        (file := tmp_path / FILE).write_bytes(whole[:end])
        with pytest.raises(InputError, match=rf"{FILE}: "):
            read_resolved(file)


def test_what_a_cut_off_scenario_lacks_is_told_and_its_verdict_stays(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, said = folder / FILE, (folder / "metrics.json").read_bytes()
    text = file.read_text()
    sensing, accept = text.index("[sensing]"), text.index("[accept]")
    for left, told in (
        (text[:accept], "lacks accept; a run's file"),
        (text[:accept] + "[accept]\n", " and 10 more; a run's file"),
        (text[:sensing], "lacks sensing, output, accept; "),
        (text.replace("settling_share", "# settling_share"), "lacks accept.settling_share; "),
        (
            text.replace("[plant.contact]\ntimestep_s", "[plant.contact]\n#"),
            "lacks plant.contact.timestep_s; ",
        ),
    ):
        file.write_text(left)
        for words in (["score", str(folder)], ["video", str(folder), "-o", f"{folder}.mp4"]):
            assert main([*words, "--quiet"]) == 2
            err = capsys.readouterr().err
            assert told in err
            assert "run the scenario again" in err
    assert (folder / "metrics.json").read_bytes() == said


def test_a_resolved_scenario_of_which_values_are_left_out_still_runs(folder: Path) -> None:
    text = (folder / FILE).read_text()
    (folder / FILE).write_text(text[: text.index("[accept]")])
    assert tt.load_scenario(folder / FILE).accept.end_theta2_rad != 1e-4


def test_a_pipe_in_its_place_is_not_waited_for(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / FILE).unlink()
    os.mkfifo(folder / FILE)
    for words in (["score", str(folder)], ["video", str(folder), "-o", f"{folder}.mp4"]):
        assert main([*words, "--quiet"]) == 2
        assert FILE in capsys.readouterr().err
