"""The feasibility checker, and the shipped plans against it."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from trains import train

from ttwmr_mj.dynamics.kinematics import to_body, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.kinetics import lateral_force, reduced_mass_matrix
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.figure_eight import FigureEight
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.flat_ellipse import FlatEllipse
from ttwmr_mj.references.planned import Knots, Planned, shipped_plans
from ttwmr_mj.references.shared.demand import Demand, Feasibility
from ttwmr_mj.references.shared.feasibility import _forces, check_feasibility
from ttwmr_mj.references.straight_line import StraightLine
from ttwmr_mj.robot import Hitch, RobotParameters, Servo, Trailer

FAST = RobotParameters(servo=Servo(preset="fast"))
LAB = RobotParameters()
TIME = np.arange(0.0, 15.0, 0.033)
FINE = np.arange(0.0, 7.0, 0.005)


def circle(robot: RobotParameters = FAST, **options: float) -> Feasibility:
    given = {"radius_m": 0.6, "angular_rate_rad_s": 1.0, **options}
    return check_feasibility(FlatCircle(**given).sample(TIME, robot), robot)  # type: ignore[arg-type]


def test_a_flat_circle_is_feasible_and_says_so() -> None:
    verdict = circle()
    assert verdict.feasible
    assert str(verdict).startswith("feasible: yes\nok")
    assert verdict["free trailer"].worst < 1e-12


def test_an_aligned_trailer_on_a_circle_is_not() -> None:
    """θ2 = θ1 on a circle demands k·θ̈2 = 0 = P''·n: the hitch would have to hold m2·l·Rω²."""
    path = Circle(radius_m=0.43, angular_rate_rad_s=0.125, theta2="aligned").sample(TIME)
    check = check_feasibility(path, LAB)["free trailer"]
    assert check.worst == pytest.approx(0.33 * 0.141 * 0.43 * 0.125**2, rel=1e-9)
    assert check.spans_s == ((TIME[0], TIME[-1]),)


def test_a_hitch_may_be_leant_on_in_proportion_to_the_robot() -> None:
    """Torques of a similar robot grow with the fourth power of its lengths."""
    limits = []
    for robot in (LAB, RobotParameters(preset="outdoor")):
        path = FlatCircle(radius_m=2.0, angular_rate_rad_s=0.1).sample(TIME, robot)
        limits.append(check_feasibility(path, robot)["free trailer"].limit)
    assert limits[0] == pytest.approx(1e-5, rel=1e-3)
    assert limits[1] / limits[0] == pytest.approx((60.0 / 26.0) ** 4, rel=1e-9)


def test_friction_can_hold_what_a_free_hitch_cannot() -> None:
    path = Circle(radius_m=0.43, angular_rate_rad_s=0.125, theta2="aligned").sample(TIME)
    rusty = LAB.model_copy(update={"hitch": Hitch(coulomb_friction_n_m=1e-3)})
    assert check_feasibility(path, rusty).feasible


def test_each_limit_is_named_when_broken() -> None:
    assert not circle(LAB)["wheel speed"].kept
    speed = circle()["wheel speed"]
    # u1 = (R − k)·ω and u2 = ω at the outer wheel
    assert speed.worst == pytest.approx((0.6 - FAST.swing_length_m + 0.0595) / 0.026, rel=1e-9)
    assert not circle(angular_rate_rad_s=5.0)["grip"].kept
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(TIME, FAST)
    outside = check_feasibility(path, FAST, workspace_m=(1.4, 1.0))["workspace"]
    # the trailer's rear label is 0.213 m behind P, which is k closer to the centre than F
    reach = 0.6 - FAST.swing_length_m + 0.213
    assert outside.worst == pytest.approx(reach / 0.5, rel=1e-3)
    assert not outside.kept
    weak = FAST.model_copy(update={"servo": Servo(preset="fast", stall_torque_n_m=1e-3)})
    assert not circle(weak)["wheel torque"].kept
    slow = Servo(preset="fast", acceleration_limit_rad_s2=1.0)
    start = Circle(radius_m=0.5, angular_rate_rad_s=1.0, ramp_s=1.0).sample(TIME)
    slow_robot = FAST.model_copy(update={"servo": slow})
    assert not check_feasibility(start, slow_robot)["wheel acceleration"].kept


def test_where_it_is_broken() -> None:
    """A start from rest exceeds the acceleration in its middle only."""
    start = Circle(radius_m=0.5, angular_rate_rad_s=1.0, ramp_s=2.0, theta2="aligned").sample(TIME)
    servo = Servo(preset="fast", acceleration_limit_rad_s2=15.0)
    check = check_feasibility(start, FAST.model_copy(update={"servo": servo}))
    ((first, last),) = check["wheel acceleration"].spans_s
    assert 0.0 < first < 1.0 < last < 2.0
    assert check["wheel acceleration"].worst_time_s == pytest.approx(1.0, abs=0.033)


def test_an_undefined_trailer_is_said_to_be() -> None:
    path = FigureEight(half_width_m=0.5, half_height_m=0.3, period_s=20.0, theta2="none")
    verdict = check_feasibility(path.sample(TIME), LAB)
    assert not verdict["defined"].kept
    assert not verdict.feasible
    assert "FAIL defined" in str(verdict)


def robot_of(name: str) -> RobotParameters:
    """That a shipped plan is for."""
    if name.startswith("double"):
        return train(2).model_copy(update={"servo": FAST.servo})
    return LAB if name.endswith("_lab") else FAST


@pytest.mark.parametrize("name", shipped_plans())
def test_shipped_plans_are_feasible(name: str) -> None:
    robot, workspace_m, hitch_rad = robot_of(name), (1.4, 1.0), 2.0
    if len(robot.trailers) > 1:
        workspace_m, hitch_rad = (2.41, 1.81), 1.4  # between knots a plan bulges
    if name == "waypoints_lab":
        robot = LAB.model_copy(update={"hitch": Hitch(damping_n_m_s_rad=1e-3)})
        workspace_m = (1.8, 1.3)
    path = Planned(plan=name).sample(np.arange(0.0, 40.0, 0.01), robot)
    verdict = check_feasibility(path, robot, workspace_m=workspace_m)
    if name == "double_eight":  # it turns fast for knots 50 ms apart, and `validate` says so
        missing = verdict["free trailer"]
        assert 1e-5 < missing.worst < 1e-4
        verdict = Feasibility(tuple(c for c in verdict.checks if c.name != missing.name))
    assert verdict.feasible, str(verdict)
    # what the optimiser was told, with the spline's overshoot between knots
    assert np.abs(path.theta_rate[..., 1:]).max() <= 3.0 + 1e-3
    assert np.abs(np.diff(path.theta, axis=-1)).max() <= hitch_rad + 1e-3


@pytest.mark.parametrize("name", shipped_plans())
def test_a_plan_ends_at_rest_or_goes_round(name: str) -> None:
    plan = Planned(plan=name)
    end = Knots.read(name).duration_s
    robot = robot_of(name)
    path = plan.sample(np.array([0.0, end - 1e-9, end, end + 0.5, end + 1.0]), robot)
    if name.startswith(("figure_eight", "waypoints", "double_eight")):
        turning = np.arange(path.q.shape[-1]) >= 2
        whole = 2.0 * np.pi * (name == "waypoints_lab") * turning
        assert path.q[2] == pytest.approx(path.q[0] + whole, abs=1e-9)
        later = plan.sample(np.array([0.5, 1.0]), robot)
        assert path.q[3:] == pytest.approx(later.q + whole, abs=1e-9)
        assert path.q_rate[3:] == pytest.approx(later.q_rate, abs=1e-9)
    else:
        assert path.q_rate[[0, 1, 3]] == pytest.approx(0.0, abs=1e-6)
        assert path.q[4] == pytest.approx(path.q[2], abs=1e-12)
        assert np.diff(path.theta[4]) == pytest.approx(0.0, abs=1e-9)


def test_plans_for_another_robot_or_of_no_name_are_refused() -> None:
    other = FAST.model_copy(update={"trailer": Trailer(com_offset_m=0.2)})
    (fault,) = Planned(plan="rest_to_rest").faults(other)
    assert "was made for a trailer" in str(fault)
    (fault,) = Planned(plan="nine").faults(FAST)
    assert "allowed: double_eight" in str(fault)
    (fault,) = Planned(plan="rest_to_rest").faults(train(2))
    assert "was made for 1 trailer, not 2" in str(fault)
    (fault,) = Planned(plan="double_eight").faults(FAST)
    assert "was made for 2 trailers, not 1" in str(fault)
    (fault,) = Planned(plan="double_eight").faults(train(2, 0.2))
    assert "of other lengths, masses or hitches: A_ij/b_i differ by up to 0.03" in str(fault)


def test_a_spring_and_a_damper_demand_what_they_give() -> None:
    """A free trailer's motion, and a hitch that is not free: its torque is what is missing."""
    path = FlatEllipse(half_axes_m=(0.6, 0.4), angular_rate_rad_s=0.9).sample(TIME, FAST)
    angle, rate = path.theta[:, 0] @ [-1.0, 1.0], path.theta_rate[:, 0] @ [-1.0, 1.0]
    for stiffness, damping, friction in ((0.02, 0.0, 0.0), (0.0, 0.05, 0.0), (0.02, 0.05, 0.004)):
        hitch = Hitch(
            stiffness_n_m_rad=stiffness, damping_n_m_s_rad=damping, coulomb_friction_n_m=friction
        )
        check = check_feasibility(path, FAST.model_copy(update={"hitch": hitch}))["free trailer"]
        torque = np.abs(stiffness * angle + damping * rate)
        assert check.worst == pytest.approx(torque.max() - friction, rel=1e-9)
        assert check.worst_time_s == TIME[torque.argmax()]


def test_a_spring_may_give_what_is_demanded_or_its_opposite() -> None:
    """A trailer turned off its equilibrium on a circle: J·θ̈2 − m2·l·P''·n, and −k_t·φ for it."""
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(TIME, FAST)
    for turned in (0.3, -0.3):
        off = replace(path, theta=path.theta + [0.0, turned])
        theta1, theta2 = off.theta[0, 0]
        normal = np.array([-np.sin(theta2), np.cos(theta2)])
        pull = 0.33 * 0.141 * float(path.acceleration_m_s2[0, 0] @ normal)
        hitch = Hitch(stiffness_n_m_rad=1e-3)
        check = check_feasibility(off, FAST.model_copy(update={"hitch": hitch}))["free trailer"]
        assert check.worst == pytest.approx(abs(-pull + 1e-3 * (theta2 - theta1)), rel=1e-6)


def test_forces_of_a_straight_start_by_hand() -> None:
    """Both wheels push the whole mass; a trailer without θ2 counts as in line."""
    for theta2 in ("aligned", "none"):
        line = StraightLine(speed_m_s=0.4, ramp_s=1.0, heading_rad=0.7, theta2=theta2)
        verdict = check_feasibility(line.sample(np.arange(0.0, 2.0, 0.01)), FAST)
        surge = 0.4 * 35.0 / 16.0  # the steepest slope of the septic smoothstep, in its middle
        force, radius = (0.9 + 0.33) * surge, FAST.tractor.wheel_radius_m
        assert verdict["grip"].worst == pytest.approx(force, rel=1e-9)
        assert verdict["grip"].limit == pytest.approx(0.9 * 9.81 * 0.9 * (1 - 0.029 / 0.075))
        torque = 0.5 * radius * force + 2e-4 * surge / radius
        assert verdict["wheel torque"].worst == pytest.approx(torque, rel=1e-9)
        assert verdict["wheel torque"].worst_time_s == pytest.approx(0.5)
        assert verdict["wheel acceleration"].worst == pytest.approx(surge / radius, rel=1e-9)
        assert verdict["defined"].kept is (theta2 == "aligned")


def test_the_wheels_power_is_the_change_of_kinetic_energy() -> None:
    """On the motion of a free trailer nothing else works."""
    path = FlatEllipse(half_axes_m=(0.6, 0.4), angular_rate_rad_s=0.9).sample(FINE, FAST)
    q, rate = path.q, path.q_rate
    twist = workspace_rate(q, rate)
    surge, _ = to_body(path.theta1_rad, *np.moveaxis(path.acceleration_m_s2, -1, 0))
    acceleration = np.concatenate([surge[..., None], path.theta_acceleration], axis=-1)
    torque, grip = _forces(q, twist, acceleration, FAST)
    power = (torque * wheels_from_twist(twist[..., :2], FAST)).sum(axis=-1)[:, 0]
    inertia = np.einsum("...i,...ij,...j", twist, reduced_mass_matrix(q, FAST), twist)[:, 0]
    # central differences: T²/6 of the third derivative of half a millijoule
    slope = np.gradient(0.5 * inertia, FINE)[1:-1]
    assert slope == pytest.approx(power[1:-1], abs=1e-4 * np.abs(power).max())
    # worst case of what the floor gives: drive, turning moment and side force at once
    drive, moment = np.abs(torque.sum(axis=-1)), np.abs(np.diff(torque, axis=-1)[..., 0])
    along = (drive + moment) / FAST.tractor.wheel_radius_m
    across = lateral_force(q, twist, acceleration, FAST)
    assert grip == pytest.approx(np.hypot(along, across), rel=1e-12)


def test_the_workspace_counts_both_labels() -> None:
    time_s = np.array([0.0, 1.0])
    for heading in (0.0, np.pi):
        line = StraightLine(speed_m_s=1e-6, heading_rad=heading, theta2="aligned")
        check = check_feasibility(line.sample(time_s), FAST, workspace_m=(0.4, 10.0))["workspace"]
        assert check.worst == pytest.approx(0.213 / 0.2, rel=1e-4)  # the trailer's is further off
    line = StraightLine(speed_m_s=1e-6, start_m=(0.1, 0.0), theta2="none")
    check = check_feasibility(line.sample(time_s), FAST, workspace_m=(0.4, 10.0))["workspace"]
    assert check.worst == pytest.approx(0.203 / 0.2, rel=1e-4)


def test_the_labels_of_a_larger_robot_reach_further() -> None:
    line = StraightLine(speed_m_s=1e-6, theta2="aligned").sample(np.array([0.0, 1.0]))
    outdoor = RobotParameters(preset="outdoor")
    check = check_feasibility(line, outdoor, workspace_m=(0.4, 10.0))["workspace"]
    assert check.worst == pytest.approx(0.213 * 60 / 26 / 0.2, rel=1e-4)


def test_stretches_are_counted_and_a_note_is_no_fault() -> None:
    """Rest to rest, F'' vanishes at both ends; the flatness-based law alone cannot follow that."""
    path = Planned(plan="rest_to_rest").sample(np.arange(0.0, 7.0, 0.01), FAST)
    verdict = check_feasibility(path, FAST)
    note = verdict["flatness, least |F''|"]
    assert verdict.feasible
    assert not note.kept
    assert note.worst < note.limit == 1e-3
    assert f"note {note.name}" in str(verdict)
    assert f"and {len(note.spans_s) - 1} more" in str(note)
    assert all(a <= b for a, b in note.spans_s)
    steady = circle()["flatness, least |F''|"]
    assert steady.worst == pytest.approx(0.6, rel=1e-9)
    assert steady.kept


def test_where_theta2_is_undefined_the_rest_is_still_judged() -> None:
    eight = FigureEight(half_width_m=0.5, half_height_m=0.3, period_s=20.0, theta2="outward")
    path = eight.sample(np.linspace(0.0, 20.0, 401))  # begins at the crossing
    assert np.isnan(path.theta2_rad[0, 0])
    check = check_feasibility(path, FAST)["free trailer"]
    assert np.isfinite(check.worst)
    assert check.worst_time_s > 0.0
    assert not check.kept


def test_a_check_says_how_often_it_is_broken() -> None:
    once = Demand("grip", "N", 9.0, 1.5, 5.0, ((1.0, 2.0),))
    twice = replace(once, spans_s=((1.0, 2.0), (4.0, 4.5)))
    assert str(once) == "FAIL grip: 9 of 5 N at 1.5 s; broken from 1 s to 2 s"
    assert str(twice) == f"{once} and 1 more"
    assert str(replace(once, spans_s=())) == "ok   grip: 9 of 5 N at 1.5 s"


def test_a_tractor_that_slides_sideways_is_noticed() -> None:
    path = Circle(radius_m=0.5, angular_rate_rad_s=0.4, theta2="aligned").sample(TIME)
    path.theta[..., 0] += 0.1
    check = check_feasibility(path, FAST)["no side slip"]
    assert check.worst == pytest.approx(0.2 * np.sin(0.1), rel=1e-9)
    assert not check.kept


@pytest.mark.parametrize("name", shipped_plans())
def test_a_plans_derivatives_are_derivatives(name: str) -> None:
    step = 1e-3
    path = Planned(plan=name).sample(np.arange(0.5, 3.0, step), robot_of(name))
    for values in (
        [path.derivatives[:, 0, order] for order in range(4)],
        [path.flat_derivatives[:, 0, order] for order in range(4)],
        [path.theta[:, 0], path.theta_rate[:, 0], path.theta_acceleration[:, 0]],
    ):
        for lower, higher in pairwise(values):
            central = (lower[2:] - lower[:-2]) / (2.0 * step)
            # second order: step²/6 of a derivative of up to 1e3 times this one
            assert central == pytest.approx(higher[1:-1], abs=1e-3 * (1.0 + np.abs(higher).max()))
        assert np.abs(values[1]).max() > 0.01


def test_a_file_that_is_no_plan_says_why(tmp_path: Path) -> None:
    good = (files("ttwmr_mj.references") / "data" / "rest_to_rest.csv").read_text("utf-8")
    lines = good.splitlines()
    head, rows = lines[:4], lines[4:]

    def problem(text: str) -> str:
        path = tmp_path / "mine.csv"
        path.write_text(text, encoding="utf-8")
        return " ".join(fault.problem for fault in Planned(plan=str(path)).faults(FAST))

    assert problem(good) == ""
    assert problem(good + "# a remark\n") == ""
    assert "it lacks the header entry ends" in problem(good.replace("# ends:", "# end:"))
    assert "not as it began or at rest" in problem(good.replace("ends: at rest", "ends: somehow"))
    assert "at least 8 rows" in problem("\n".join([*head, *rows[:7]]))
    assert "at least 8 rows" in problem("\n".join([*head, *(row + ",0" for row in rows)]))
    assert "do not increase" in problem("\n".join([*lines, rows[-1]]))
    swapped = problem(good.replace("x_m,y_m", "y_m,x_m"))
    assert "its columns are called time_s, y_m, x_m, theta1_rad, theta2_rad, and must be" in swapped
    assert "must be time_s, x_m, y_m" in problem("\n".join([*head[:3], *rows]))  # without names
    assert problem(good.replace("time_s,x_m,y_m", '"time_s", "x_m", y_m')) == ""
    assert "not all finite" in problem("\n".join([*head, "-1,nan,0,0,0", *rows]))


def test_the_planner_makes_what_is_shipped(tmp_path) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("casadi")
    from ttwmr_mj.planning.__main__ import PLANS, ROBOT
    from ttwmr_mj.planning.knots import write_knots

    made = tmp_path / "rest_to_rest.csv"
    write_knots(made, PLANS["rest_to_rest"](), ROBOT, "a test")
    again = Planned(plan=str(made)).sample(TIME, FAST)
    shipped = Planned(plan="rest_to_rest").sample(TIME, FAST)
    assert again.q == pytest.approx(shipped.q, abs=1e-4)  # another solver build, another rounding
