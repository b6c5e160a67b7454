"""Commands at the servo's limit are recorded as saturated, whatever the law says of them."""

from __future__ import annotations

import numpy as np
import pytest

import ttwmr_mj as tt

LIMIT_RAD_S = 6.5  # of the servo preset "lab"


class Constant(tt.Controller):
    """The same wheel speeds (2,) always, without a flag."""

    def __init__(self, *wheels: float) -> None:
        self.wheels = np.array([wheels])

    def start(self, task: tt.Task) -> None:
        self.nsim = task.nsim

    def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
        return self.plain(np.tile(self.wheels, (self.nsim, 1)))


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
