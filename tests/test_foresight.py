"""What is said before a run, and that the advice in it is right."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.robot.motor import Motor
from ttwmr_mj.runs.judgement.foresight import foreseen

CIRCLE = "reference={kind='circle', radius_m=0.43, angular_rate_rad_s=0.3, theta2='none'}"


def circle(*overrides: str) -> tt.Scenario:
    return tt.load_scenario("lab_circle", [CIRCLE, *overrides])


def ttwmr(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("overrides", "asked", "key"),
    [
        (["reference.angular_rate_rad_s=0.4"], "turns a wheel at 7.53", "speed_limit_rad_s"),
        (
            ["robot.servo.acceleration_limit_rad_s2=2.0", "reference.ramp_s=2.0"],
            "accelerates a wheel by 6.1",
            "acceleration_limit_rad_s2",
        ),
        (["robot.servo.stall_torque_n_m=1e-4"], "asks a wheel for", "stall_torque_n_m"),
        (["plant.contact.floor_friction=0.004"], "asks the tyres for", "floor_friction"),
        (
            ["robot.servo.speed_limit_rad_s=40.0", "robot.servo.motor={}", "reference.ramp_s=1.0"]
            + ["reference.angular_rate_rad_s=0.4"],
            "asks a motor for 14",
            "supply_voltage_v",
        ),
    ],
)
def test_a_limit_is_said_with_what_would_keep_it(
    overrides: list[str], asked: str, key: str
) -> None:
    (fault,) = foreseen(circle(*overrides))
    assert fault.key == ("reference",)
    assert fault.problem.startswith(asked)
    assert f".{key})" in fault.allowed
    slower = re.findall(r"reference\.\w+=[\d.]+", fault.hint)
    assert slower, fault.hint
    assert foreseen(circle(*overrides, *slower)) == []
    # and it is the largest pace, but for the digits that are told
    name, value = slower[0].split("=")
    assert foreseen(circle(*overrides, *slower, f"{name}={1.02 * float(value)}"))


def test_a_slower_reference_made_anew_is_possible_where_balls_resist() -> None:
    """Stretched in time it keeps the balls' share of the motion, which is no smaller when slow."""
    ellipse = "{kind='flat_ellipse', half_axes_m=[0.6, 0.3], angular_rate_rad_s=10.0}"
    given = [f"reference={ellipse}", "world=unkind", "duration_s=5.0"]
    faults = foreseen(tt.load_scenario("outer_circle", given))
    assert len(faults) > 1
    for fault in faults:
        slower = re.findall(r"reference\.\w+=[\d.]+", fault.hint)
        again = foreseen(tt.load_scenario("outer_circle", [*given, *slower]))
        assert fault.allowed not in {left.allowed for left in again}, str(fault)


def test_a_motor_without_load_turns_as_fast_as_its_supply_allows() -> None:
    """V = N·K_e·ω and gear friction: 12 V, 254·0.00728 V·s, and 2.5 V of friction and damping."""
    motor = Motor()
    per_volt = motor.torque_per_ampere / motor.resistance_ohm
    free = (12.0 - motor.gear_friction_n_m / per_volt) / (
        motor.volts_per_speed + motor.gear_damping_n_m_s_rad / per_volt
    )
    line = ["robot.servo.speed_limit_rad_s=40.0", "robot.servo.motor={}"]
    for share, kept in ((0.98, True), (1.02, False)):
        speed = share * free * 0.026
        kind = f"reference={{kind='straight_line', speed_m_s={speed}, theta2='aligned'}}"
        assert (foreseen(tt.load_scenario("straight_line", [kind, *line])) == []) is kept


def test_where_and_when() -> None:
    """A figure eight is fastest at its crossing, first at the start; and slow at its turns."""
    eight = "{kind='figure_eight', half_width_m=0.4, half_height_m=0.2, period_s=15.0, ramp_s=3.0}"
    (fault, *_) = foreseen(tt.load_scenario("lab_circle", [f"reference={eight}"]))
    found = re.search(
        r"at ([\d.]+) s, where P is at \((-?[\d.]+), (-?[\d.]+)\) m; for", fault.problem
    )
    assert found, fault.problem
    time_s, x, y = map(float, found.groups())
    phi = 2.0 * np.pi / 15.0 * (time_s - 1.5)
    assert (x, y) == pytest.approx((0.4 * np.sin(phi), 0.2 * np.sin(2.0 * phi)), abs=0.01)


def test_a_trailer_that_cannot_follow_is_said_to_be_one() -> None:
    (fault,) = foreseen(circle("reference.theta2='aligned'", "reference.angular_rate_rad_s=0.125"))
    assert fault.problem.startswith("asks the hitch for 0.313 mN·m that it does not have")
    assert "reference.theta2='none'" in fault.hint
    assert "`ttwmr plan`" in fault.hint
    # with friction for a fast trailer, it can be had slower
    rusty = ["robot.hitch.coulomb_friction_n_m=2e-4", "robot.hitch.damping_n_m_s_rad=0.0"]
    (fault,) = foreseen(
        circle("reference.theta2='aligned'", "reference.angular_rate_rad_s=0.125", *rusty)
    )
    (slower,) = re.findall(r"reference\.angular_rate_rad_s=[\d.]+", fault.hint)
    # m2·l·R·ω² = 2e-4 N·m, and the checker's tolerance of 1e-5
    assert float(slower.split("=")[1]) == pytest.approx(0.125 * np.sqrt(0.21 / 0.313), rel=0.01)


def test_what_leaves_the_picture() -> None:
    big = ["reference.radius_m=0.9", "reference.angular_rate_rad_s=0.1"]
    assert foreseen(circle(*big)) == []
    (fault,) = foreseen(circle(*big, "sensing.kind='camera'"))
    assert "outside the camera's picture" in fault.problem
    assert "higher" in fault.hint
    assert foreseen(circle(*big, "sensing.kind='camera'", "sensing.camera.height_m=4.0")) == []


@pytest.mark.slow
def test_bench_says_it_once_for_all_laws(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "s"\nseeds = [0]\n[controller.a]\n[controller.b]\n'
        'overrides = ["controller.alpha1=30"]\n'
        '[task.fast]\nscenario = "lab_circle"\n'
        'overrides = ["reference.angular_rate_rad_s=0.5", "duration_s=0.5", '
        '"plant.kind=analytic"]\n'
        "[[block]]\n"
    )
    done = ttwmr("bench", "suite.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("turns a wheel at 9.4") == 1
    done = ttwmr("bench", "suite.toml", "--out", "out", "--quiet", cwd=tmp_path)
    assert "warning" not in done.stderr


@pytest.mark.slow
def test_a_sweep_says_how_many_rows(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        'name = "s"\nscenario = "lab_circle"\nseeds = [0]\n'
        'overrides = ["duration_s=0.5", "plant.kind=analytic"]\n'
        '[parameters]\n"reference.angular_rate_rad_s" = { values = [0.1, 0.2, 0.5] }\n'
    )
    done = ttwmr("sweep", "s.toml", "--dry-run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (
        "1 of the 3 rows that were looked at asks for what the robot cannot do; row 2: reference: "
        "turns a wheel at 9.4" in done.stderr
    )


def test_a_push_after_the_end_never_acts() -> None:
    push = "plant.pushes=[{start_s=5.0, duration_s=0.1, force_n=[0.1, 0.0]}]"
    assert foreseen(circle(push, "duration_s=10.0")) == []
    (fault,) = foreseen(circle(push, "duration_s=5.0"))
    assert fault.key == ("plant", "pushes", 0)
    assert "never acts" in fault.problem


def test_a_plan_is_not_told_to_be_planned() -> None:
    (fault,) = foreseen(tt.load_scenario("double_eight"))
    assert "a longer --duration asks for less" in fault.hint
    assert "flat_*" not in fault.hint


def test_no_pace_is_told_that_the_options_refuse() -> None:
    """30 s of ramp become more than the 600 s that there may be."""
    line = "reference={kind='straight_line', ramp_s=30.0, speed_m_s=5.3}"
    (fault,) = foreseen(circle(line, "initial={kind='at_rest'}", "duration_s=19.0"))
    assert fault.hint == "at no pace that the options of this reference allow is it possible"


def test_a_pace_too_slow_to_be_told_is_not_called_impossible() -> None:
    """At 0.0016 rad/s P goes at 0.16 m/s, which the wheels can do."""
    wide = ["reference.radius_m=100"]
    (fault,) = foreseen(tt.load_scenario("lab_circle", wide))
    assert fault.hint == "not possible at 0.02 of the pace, or faster"
    slow = "reference.angular_rate_rad_s=0.0016"
    assert foreseen(tt.load_scenario("lab_circle", [*wide, slow])) == []


def test_of_a_pace_that_is_not_found_no_more_is_told_than_is_known() -> None:
    """A flat ellipse turns P about its ends however slowly it is driven."""
    ellipse = "{kind='flat_ellipse', half_axes_m=[0.001, 2.0], angular_rate_rad_s=1.0}"
    given = [f"reference={ellipse}", "world=unkind", "duration_s=5.0"]
    hints = [fault.hint for fault in foreseen(tt.load_scenario("outer_circle", given))]
    assert "a faster one, or weaker forces, may have room" in hints[0]  # it is a flat_* already
    (told,) = [hint for hint in hints if "may be possible" in hint]
    assert re.fullmatch(r"at less than 0\.0\d+ of the pace it may be possible", told)


def test_a_tractor_whose_ball_is_behind_its_centre_of_mass_has_no_weight_on_its_wheels() -> None:
    ball = "robot.casters.tractor_position_m=0.002"
    stands, grips = foreseen(circle(ball))
    assert stands.key == ("robot", "casters", "tractor_position_m")
    assert "is 2 mm ahead of P, and its centre of mass 29 mm: no weight" in stands.problem
    assert stands.allowed == "more than 0.029 (robot.tractor.com_offset_m)"
    assert grips.problem.startswith("asks the tyres for ")
    assert grips.allowed == "0 N (robot.casters.tractor_position_m)"
    assert foreseen(circle(ball, "plant.kind='analytic'")) == []
    assert foreseen(circle("robot.casters.tractor_position_m=0.03")) == []
    (stands,) = foreseen(tt.load_scenario("open_loop_turn", [ball]))
    assert "no weight is on its wheels" in stands.problem
