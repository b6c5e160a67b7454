"""Texts from strangers' files and exceptions: shown, and obeyed by nothing that shows them."""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from test_hostile_arrays import law_beside

from ttwmr_mj.cli.commands.bench import _told_not_run
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import Fault, InputError, described, in_markdown, of_system
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.report import details_text, result_text, summary
from ttwmr_mj.scenario.file import check_scenario, load_scenario
from ttwmr_mj.studies.bench import scoring
from ttwmr_mj.studies.bench.leaderboard import to_markdown
from ttwmr_mj.studies.bench.lines import COLUMNS, Line, Run
from ttwmr_mj.studies.bench.page import to_html
from ttwmr_mj.studies.bench.scoring import Board, maker_of
from ttwmr_mj.studies.bench.suite import load_suite

EVIL = "\x1b]0;owned\x07<script>alert(1)</script> ![x](http://a/b) `rm` | a | b\n# Best\n```\n- x"


def is_harmless(text: str) -> bool:
    """Whether a Markdown text has none of EVIL's marks unescaped, and no control character."""
    plain = text.replace("\\\\", "").replace("\\<", "").replace("\\[", "").replace("\\`", "")
    marks = ("<script", "![x](", "`rm`", "\x1b", "\x07", "\n# Best", "\n- x")
    return not any(mark in plain for mark in marks) and "owned" in text


def test_one_line_and_no_mark() -> None:
    told = in_markdown(EVIL)
    assert is_harmless(told)
    assert "\n" not in told
    assert r"\| a \| b" in told
    assert in_markdown("θ2 of robot.trailer.mass_kg, (1, 2): 5 %") == (
        "θ2 of robot.trailer.mass_kg, (1, 2): 5 %"
    )


def test_an_exception_is_told_without_commands() -> None:
    assert described(ValueError(EVIL)).startswith("ValueError: \\x1b]0;owned\\x07<script>")


def test_a_name_with_line_breaks_stays_in_its_line() -> None:
    name = "a\nttwmr: all is well\r\u2028b.toml"
    faults = Fault(key=("x\ny",), problem=f"no {name}"), Fault(problem="two")
    for error, lines in (
        (InputError(faults[0], file=name), 2),
        (InputError(*faults, file=name), 3),
        (InputError(*faults), 2),
        (InputError(faults[1], file=name), 1),
    ):
        assert len(str(error).splitlines()) == lines
        assert "\\nttwmr: all is well" in str(error)
    assert "\n" not in of_system(FileNotFoundError(2, "missing", name))


def test_a_run_tells_a_stranger_s_words_in_panels() -> None:
    text = {"name": "mine", "duration_s": 1.0, "description": EVIL, "reference": {"kind": "none"}}
    segment = {"duration_s": 1.0, "wheel_right_rad_s": 1.0, "wheel_left_rad_s": 1.0}
    text["controller"] = {"kind": "open_loop", "segments": [segment]}
    text["plant"] = {"kind": "analytic"}
    scenario = check_scenario(text, "mine")
    metrics = dict.fromkeys(("tractor_rmse_m",), None)
    from ttwmr_mj.runs import report

    metrics |= {key: None for key, *_ in report.RESULT_ROWS} | dict.fromkeys(report.HEADLINES)
    metrics |= {"verdict": "failed", "verdict_reason": f"controller raised {EVIL}"}
    for told in (summary(scenario), result_text(scenario, metrics), details_text(metrics)):
        assert is_harmless(told), told


def test_a_leaderboard_tells_a_stranger_s_words() -> None:
    names = {"controller": "a", "task": "b", "plant": "c", "sensing": "d", "disturbance": "none"}
    run = Run(0, "failed", f"failed: {EVIL}", False, dict.fromkeys(COLUMNS))
    line = Line(names, (run,), "steady", True, f"ttwmr run x --set 'a={EVIL}'", None)
    board = Board([line], 1, Counter({f"version {EVIL}": 1}))
    text = to_markdown(board, f"mine: {EVIL}")
    commands = text[text.index("```sh") :]
    assert commands.count("```") == 2
    assert "\x1b" not in text
    assert is_harmless(text[: text.index("```sh")])
    page = to_html(board, f"mine: {EVIL}")
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page


SUITE = """
name = "mine"
controller.law.overrides = []
task.circle.scenario = "lab_circle"
plant.analytic.overrides = ["plant.kind=analytic"]
"""


def test_a_reason_of_several_lines_begins_with_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "suite.toml").write_text(SUITE)
    for length in (1, 900):
        reason = "failed at 0.033 s: RuntimeError: boom\x1b[31m\n" + "and more\n" * length
        stored = {"status": "failed", "reason": reason}
        monkeypatch.setattr(scoring, "stored_row", lambda *_, stored=stored: stored)
        (line,) = scoring.collect(load_suite(str(tmp_path / "suite.toml")), tmp_path).lines
        (run,) = line.runs
        assert run.sentence.startswith(r"failed at 0.033 s: RuntimeError: boom\x1b[31m\nand more")
        assert len(run.sentence) <= 1000
    told = _told_not_run({"a-row": "one\ntwo\n", "b-row": "one\ntwo\n"})
    assert told.splitlines()[1:] == [r"  a-row and 1 more: one\ntwo"]


def test_who_made_a_run_is_told_in_a_line(tmp_path: Path) -> None:
    manifest = tmp_path / "manifest.json"
    for version, commit, told in (
        ("1.2", "0123456789abcdef-dirty", "version 1.2, commit 0123456789ab-dirty"),
        (EVIL, None, r"version \x1b]0;owned\x07<script>alert(1)</script>"),
        ("1.2", f"abc-{EVIL}", r"version 1.2, commit abc-\x1b]0;owned\x07<script>"),
        (["1.2"], "abc", "unknown"),
    ):
        manifest.write_text(json.dumps({"ttwmr_mj": version, "git_commit": commit}))
        maker = maker_of(tmp_path)
        assert maker.startswith(told)
        assert len(maker.splitlines()) == 1
        assert "\x1b" not in maker


def test_a_run_that_is_scored_again_commands_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = ["output.recording=false", "output.figures=false", "plant.kind=analytic"]
    run_scenario(load_scenario("lab_circle", ["duration_s=0.1", *bare]), tmp_path)
    file = tmp_path / "metrics.json"
    said = json.loads(file.read_text()) | {"status": "failed", "reason": EVIL}
    file.write_text(json.dumps(said))
    assert main(["score", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("failed: \\x1b]0;owned\\x07<script>")
    assert "\x1b" not in told
    assert "\n# Best" not in told


def test_the_terminal_gets_no_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    law_beside(tmp_path, "at_command", f"raise ValueError({EVIL!r})", "evil_law")
    line = ["run", "mine.toml", "--out", "out", "--require", "failed"]
    bare = ["--set", "output.recording=false", "--set", "output.figures=false"]
    assert main([*line, *bare]) in (0, 1)
    told = capsys.readouterr()
    assert "owned" in told.out + told.err
    assert "\x1b" not in told.out + told.err
    assert "\x1b" not in (tmp_path / "out" / "metrics.json").read_text()
    sweep = f'name = "s"\nscenario = "lab_circle"\ndescription = {tomli(EVIL)}\n'
    sweep += '[parameters]\n"robot.trailer.mass_kg" = {values = [0.2, 0.3]}\n'
    (tmp_path / "s.toml").write_text(sweep)
    assert tomllib.loads(sweep)["description"] == EVIL
    assert main(["sweep", "s.toml", "--dry-run"]) == 0
    assert "\x1b" not in capsys.readouterr().out


def tomli(text: str) -> str:
    import tomli_w

    return tomli_w.dumps({"a": text}).partition(" = ")[2].strip()
