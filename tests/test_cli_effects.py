"""What options of the command line do, once they are read."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.runs.files.new_folder import kept


def test_compare_passes_on_what_was_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from ttwmr_mj.studies import compare

    asked: list[Any] = []

    def compare_scenario(scenario: Any, folder: Path, options: Any, **_: Any) -> Any:
        asked.append((scenario.name, scenario.seed, folder, options))
        return SimpleNamespace(report={}, breaches=("one: got 2", "two: got 3"))

    monkeypatch.setattr(compare, "compare_scenario", compare_scenario)
    monkeypatch.setattr(compare, "plain", lambda _: "in words")
    monkeypatch.chdir(tmp_path)
    words = "compare open_loop_turn --real-wheels --converge --fit --validate-on a --seed 5 "
    words += "--tolerance t.toml --out o --set output.recording=false"
    assert main(words.split()) == 1
    (((name, seed, folder, options)),) = asked
    assert (name, seed, folder) == ("open_loop_turn", 5, Path("o"))
    assert options == compare.Options(
        mode="open_loop",
        real_wheels=True,
        attribute=True,
        converge=True,
        fit=True,
        validate_on="a",
        tolerance=Path("t.toml"),
        recording=False,
        figures=True,
    )
    printed = capsys.readouterr()
    assert printed.out.startswith("in words\n\nfolder: o\n")
    assert "open_loop_turn exceeds t.toml; see o\n  one: got 2\n  two: got 3\n" in printed.err
    assert main(["compare", "open_loop_turn", "--no-attribution", "--mode", "closed_loop"]) == 1
    (_, _, folder, options) = asked[1]
    assert folder.parent == Path("results/open_loop_turn-compared")
    assert (options.mode, options.attribute, options.fit) == ("closed_loop", False, False)


def test_a_fragment_and_the_frames_of_a_run(tmp_path: Path) -> None:
    fragment = tmp_path / "fragment.toml"
    fragment.write_text("duration_s = 0.2\n[output]\nrecording = false\nfigures = false\n")
    words = ["run", "lab_circle_camera", "--fragment", str(fragment), "--save-frames"]
    assert main([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"frames", "metrics.json"}
    assert not (tmp_path / "out" / "run.rrd").exists()
    assert not (tmp_path / "out" / "figures").exists()


LEAN = ["--set", "plant.kind=analytic", "--set", "duration_s=0.2", "--set", "output.figures=false"]


@pytest.mark.parametrize(("name", "told"), [("my run's $1", "my run's $1"), ("-y", "./-y")])
def test_what_a_run_says_can_be_copied_to_a_shell(
    name: str,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "lab_circle", f"--out={name}", *LEAN]) == 0
    (line,) = re.findall("look at it: (.*)", capsys.readouterr().out)
    assert shlex.split(line) == ["ttwmr", "view", told]
    (Path(name) / "metrics.json").unlink()
    (line,) = re.findall("can be scored: (.*)", kept(Path(name)))
    assert shlex.split(line) == ["ttwmr", "score", told]
    assert main(["run", "lab_circle", "--out", "o", *LEAN, "--set", "output.recording=false"]) == 0
    assert "look at it" not in capsys.readouterr().out  # there is nothing to look at


@pytest.mark.parametrize("words", [["run"], ["compare", "--no-attribution"]])
def test_a_run_is_made_again_in_its_own_folder(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "lab_circle", "--out", "o", *LEAN]) == 0
    again = [*words, "o/scenario.resolved.toml", "--out", "o", "--force", "--quiet"]
    assert main([*again, "--set", "output.recording=false"]) == 0
    assert Path("o/scenario.resolved.toml").is_file()
    assert not Path("o/run.rrd").exists()


def test_a_fragment_that_is_wrong_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fragment = tmp_path / "fragment.toml"
    fragment.write_text("robot = 5\n")
    assert main(["validate", "lab_circle", "--fragment", str(fragment)]) == 2
    told = capsys.readouterr().err
    assert f"lab_circle.toml with {fragment}: 1 error" in told
    assert "robot: got 5; allowed: a table" in told


def test_validate_says_what_is_wrong_with_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.toml").write_text("speed = 1\n")
    wrong = [str(tmp_path / "a.toml"), str(tmp_path / "b.toml")]
    assert main(["validate", wrong[0], "lab_circle", wrong[1]]) == 2
    printed = capsys.readouterr()
    assert printed.out == "lab_circle: valid\n"
    assert f"ttwmr: {wrong[0]}: " in printed.err
    assert f"ttwmr: {wrong[1]}: no such scenario" in printed.err
    with pytest.raises(InputError):
        main(["validate", wrong[1], "--debug"])


def test_who_stops_reading_hears_no_complaint() -> None:
    pipe = f"{sys.executable} -m ttwmr_mj export-schema | head -n 1"
    done = subprocess.run(["bash", "-c", pipe], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("{\n", "")


def test_view_opens_what_was_meant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "bin"
    found = SimpleNamespace(origin=str(package / "__init__.py"))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: found)
    monkeypatch.setattr("ttwmr_mj.recording.stream.viewer.display", lambda: ":0")
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(("results/old/b.rrd", "results/new/c.rrd", "results/new/a.rrd")):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_bytes(b"RRF2")
        os.utime(name, (100 + k % 2, 100 + k % 2))  # c.rrd is the newest
    with pytest.raises(MachineError, match="pip install rerun-sdk"):
        main(["view", "--debug"])
    package.mkdir()
    (package / "rerun").write_text("#!/bin/sh\nfor last; do :; done\necho $last > seen\nexit 3\n")
    (package / "rerun").chmod(0o755)
    for words, opened in (
        (["view"], "results/new/c.rrd"),
        (["view", "results/new"], "results/new/a.rrd"),
        (["view", "results/old/b.rrd"], "results/old/b.rrd"),
    ):
        assert main(words) == 3
        assert Path("seen").read_text() == f"{tmp_path / opened}\n"
    assert main(["view", "bin"]) == 2
