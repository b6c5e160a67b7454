"""The feasibility checker, and the shipped plans against it."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.figure_eight import FigureEight
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.planned import Plan, Planned, shipped_plans
from ttwmr_mj.references.shared.feasibility import Feasibility, check_feasibility
from ttwmr_mj.robot import Hitch, RobotParameters, Servo, Trailer

FAST = RobotParameters(servo=Servo(preset="fast"))
LAB = RobotParameters()
TIME = np.arange(0.0, 15.0, 0.033)


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


@pytest.mark.parametrize("name", shipped_plans())
def test_shipped_plans_are_feasible(name: str) -> None:
    robot = LAB if name.endswith("_lab") else FAST
    path = Planned(plan=name).sample(np.arange(0.0, 40.0, 0.01), robot)
    verdict = check_feasibility(path, robot, workspace_m=(1.4, 1.0))
    assert verdict.feasible, str(verdict)
    # what the optimiser was told, with the spline's overshoot between knots
    assert np.abs(path.theta_rate[..., 1]).max() <= 3.0 + 1e-3
    assert np.abs(path.theta2_rad - path.theta1_rad).max() <= 2.0 + 1e-3


@pytest.mark.parametrize("name", shipped_plans())
def test_a_plan_ends_at_rest_or_goes_round(name: str) -> None:
    plan = Planned(plan=name)
    end = Plan.read(name).duration_s
    path = plan.sample(np.array([0.0, end - 1e-9, end, end + 0.5, end + 1.0]), FAST)
    if name.startswith("figure_eight"):
        assert path.q[2] == pytest.approx(path.q[0], abs=1e-9)
        later = plan.sample(np.array([0.5, 1.0]), FAST)
        assert path.q[3:] == pytest.approx(later.q, abs=1e-9)
    else:
        assert path.q_rate[[0, 1, 3]] == pytest.approx(0.0, abs=1e-6)
        assert path.q[4] == pytest.approx(path.q[2], abs=1e-12)
        assert path.theta1_rad[4] == pytest.approx(path.theta2_rad[4], abs=1e-9)


def test_plans_for_another_robot_or_of_no_name_are_refused() -> None:
    other = FAST.model_copy(update={"trailer": Trailer(com_offset_m=0.2)})
    (fault,) = Planned(plan="rest_to_rest").faults(other)
    assert "was made for a trailer" in str(fault)
    (fault,) = Planned(plan="nine").faults(FAST)
    assert "allowed: figure_eight" in str(fault)


def test_the_planner_makes_what_is_shipped(tmp_path) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("casadi")
    from ttwmr_mj.planning.__main__ import PLANS, write

    made = write("rest_to_rest", PLANS["rest_to_rest"](), tmp_path)
    again = Planned(plan=str(made)).sample(TIME, FAST)
    shipped = Planned(plan="rest_to_rest").sample(TIME, FAST)
    assert again.q == pytest.approx(shipped.q, abs=1e-4)  # another solver build, another rounding
