"""Verdicts of real runs, and what the command line does with them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.runs.judgement.foresight import foretold
from ttwmr_mj.runs.judgement.verdict import demands_of
from ttwmr_mj.scenario.motion import sample_reference

LEAN = ["output.recording=false", "output.figures=false"]
LYAPUNOV = 'controller={kind="lyapunov"}'
TORQUES = ["controller={kind='custom', target='a:B'}", "control.inner_loop=torque"]
FAST = [LYAPUNOV, "plant.kind=analytic", "duration_s=10.0"]  # of inverted_trailer: it tips over


def verdict(name: str, *overrides: str) -> tt.Verdict:
    (found,) = tt.simulate(tt.load_scenario(name, list(overrides))).verdicts
    return found


def ttwmr(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def run(name: str, *overrides: str, cwd: Path, more: tuple[str, ...] = ()) -> tuple[int, str, str]:
    sets = [word for item in (*overrides, *LEAN) for word in ("--set", item)]
    done = ttwmr("run", name, *sets, "--out", "out", *more, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


def test_a_law_that_lets_the_trailer_fall_over_is_found_out() -> None:
    found = verdict("inverted_trailer", LYAPUNOV, "duration_s=15.0")
    assert found.name == "tractor_follows_trailer_lost"
    assert found.number is not None
    assert found.number > 1.0


@pytest.mark.slow
def test_a_trailer_that_the_tyres_cannot_hold_is_not_feasible() -> None:
    """On ice; tyres that slide chatter by micrometres, and are on the ground."""
    found = verdict("inverted_trailer", "plant.contact.floor_friction=0.05", "duration_s=5.0")
    assert found.name == "reference_not_feasible"
    assert found.what.startswith("the reference asks the tyres for 0.955 N (limit 0.271 N); ")


@pytest.mark.slow
def test_wheels_that_cannot_turn_fast_enough() -> None:
    overrides = ["reference.angular_rate_rad_s=1.5", "plant.kind=analytic", "duration_s=5.0"]
    found = verdict("inverted_trailer", *overrides)
    assert found.name == "reference_not_feasible"
    assert (found.number, found.limit) == (pytest.approx(47.1, abs=0.05), 40.0)


def test_a_camera_that_is_covered_for_half_of_the_run_is_blind() -> None:
    blackout = "sensing.camera.faults.delivery.blackouts=[{start_s=1.0, end_s=2.0}]"
    overrides = ["plant.kind=analytic", "duration_s=2.0", blackout]
    scenario = tt.load_scenario("lab_circle_camera", overrides)
    (found,) = tt.simulate(scenario, scenario_folder=Path("scenarios")).verdicts
    assert found.name == "blind"
    assert found.number is not None
    assert 0.35 < found.number < 0.5  # 0.15 s without a frame are bridged


def test_a_servo_that_is_too_slow_for_the_gains_saturates_throughout() -> None:
    """A metre behind at a speed next to the servo's own: it never catches up."""
    overrides = [
        "plant.kind=analytic",
        "duration_s=5.0",
        "reference.speed_m_s=0.165",
        "reference.ramp_s=0.0",
        "initial.x_m=-2.6",
        "controller.alpha1=200.0",
    ]
    found = verdict("straight_line", *overrides)
    assert found.name == "saturated_throughout", str(found)


def test_a_short_run_is_lost_while_its_start_is_not_worked_off() -> None:
    found = verdict("lab_circle", "plant.kind=analytic", "duration_s=2.0")
    assert found.name == "lost"


@pytest.mark.slow
def test_the_verdict_is_printed_first_and_the_tasks_metric_next(tmp_path: Path) -> None:
    code, out, err = run("inverted_trailer", *FAST, cwd=tmp_path)
    first, second, blank, *_ = out.splitlines()
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert (code, err, blank) == (0, "", "")
    assert first == f"tractor follows, trailer lost: {metrics['verdict_reason']}"
    assert metrics["verdict"] == "tractor_follows_trailer_lost"
    assert metrics["status"] == "ok"
    number = metrics["steady_centre_of_oscillation_rmse_m"]
    assert second == f"steady_centre_of_oscillation_rmse_m = {number:.3g}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wanted", "code"), [("followed", 1), ("lost", 1), ("tractor_follows_trailer_lost", 0)]
)
def test_what_is_required_decides_the_exit_code(wanted: str, code: int, tmp_path: Path) -> None:
    more = ("--require", wanted, "--quiet")
    found, out, err = run("inverted_trailer", *FAST, cwd=tmp_path, more=more)
    assert (found, out) == (code, "out\n")  # where it is
    if code:
        assert err.startswith(f"ttwmr: inverted_trailer was required to be {wanted!r} and is not: ")
        assert "θ2 " in err
        assert "(limit 0.2 rad)" in err
    else:
        assert err == ""


def test_a_requirement_is_checked_before_the_run(tmp_path: Path) -> None:
    code, _, err = run("lab_circle", cwd=tmp_path, more=("--require", "won"))
    assert code == 2
    assert "--require: got 'won'; allowed: " in err
    assert "tractor_follows_trailer_lost" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_run_that_is_required_to_fail_may(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(
        "import ttwmr_mj as tt\nclass Bad(tt.Controller):\n"
        "    def start(self, task): pass\n    def command(self, k, estimate): raise ValueError\n"
    )
    (tmp_path / "bad.toml").write_text(
        'name = "bad"\nduration_s = 1.0\nplant.kind = "analytic"\n[reference]\nkind = "circle"\n'
        'radius_m = 0.5\nangular_rate_rad_s = 0.1\n[controller]\nkind = "custom"\n'
        'target = "bad:Bad"\n'
    )
    assert run("bad.toml", cwd=tmp_path)[0] == 1
    more = ("--require", "failed", "--force")
    assert run("bad.toml", cwd=tmp_path, more=more)[0] == 0


@pytest.mark.slow
def test_what_cannot_be_driven_is_told_before_the_run(tmp_path: Path) -> None:
    words = ["--set", "reference.angular_rate_rad_s=1.5", "--set", "duration_s=1.0"]
    done = ttwmr("validate", "inverted_trailer", "outer_circle", *words, cwd=tmp_path)
    line = (
        "ttwmr: warning: inverted_trailer: reference: turns a wheel at 47.1 rad/s at 0 s, where P "
        "is at (0.76, 0.00) m; throughout; allowed: 40 rad/s (robot.servo.speed_limit_rad_s); "
        "possible at 0.848 of the pace: reference.angular_rate_rad_s=1.27\n"
    )
    valid = "inverted_trailer: valid\nouter_circle: valid\n"
    assert (done.returncode, done.stdout, done.stderr) == (0, valid, line)
    overrides = [*LEAN, "plant.kind=analytic", "reference.angular_rate_rad_s=1.5", "duration_s=1.0"]
    code, _, err = run("inverted_trailer", *overrides, cwd=tmp_path)
    assert (code, err) == (0, line)
    code, _, err = run("inverted_trailer", *overrides, cwd=tmp_path, more=("--force", "--quiet"))
    assert (code, err) == (0, "")


def test_only_contact_physics_needs_grip_and_torque() -> None:
    heavy = ["robot.trailer.mass_kg=50.0"]
    assert len(foretold(tt.load_scenario("inverted_trailer", heavy))) == 1
    analytic = [*heavy, "plant.kind=analytic"]
    assert foretold(tt.load_scenario("inverted_trailer", analytic)) == []
    slippery = ["plant.contact.floor_friction=0.15"]  # of 0.9, where 4.87 N are there and 0.96 used
    (line,) = foretold(tt.load_scenario("inverted_trailer", slippery))
    assert "allowed: 0.812 N (plant.contact.floor_friction)" in line


@pytest.mark.parametrize(
    ("changes", "limits"),
    [
        ([], {"wheel speed", "wheel acceleration", "wheel torque", "grip"}),
        (["plant.kind=analytic"], {"wheel speed", "wheel acceleration"}),
        (
            ["plant.kind=analytic", "control.inner_loop=computed_torque"],
            {"wheel speed", "wheel acceleration", "wheel torque"},
        ),
        (["plant.kind=analytic", *TORQUES], {"wheel torque"}),
        (TORQUES, {"wheel torque", "grip"}),
        ([*TORQUES, "robot.servo.motor={}"], {"wheel torque", "grip", "motor voltage"}),
    ],
)
def test_what_no_part_limits_is_no_demand(changes: list[str], limits: set[str]) -> None:
    scenario = tt.load_scenario("inverted_trailer", changes)
    demands = demands_of(scenario, sample_reference(scenario))
    assert demands is not None
    every = {"defined", "no side slip", "free trailer", "flatness, least |F''|"}
    assert {demand.name for demand in demands.checks} == every | limits


@pytest.mark.parametrize(
    "override",
    [
        "ground.slope_rad=0.01",
        "robot.casters.rolling_resistance_m=1e-4",
        "robot.hitch.coulomb_friction_n_m=1e-4",
        "robot.hitch.stiffness_n_m_rad=0.002",
    ],
)
def test_a_flat_reference_is_made_for_what_acts_on_the_trailer(override: str) -> None:
    scenario = tt.load_scenario("outer_circle", [override])
    demands = demands_of(scenario, sample_reference(scenario))
    assert demands is not None
    assert demands["free trailer"].kept
    plain = scenario.reference.sample(0.033 * np.arange(300), scenario.robot)
    unmade = demands_of(scenario.model_copy(update={"duration_s": 5.0}), plain)
    assert unmade is not None
    assert unmade["free trailer"].kept is ("coulomb" in override)  # which it may lean on


def test_limits_of_a_scenario_are_checked() -> None:
    with pytest.raises(tt.InputError, match=r"accept\.end_tractor_m: got 0"):
        tt.load_scenario("lab_circle", ["accept.end_tractor_m=0.0"])
    with pytest.raises(tt.InputError, match=r"accept\.verdict: got 'won'; allowed: .*'followed'"):
        tt.load_scenario("lab_circle", ["accept.verdict=won"])
    strict = ["plant.kind=analytic", "duration_s=3.0", "accept.end_tractor_m=1e-9"]
    assert verdict("rest_to_rest", *strict).name == "lost"


@pytest.mark.slow
def test_a_comparison_tells_the_verdicts_of_both_plants(tmp_path: Path) -> None:
    words = ["--set", "duration_s=3.0", "--set", "output.recording=false"]
    words += ["--set", "output.figures=false", "--no-attribution", "--out", "out"]
    done = ttwmr("compare", "outer_circle", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    verdicts = json.loads((tmp_path / "out" / "compare.json").read_text())["verdicts"]
    assert done.stdout.splitlines()[:2] == [f"{kind}: {words}" for kind, words in verdicts.items()]
    assert verdicts.keys() == {"contact", "analytic"}
    assert {words.split(":")[0] for words in verdicts.values()} == {"followed"}
