"""Commands at the servo's limit are recorded as saturated, whatever the law says of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ttwmr_mj as tt

LIMIT_RAD_S = 6.5  # of the servo preset "lab"
STALL_N_M = 1.62  # of Section 4


class Constant(tt.Controller):
    """The same wheel speeds (2,) always, without a flag."""

    def __init__(self, *wheels: float) -> None:
        self.wheels = np.array([wheels])

    def start(self, task: tt.Task) -> None:
        self.nsim = task.nsim

    def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
        return self.plain(np.tile(self.wheels, (self.nsim, 1)))


OWN = "controller={kind='custom', target='a:B'}"


def scenario(*changes: str) -> tt.Scenario:
    shown = ["duration_s=0.2", "plant.kind=analytic", "robot.servo={preset='lab'}"]
    return tt.load_scenario("open_loop_turn", [*shown, *changes])


@pytest.mark.parametrize(
    ("wheels", "share"),
    [
        ((60.0, 60.0), 1.0),  # cut by the servo
        ((LIMIT_RAD_S, 1.0), 1.0),  # cut by the law itself
        ((0.0, -LIMIT_RAD_S), 1.0),
        ((LIMIT_RAD_S - 1e-9, 1.0), 0.0),
    ],
)
def test_a_law_of_ones_own_need_not_flag_it(wheels: tuple[float, float], share: float) -> None:
    case = scenario()
    result = tt.simulate(case, controller=Constant(*wheels))
    assert tt.score(result.trajectory, case.robot)[0]["saturated_share"] == share


def test_the_limit_is_that_of_the_robot_that_drives() -> None:
    """And not the believed one."""
    case = scenario("belief.robot.servo.speed_limit_rad_s=3.0")
    for wheels, share in ((5.0, 0.0), (7.0, 1.0)):
        result = tt.simulate(case, controller=Constant(wheels, wheels))
        assert result.trajectory.saturated.mean() == share


def test_every_simulation_of_a_batch_has_its_own_limit() -> None:
    wheels = "{duration_s=1, wheel_right_rad_s=5, wheel_left_rad_s=5}"
    limits = [4.0, 5.0, 5.1, 6.5]
    rows = [
        scenario(f"controller.segments=[{wheels}]", f"robot.servo.speed_limit_rad_s={limit}")
        for limit in limits
    ]
    shares = [result.trajectory.saturated.mean() for result in tt.run_batch(rows)]
    assert shares == [1.0, 1.0, 0.0, 0.0]


class Torques(Constant):
    """Constant torques beside constant wheel speeds, which nothing obeys."""

    def __init__(self, torque: float, speed: float) -> None:
        super().__init__(speed, speed)
        self.torque = torque

    def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
        torques = np.tile([[0.0, self.torque * (-1) ** k]], (self.nsim, 1))
        return replace(super().command(k, estimate), wheel_torque_n_m=torques)


@pytest.mark.parametrize("plant", ["analytic", "contact"])
@pytest.mark.parametrize(
    ("torque", "speed", "share"),
    [
        (100.0, 0.0, 1.0),  # cut to the stall torque
        (STALL_N_M, 0.0, 1.0),
        (STALL_N_M - 1e-9, 0.0, 0.0),
        (0.1, 60.0, 0.0),  # beyond the servo's limit, but none of its wheels turns so fast
    ],
)
def test_where_torques_drive_theirs_is_the_limit(
    plant: str, torque: float, speed: float, share: float
) -> None:
    case = scenario(f"plant.kind={plant}", "control.inner_loop=torque", OWN)
    trajectory = tt.simulate(case, controller=Torques(torque, speed)).trajectory
    assert trajectory.saturated.mean() == share
    assert tt.score(trajectory, case.robot)[0]["saturated_share"] == share


def test_with_a_motor_the_limit_is_its_torque_at_stall() -> None:
    motor = "robot.servo={preset='lab', motor={}}"
    case = scenario("plant.kind=contact", "control.inner_loop=torque", OWN, motor)
    stall = case.robot.servo.largest_torque_n_m
    for torque, share in ((0.999 * stall, 0.0), (stall, 1.0)):
        trajectory = tt.simulate(case, controller=Torques(torque, 0.0)).trajectory
        assert trajectory.saturated.mean() == share


def test_torques_that_nothing_obeys_are_not_at_a_limit() -> None:
    trajectory = tt.simulate(scenario(), controller=Torques(100.0, 1.0)).trajectory
    assert not trajectory.saturated.any()


def test_a_law_in_torques_is_still_limited_in_speed() -> None:
    """Its speeds are ramped within the servo's limits before torques are made of them."""
    loop = "control.inner_loop=computed_torque"
    for speed, share in ((60.0, 1.0), (0.5, 0.0)):
        case = scenario(loop, "robot.servo.reflected_inertia_kg_m2=0.001")
        trajectory = tt.simulate(case, controller=Constant(speed, speed)).trajectory
        assert trajectory.saturated.mean() == share
