"""`bench --rescore`: a row counts if it was run of the scenario that its suite gives it now."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.runs.files.folder import write_resolved
from ttwmr_mj.studies.bench.execute import row_folder, run_suite, stored_row
from ttwmr_mj.studies.bench.scoring import collect
from ttwmr_mj.studies.bench.suite import Suite, load_suite, rows_of

SUITE = """
name = "pair"
seeds = [1, 2]
[controller.a]
overrides = ['controller={kind="tvlqr"}']
[controller.b]
overrides = ['controller={kind="flatness"}']
[task.base]
scenario = "base.toml"
[plant.analytic]
overrides = ["plant.kind=analytic"]
"""
BASE = """
name = "base"
duration_s = 0.5
world = "unkind"
[initial]
kind = "on_reference"
x_offset_m = 0.02
[reference]
kind = "flat_circle"
radius_m = 0.6
angular_rate_rad_s = 0.3
[controller]
kind = "tvlqr"
"""
OWN = """
name = "own"
[controller.mine]
overrides = ['controller={kind="custom", target="mine:Mine", options={a=nan, b=inf}}']
[controller.elsewhere]
overrides = ['controller={kind="custom", target="mine:Mine", folder="laws"}']
[task.planned]
scenario = "planned.toml"
"""
PLANNED = """
name = "planned"
duration_s = 0.5
reference = {kind = "planned", plan = "plan.csv"}
controller = {kind = "tvlqr"}
"""
PLANS = Path(__file__).parents[1] / "ttwmr_mj" / "references" / "data"


def ended(folder: Path, suite: Suite, beside: Path) -> None:
    """What all rows leave that failed at once."""
    for row in rows_of(suite):
        into = row_folder(row, folder)
        into.mkdir(parents=True)
        write_resolved(into, row.load(), beside)
        told = {"status": "failed", "reason": "boom", "verdict": "failed", "run": row.command()}
        (into / "row.json").write_text(json.dumps(told))


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    (tmp_path / "suite.toml").write_text(SUITE)
    (tmp_path / "base.toml").write_text(BASE)
    ended(tmp_path / "out", load_suite(str(tmp_path / "suite.toml")), tmp_path)
    return tmp_path


def rescored(folder: Path) -> dict[str, str]:
    """Rows that are left out, and why."""
    return collect(load_suite(str(folder / "suite.toml")), folder / "out").damaged


def test_rows_of_another_law_or_seed_are_left_out(pair: Path) -> None:
    assert rescored(pair) == {}
    a, b = (pair / f"out/runs/{law}-base-analytic-truth-none-1" for law in "ab")
    for stranger, key in ((b, "controller.kind"), (a.with_name(f"{a.name[:-1]}2"), "seed")):
        before = (a / "scenario.resolved.toml").read_text()
        shutil.copy(stranger / "scenario.resolved.toml", a)
        ((name, why),) = rescored(pair).items()
        assert name == a.name
        assert why.startswith(f"{a / 'scenario.resolved.toml'}: is not what ")
        assert key in why
        (a / "scenario.resolved.toml").write_text(before)


def test_rows_of_another_command_are_left_out(
    pair: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, *_ = rows_of(load_suite(str(pair / "suite.toml")))
    into = row_folder(first, pair / "out")
    shutil.copytree(row_folder(second, pair / "out"), into, dirs_exist_ok=True)
    words = ["bench", str(pair / "suite.toml"), "--out", str(pair / "out"), "--rescore"]
    assert main([*words, "--quiet"]) == 1
    head, *told = capsys.readouterr().err.splitlines()
    assert "1 row is left out" in head
    assert "or not run as the suite says; without --rescore they are run again" in head
    was, now = second.command(), first.command()
    why = f"{into / 'row.json'}: was run as `{was}`; the suite has `{now}` for this row now"
    assert told == [f"  {first.key}: {why}"]
    (pair / "suite.toml").write_text(SUITE.replace("[1, 2]", "[2]").replace("flatness", "mpc"))
    ((name, why),) = rescored(pair).items()
    assert name == "b-base-analytic-truth-none-2"
    assert "the suite has `ttwmr run base.toml --set 'controller={kind=\"mpc\"}'" in why.replace(
        f"{pair}/", ""
    )


def test_rows_of_a_task_that_was_edited_since_are_left_out(
    pair: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edited = BASE.replace("0.6", "0.9").replace("0.02", "0.2")
    (pair / "base.toml").write_text(edited)
    words = ["bench", str(pair / "suite.toml"), "--out", str(pair / "out"), "--rescore"]
    assert main([*words, "--quiet"]) == 1
    head, *told = capsys.readouterr().err.splitlines()
    assert "4 rows are left out" in head
    assert "without --rescore they are run again" in head
    for line in told:
        assert f"is not what {pair / 'base.toml'} and the suite give this row now" in line
        assert "initial.x_offset_m, reference.radius_m" in line
    (pair / "base.toml").unlink()
    assert ["base.toml: no such scenario file" in why for why in rescored(pair).values()] == [
        True
    ] * 4


def test_what_was_not_run_and_what_is_left_out_are_told_together(
    pair: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["bench", str(pair / "suite.toml"), "--out", str(pair / "out"), "--quiet"]
    rows = rows_of(load_suite(str(pair / "suite.toml")))
    stopped, *others = (row.key for row in rows)
    monkeypatch.setattr(
        "ttwmr_mj.studies.bench.execute.run_suite", lambda *_, **__: {stopped: "stopped by Ctrl-C"}
    )
    for row in rows[:2]:  # the first one since before
        (row_folder(row, pair / "out") / "row.json").write_text("[]")
    assert main(words) == 1
    told = capsys.readouterr().err.splitlines()
    assert told[0].endswith(
        "1 row was not run, which is no fault of a law; the same command tries again:"
    )
    assert told[1] == f"  {stopped}: stopped by Ctrl-C"
    assert told[2].startswith("1 row is left out, as what was written is no run of the scenario")
    assert told[3].startswith(f"  {others[0]}: ")
    assert len(told) == 4
    board = (pair / "out" / "leaderboard.md").read_bytes()
    for row in rows:
        (row_folder(row, pair / "out") / "row.json").write_text("[]")
    assert main(words) == 1
    told = capsys.readouterr().err.splitlines()
    assert told[2].startswith("3 rows are left out, as what was written is no run of the scenario")
    assert len(told) == 6
    assert (pair / "out" / "leaderboard.md").read_bytes() == board  # of when there was something


def test_what_changes_no_number_leaves_no_row_out(pair: Path) -> None:
    edited = BASE.replace('"base"', '"renamed"\ndescription = "said otherwise"')
    (pair / "base.toml").write_text(f"{edited}[output]\nfigures = false\n")
    assert rescored(pair) == {}


def test_rows_are_found_where_suite_files_and_laws_have_moved(tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    for name, text in (("suite.toml", OWN), ("planned.toml", PLANNED)):
        (before / name).write_text(text)
    shutil.copy(PLANS / "rest_to_rest.csv", before / "plan.csv")
    ended(before / "out", load_suite(str(before / "suite.toml")), before)
    assert rescored(before) == {}
    shutil.copytree(before, after)
    assert rescored(after) == {}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "cannot be read as a row of a suite: Expecting value"),
        ('{"seed": NaN}', "cannot be read as a row of a suite: NaN is no finite number"),
        ("[]", "holds no object"),
        ("{}", "does not say how the run ended"),
        ({"run": "ttwmr"}, "run: got 'ttwmr'; allowed: the command of a run"),
        ({"run": "ttwmr run 'base.toml"}, "run: got "),
        ({"run": 3}, "run: got 3"),
        ({"run": None}, "run: got None"),
        ({"verdict": "followed"}, "does not say how the run ended"),
    ],
)
def test_a_damaged_row_is_told_with_its_file(
    text: str | dict[str, object], told: str, pair: Path
) -> None:
    first, *_ = rows_of(load_suite(str(pair / "suite.toml")))
    file = row_folder(first, pair / "out") / "row.json"
    if isinstance(text, dict):
        text = json.dumps(json.loads(file.read_text()) | text)
    file.write_text(text)
    with pytest.raises(InputError) as refused:
        stored_row(first, pair / "out")
    assert str(refused.value).startswith(f"{file}: ")
    assert told in str(refused.value)
    assert rescored(pair)[first.key].startswith(f"{file}: ")


@pytest.mark.slow
def test_rows_that_another_run_wrote_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(SUITE)
    noisy = f"{BASE}[sensing]\nposition_noise_m = 0.001\n".replace("unkind", "kind")
    (tmp_path / "base.toml").write_text(noisy)
    assert run_suite(load_suite(str(tmp_path / "suite.toml")), tmp_path / "out") == {}
    assert rescored(tmp_path) == {}
    a, b, other_seed = (
        tmp_path / f"out/runs/{name}"
        for name in (
            "a-base-analytic-truth-none-1",
            "b-base-analytic-truth-none-1",
            "a-base-analytic-truth-none-2",
        )
    )
    before = (a / "trajectory.parquet").read_bytes()
    shutil.copy(other_seed / "trajectory.parquet", a)
    why = rescored(tmp_path)[a.name]
    assert why.startswith(f"{a / 'trajectory.parquet'}: is not the one that this run wrote")
    (a / "made_of.json").rename(tmp_path / "aside")
    assert rescored(tmp_path) == {}  # nobody knows
    for name in ("trajectory.parquet", "scenario.resolved.toml"):
        shutil.copy(b / name, a)
    assert "controller.kind" in rescored(tmp_path)[a.name]
    (tmp_path / "aside").rename(a / "made_of.json")
    assert "controller.kind" in rescored(tmp_path)[a.name]
    assert run_suite(load_suite(str(tmp_path / "suite.toml")), tmp_path / "out") == {}
    assert rescored(tmp_path) == {}
    assert (a / "trajectory.parquet").read_bytes() == before
