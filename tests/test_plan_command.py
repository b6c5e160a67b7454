"""`ttwmr plan` on the command line: its options, and the scenario that drives a plan."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.command_line import parse
from ttwmr_mj.cli.commands.plan import PlanCommand
from ttwmr_mj.cli.main import main
from ttwmr_mj.planning.deliver import replaced
from ttwmr_mj.references.planned import Knots
from ttwmr_mj.scenario.file import check_scenario

pytest.importorskip("casadi")


def ttwmr(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_command_plans_and_its_scenario_follows(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("-0.4,-0.1\n0,0.1\n0.4,-0.1\n")
    lean = ["--set", "output.recording=false", "--set", "output.figures=false"]
    done = ttwmr("plan", "way.csv", "--out", "my path.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "what limits it" in done.stdout
    assert "drive it: ttwmr run 'my path.toml'" in done.stdout
    assert (tmp_path / "my path.png").stat().st_size > 10_000
    assert not Knots.read(str(tmp_path / "my path.csv")).periodic
    assert tt.load_scenario(str(tmp_path / "my path.toml")).name == "my_path"
    run = ttwmr("run", "my path.toml", "--require", "followed", *lean, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stderr == ""  # nothing that cannot be followed
    again = ttwmr("plan", "way.csv", "--out", "my path.csv", cwd=tmp_path)
    assert (again.returncode, "already" in again.stderr) == (2, True)
    # of a scenario: its robot, and what drives it
    words = ["--scenario", "outer_circle", "--set", "robot.tractor.mass_kg=1.0", "--closed"]
    done = ttwmr("plan", "way.csv", *words, "--quiet", "--out", "round.csv", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    scenario = tt.load_scenario(str(tmp_path / "round.toml"))
    assert scenario.robot.tractor.mass_kg == 1.0
    assert scenario.robot.servo.preset == "fast"
    assert scenario.controller.kind == "flatness"
    assert Knots.read(str(tmp_path / "round.csv")).periodic


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--out", "plan.txt"], "a file that ends in .csv"),
        (["--set", "robot.tractor.mass_kg=1"], "no --scenario"),
        (["--fragment", "mine.toml"], "--fragment: there is no --scenario"),
        (["--seed", "0"], "--seed: there is no --scenario"),
        (["--workspace", "1.0"], "width and height"),
        (["--workspace", "1e300", "1e300"], "--workspace: got 1e+300 1e+300; allowed: width"),
        (["--workspace", "0.1", "1"], "each 0.3 to 1000 m"),
        (["--workspace", "0.7", "0.7"], "way.csv: 1 error\n  points.1: got (-0.4, -0.1) m"),
        *((["--duration", t], "allowed: 0.1 to 3600 s") for t in ("nan", "-1", "0", "1e300")),
        *((["--hitch-angle", a], "allowed: 0.1 to 180 degrees") for a in ("nan", "0", "1e9")),
        *((["--scale", m], "allowed: 1e-06 to 1000 m") for m in ("nan", "-0.001", "1e300")),
        (["--scale", "0.01"], "is no .svg; a table is in metres"),
        (["--out", "no/such/plan.csv"], "--out: there is no folder no/such; make it first"),
        (["--out", "way.csv", "--force"], "way.csv, which it is made from"),
        (["--out", "./mine.csv", "--force", "--scenario", "mine.toml"], "mine.toml, which it is"),
        (["--out", "linked.csv", "--force"], "linked.csv, which it is made from"),
    ],
)
def test_options_that_make_no_sense(
    words: list[str],
    problem: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    way = "-0.4,-0.1\n0,0.1\n0.4,-0.1\n"
    Path("way.csv").write_text(way)
    Path("linked.csv").symlink_to("way.csv")
    Path("mine.toml").write_text("seed = 1\n")
    before = sorted(tmp_path.iterdir())
    assert main(["plan", str(tmp_path / "way.csv"), *words]) == 2
    assert problem in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before
    assert Path("way.csv").read_text() == way


def test_what_changes_the_scenario_is_in_the_one_that_drives_the_plan(tmp_path: Path) -> None:
    fragment = tmp_path / "fitted.toml"
    fragment.write_text("[robot.tractor]\nmass_kg = 1.1\n")
    words = ["--fragment", str(fragment), "--seed", "7", "--set", "robot.trailer.mass_kg=0.4"]
    command = parse(["plan", "way.csv", "--scenario", "outer_circle", *words])
    assert isinstance(command, PlanCommand)
    data, robot, _ = command._robot()
    assert (data["seed"], data["robot"]["tractor"]["mass_kg"]) == (7, 1.1)
    assert (robot.tractor.mass_kg, robot.trailer.mass_kg) == (1.1, 0.4)


def test_fragments_are_merged_as_into_any_scenario(tmp_path: Path) -> None:
    hitch, tractor = tmp_path / "hitch.toml", tmp_path / "tractor.toml"
    hitch.write_text("[[robot.hitches]]\ndamping_n_m_s_rad = 0.01\n")
    tractor.write_text("[robot.tractor]\nmass_kg = 1.1\n")
    words = ["--fragment", str(hitch), "--fragment", str(tractor)]
    command = parse(["plan", "way.csv", "--scenario", "lab_circle", *words])
    assert isinstance(command, PlanCommand)
    _, robot, _ = command._robot()
    assert (robot.hitch.damping_n_m_s_rad, robot.tractor.mass_kg) == (0.01, 1.1)


def test_a_plan_is_made_anew_for_a_robot_that_the_scenarios_own_does_not_fit() -> None:
    """Which is what the fault of the plan says to do."""
    heavier = ["--set", "robot.trailer.mass_kg=0.5"]
    with pytest.raises(tt.InputError, match=r"plan anew .*--scenario"):
        tt.load_scenario("rest_to_rest", heavier[1:])
    command = parse(["plan", "way.csv", "--scenario", "rest_to_rest", *heavier])
    assert isinstance(command, PlanCommand)
    assert command._robot()[1].trailer.mass_kg == 0.5
    wrong = parse(["plan", "way.csv", "--scenario", "rest_to_rest", "--set", "controller.odd=1"])
    assert isinstance(wrong, PlanCommand)
    with pytest.raises(tt.InputError, match=r"controller\.odd: unknown key"):
        wrong._robot()


def test_what_drives_a_plan_can_drive_it() -> None:
    """Its files are found from anywhere, and its law can make the way."""
    command = parse(["plan", "way.csv", "--scenario", "inverted_trailer_camera"])
    assert isinstance(command, PlanCommand)
    data = command._robot()[0]
    assert Path(data["sensing"]["calibration_path"]).is_file()
    assert data["controller"]["kind"] == "flatness"
    assert replaced(data)["controller"]["kind"] == "flatness"
    assert replaced(data, rests=True)["controller"]["kind"] == "tvlqr"


def test_all_options_that_make_no_sense_are_told_at_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["--duration", "-1", "--hitch-angle", "nan", "--scale", "0", "--workspace", "2"]
    assert main(["plan", "way.csv", *words, "--set", "a=1", "--out", "plan.txt"]) == 2
    told = capsys.readouterr().err
    names = ("--duration", "--hitch-angle", "--scale", "--workspace", "--set", "--out")
    assert all(f"{name}: " in told for name in names), told


def test_a_plan_is_for_the_robot_that_is_believed_in() -> None:
    """For which references are made."""
    believed = ["--set", "belief.robot.trailer.com_offset_m=0.13"]
    command = parse(["plan", "way.csv", "--scenario", "inverted_trailer", *believed])
    assert isinstance(command, PlanCommand)
    data, robot, _ = command._robot()
    scenario = check_scenario(data, "a test")
    assert scenario.robot.trailer.com_offset_m == 0.141
    assert robot == scenario.believed_robot != scenario.robot


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["initial.x_offset_m=0.1"], ["--set initial.x_offset_m=0.1: the plan replaces initial"]),
        (["reference.radius_m=0.5"], ["the plan replaces reference; it is the plan"]),
        (["duration_s=3.0", "name=mine"], ["--duration is", "the plan replaces name"]),
        (["controller.kind=lyapunov"], ["controller; its kind must be .*: mpc, tvlqr\n"]),
        (["controller.kind=flatness"], ["controller; its kind must be .*: mpc, tvlqr\n"]),
        (["controller.kind=lyapunov", "--closed"], [": flatness, mpc, tvlqr\n"]),
        (["seed=3", "--fragment", "all.toml"], ["--fragment all.toml: the plan replaces name"]),
    ],
)
def test_what_is_set_is_not_lost_without_a_word(
    words: list[str],
    told: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("way.csv").write_text("-0.4,-0.1\n0,0.1\n0.4,-0.1\n")
    Path("all.toml").write_text('name = "all"\n[robot.trailer]\nmass_kg = 0.3\n')
    given = [word for one in words for word in (["--set", one] if "=" in one else [one])]
    assert main(["plan", "way.csv", "--scenario", "inverted_trailer", *given]) == 2
    error = capsys.readouterr().err
    assert all(re.search(words, error) for words in told), error
    assert not list(tmp_path.glob("*plan*"))


def test_what_is_accepted_of_a_plan_is_what_the_user_says() -> None:
    """The scenario's own limits are of its own motion."""
    words = ["plan", "way.csv", "--scenario", "inverted_trailer"]
    alone, wished = parse(words), parse([*words, "--set", "accept.end_theta2_rad=0.3"])
    assert isinstance(alone, PlanCommand)
    assert isinstance(wished, PlanCommand)
    assert tt.load_scenario("inverted_trailer").accept.verdict == "followed"
    assert "accept" not in alone._robot()[0]
    data = wished._robot()[0]
    assert data["accept"] == {"end_theta2_rad": 0.3}
    wished._refuse_what_is_lost(data, rests=True)  # which it is not
