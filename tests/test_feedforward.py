"""Feedforward: exact where nothing is off, and blind to everything else."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.api import simulate
from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.feedforward import Feedforward, FeedforwardOptions
from ttwmr_mj.dynamics.kinematics import arcs_between
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.results.metrics import score
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

PERIOD = 0.033
LAW = 'controller={kind="feedforward"}'


def test_an_arc_leads_from_pose_to_pose_exactly() -> None:
    radius, angle = 0.43, np.array([0.2, 0.5, 1.4])
    points = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    arcs = arcs_between(points, angle + 0.5 * np.pi)
    np.testing.assert_allclose(arcs[:, 1], np.diff(angle), rtol=1e-14)
    np.testing.assert_allclose(arcs[:, 0], radius * np.diff(angle), rtol=1e-12)
    back = arcs_between(points[::-1], (angle + 0.5 * np.pi)[::-1])
    np.testing.assert_allclose(back, -arcs[::-1], rtol=1e-12)


def test_by_feedforward_the_models_tractor_stays_on_its_circle() -> None:
    sets = [LAW, "plant.kind=analytic", 'initial={kind="on_reference"}', "duration_s=20.0"]
    (numbers,) = score(*_run("lab_circle", *sets))
    # the first period ramps from the mean speed to itself: nothing but rounding is left
    assert numbers["tractor_max_error_m"] == pytest.approx(0.0, abs=1e-9)


def test_it_does_not_look() -> None:
    sets = [LAW, "plant.kind=analytic", 'initial={kind="on_reference", y_offset_m=0.05}']
    (numbers,) = score(*_run("lab_circle", *sets, "duration_s=10.0"))
    assert numbers["tractor_final_error_m"] == pytest.approx(0.05, abs=1e-9)


def test_commands_keep_the_servos_range_and_say_so() -> None:
    robot = RobotParameters(servo=Servo(speed_limit_rad_s=2.0))
    law = Feedforward(FeedforwardOptions())
    path = Circle(radius_m=0.43, angular_rate_rad_s=0.125).sample(PERIOD * np.arange(9), robot)
    law.start(Task(robot, path, PERIOD, 3, np.random.default_rng(0)))
    none = np.zeros(3)
    seen = Estimate(RobotState.at_rest(0, 0, 0, 0, 3), none, none == 0.0, none)
    command = law.command(4, seen)
    # Eq. 8-9: 0.43 m · 0.125 rad/s, and the outer wheel 0.0595 m farther out
    outer, inner = (0.125 * (0.43 + side * 0.0595) / 0.026 for side in (1.0, -1.0))
    assert outer > 2.0 > inner
    np.testing.assert_allclose(command.wheel_speed_rad_s, [[2.0, inner]] * 3, rtol=1e-9)
    assert command.saturated.all()
    wide = RobotParameters(servo=Servo(speed_limit_rad_s=3.0))
    law.start(Task(wide, path, PERIOD, 3, np.random.default_rng(0)))
    assert not law.command(4, seen).saturated.any()
    assert not command.near_singular.any()


def _run(name: str, *sets: str) -> tuple[object, RobotParameters]:
    scenario = load_scenario(name, list(sets))
    return simulate(scenario).trajectory, scenario.robot
