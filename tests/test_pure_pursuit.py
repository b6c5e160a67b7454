"""Pure pursuit: the arc through its aim, the closed loop on both plants, its place in the house."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from trajectories import different

from ttwmr_mj.api import simulate
from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.pure_pursuit import PurePursuit, PurePursuitOptions
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.references.straight_line import StraightLine
from ttwmr_mj.results.metrics import score
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

PERIOD = 0.033
ROBOT = RobotParameters(servo=Servo(preset="fast"))


def command_at(x: float, y: float, theta1: float, **options: float) -> tuple[np.ndarray, bool]:
    """(u1, u2) at the start of a line along +x at 0.3 m/s, and whether a wheel was cut."""
    line = StraightLine(speed_m_s=0.3).sample(PERIOD * np.arange(40))
    law = PurePursuit(PurePursuitOptions(**options))
    law.start(Task(ROBOT, line, PERIOD, 1, np.random.default_rng(0)))
    state = RobotState.at_rest(x, y, theta1, 0.0)
    seen = Estimate(state, np.zeros(1), np.ones(1, dtype=np.bool_), np.full(1, np.nan))
    command = law.command(0, seen)
    return twist_from_wheels(command.wheel_speed_rad_s, ROBOT)[0], bool(command.saturated[0])


@pytest.mark.parametrize(("x", "y", "theta1"), [(0.0, 0.1, 0.0), (-0.05, -0.2, 0.4)])
def test_the_arc_goes_through_the_aim(x: float, y: float, theta1: float) -> None:
    (u1, u2), _ = command_at(x, y, theta1, preview_s=10 * PERIOD)
    centre = np.array([x, y]) + u1 / u2 * np.array([-np.sin(theta1), np.cos(theta1)])
    aim = np.array([0.3 * 10 * PERIOD, 0.0])
    assert np.hypot(*(aim - centre)) == pytest.approx(abs(u1 / u2), rel=1e-12)
    late = -x * np.cos(theta1) - y * np.sin(theta1)
    assert u1 == pytest.approx(0.3 + late, rel=1e-12)


def test_on_the_line_it_drives_straight_at_the_reference_speed() -> None:
    (u1, u2), cut = command_at(0.0, 0.0, 0.0)
    assert (u1, u2, cut) == (pytest.approx(0.3, rel=1e-12), 0.0, False)


def test_at_the_end_of_the_reference_the_aim_is_its_end() -> None:
    line = StraightLine(speed_m_s=0.3).sample(PERIOD * np.arange(40))
    law = PurePursuit(PurePursuitOptions(preview_s=10 * PERIOD))
    law.start(Task(ROBOT, line, PERIOD, 1, np.random.default_rng(0)))
    state = RobotState.at_rest(0.3 * 36 * PERIOD, 0.01, 0.0, 0.0)
    seen = Estimate(state, np.zeros(1), np.ones(1, dtype=np.bool_), np.full(1, np.nan))
    u1, u2 = twist_from_wheels(law.command(36, seen).wheel_speed_rad_s, ROBOT)[0]
    ahead = 0.3 * 3 * PERIOD  # three samples are left
    assert u2 / u1 == pytest.approx(-2 * 0.01 / (ahead**2 + 0.01**2), rel=1e-9)


def test_what_is_cut_keeps_its_arc() -> None:
    (u1, u2), _ = command_at(-0.2, 0.1, 0.0)
    (slow, turn), cut = command_at(-0.2, 0.1, 0.0, gain_1_s=100.0)
    assert cut
    assert turn / slow == pytest.approx(u2 / u1, rel=1e-12)
    wheels = abs(slow) + ROBOT.half_track_m * abs(turn)
    assert wheels / ROBOT.tractor.wheel_radius_m == pytest.approx(40.0, rel=1e-12)


@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_it_follows_the_laboratory_circle(plant: str) -> None:
    sets = ['controller={kind="pure_pursuit"}', f"plant.kind={plant}", "duration_s=30.0"]
    result = simulate(load_scenario("lab_circle", sets))
    (metrics,) = score(result.trajectory, result.scenario.robot)
    # the circle is the arc through every aim: exact on the model; tyres creep 2.5 µm
    error = metrics["steady_tractor_rmse_m"]
    assert error is not None
    assert error < {"contact": 1e-5, "analytic": 1e-6}[plant]


def test_a_batch_is_its_single_simulations() -> None:
    sets = ['controller={kind="pure_pursuit"}', "plant.kind=analytic", "duration_s=1.0"]
    scenario = load_scenario("lab_circle", sets)
    alone, among = (simulate(scenario, nsim).trajectory for nsim in (1, 3))
    assert all(different(among.simulation(i), alone) == [] for i in range(3))


@pytest.mark.slow
def test_scenarios_the_schema_and_the_list_know_it() -> None:
    def ttwmr(*words: str) -> str:
        command = [sys.executable, "-m", "ttwmr_mj", *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    assert "PurePursuitOptions" in json.loads(ttwmr("export-schema"))["$defs"]
    assert "pure_pursuit" in ttwmr("list")
