"""What is believed of the robot reaches controller, reference and tracker, and nothing else."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.controllers.base import Controller, Task
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.results.metrics import score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs import build
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.faults import fault_of
from ttwmr_mj.scenario.file import dump_scenario, load_scenario
from ttwmr_mj.vision.camera.rendering import drawn as camera_scene

LONGER = "belief.robot.trailer.com_offset_m=0.16"


def drive(name: str, *overrides: str) -> Trajectory:
    scenario = load_scenario(name, ["duration_s=1.0", *overrides])
    return Experiment(scenario, scenarios_folder()).run().trajectory


def test_without_a_belief_the_truth_is_believed() -> None:
    scenario = load_scenario("outer_circle", ["robot.trailer.mass_kg=0.4"])
    assert scenario.believed_robot is scenario.robot
    assert "belief" not in tomllib.loads(dump_scenario(scenario))


def test_a_belief_replaces_what_it_names_and_nothing_else() -> None:
    sets = ["robot.trailer.mass_kg=0.4", "belief.robot.trailer.mass_kg=0.3"]
    sets += ["robot.hitch.damping_n_m_s_rad=0.1", "belief.robot.tractor.mass_kg=1.0"]
    scenario = load_scenario("outer_circle", sets)
    assert scenario.robot.trailer.mass_kg == 0.4
    expected = load_scenario("outer_circle", [*sets[::2], "robot.tractor.mass_kg=1.0"]).robot
    believed = scenario.believed_robot
    trailer = expected.trailer.model_copy(update={"mass_kg": 0.3})
    assert believed == expected.model_copy(update={"trailer": trailer})


def test_the_resolved_file_holds_what_was_given_and_loads_back_equal(tmp_path: Path) -> None:
    # the default's own number counts as given: the robot that is driven has another
    sets = ["robot.tractor.mass_kg=1.1", "belief.robot.tractor.mass_kg=0.9"]
    scenario = load_scenario("outer_circle", [*sets, "belief.robot.servo.preset=lab"])
    path = tmp_path / "again.toml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    limits = {"preset": "lab", "speed_limit_rad_s": 6.5, "acceleration_limit_rad_s2": 50.0}
    believed = tomllib.loads(path.read_text(encoding="utf-8"))["belief"]
    assert believed == {"robot": {"tractor": {"mass_kg": 0.9}, "servo": limits}}
    again = load_scenario(str(path))
    assert again == scenario
    assert again != load_scenario("outer_circle", sets[:1])
    assert again.believed_robot.tractor.mass_kg == 0.9
    changed = load_scenario(str(path), ["belief.robot.tractor.mass_kg=0.8"])
    assert changed.believed_robot.tractor.mass_kg == 0.8
    copied = type(scenario).model_validate(scenario.model_dump())
    assert copied.believed_robot == scenario.believed_robot


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("belief.robot.trailer.mas_kg=1", "belief.robot.trailer.mas_kg: unknown key (did you me"),
        ("belief.robot.traler.mass_kg=1", "belief.robot.traler: unknown key (did you mean 'trai"),
        ("belief.robott.servo.preset=lab", "belief.robott: unknown key (did you mean 'robot'?)"),
        ("belief.robot.trailer.mass_kg=-1", "belief.robot.trailer.mass_kg: got -1; allowed: gre"),
        ("belief.robot.trailers=[{mass_kg=-1}]", "belief.robot.trailer.mass_kg: got -1"),
        ("belief.robot.hitches=[{},{}]", "belief.robot.hitches: got 2; allowed: as many as"),
        ("belief.robot=3", "belief.robot: got 3"),
        (
            "belief.robot={trailers=[{next_hitch_offset_m=0.3},{}], hitches=[{},{}]}",
            "belief.robot.trailers: got 2; allowed: as many as robot.trailers, 1",
        ),
        ("plant.tractor_mass_factor=1.2", "plant.tractor_mass_factor: gone; give the driven"),
    ],
)
def test_faults_name_the_key(line: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("outer_circle", [line])
    assert f"1 error\n  {expected}" in str(caught.value)


def test_a_key_of_the_past_says_what_replaced_it() -> None:
    location = ("controller", "flatness", "friction", "believed_share")
    fault = fault_of({"type": "extra_forbidden", "loc": location, "input": 0.7})
    assert str(fault).startswith("controller.friction.believed_share: gone; give")
    assert "belief.robot.hitch.coulomb_friction_n_m" in str(fault)


def test_a_belief_equal_to_the_truth_changes_no_bit() -> None:
    plain, believed = drive("outer_circle"), drive("outer_circle", LONGER.replace("0.16", "0.141"))
    np.testing.assert_array_equal(believed.q, plain.q)
    np.testing.assert_array_equal(believed.wheel_command_rad_s, plain.wheel_command_rad_s)


def test_the_law_and_its_reference_are_those_of_the_believed_robot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tasks: list[Task] = []
    law = SimpleNamespace(start=tasks.append, command=lambda *_: Controller.plain(np.zeros((1, 2))))
    monkeypatch.setattr(build, "make_controller", lambda *_: law)
    shorter = "duration_s=0.1"
    for change in (LONGER, LONGER.removeprefix("belief."), shorter):
        Experiment(load_scenario("outer_circle", [change, shorter])).run()
    believed, longer, plain = tasks
    assert believed.robot == longer.robot != plain.robot
    np.testing.assert_array_equal(believed.reference.q, longer.reference.q)
    assert np.abs(believed.reference.q - plain.reference.q)[:4].max() > 1e-3


def test_a_plan_must_fit_the_robot_that_is_believed() -> None:
    with pytest.raises(InputError, match=r"reference\.plan: got 'rest_to_rest'; was made"):
        load_scenario("rest_to_rest", [LONGER])
    trailer = ["robot.trailer.com_offset_m=0.16", "belief.robot.trailer.com_offset_m=0.141"]
    assert load_scenario("rest_to_rest", trailer).robot.trailer.com_offset_m == 0.16


@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_no_plant_knows_what_is_believed(plant: str) -> None:
    sets = (f"plant.kind={plant}", "initial.theta2_rad=0.6")
    heavy = ["belief.robot.tractor.mass_kg=2.0", "belief.robot.servo.speed_limit_rad_s=1.0"]
    wheels = "belief.robot.tractor.wheel_radius_m=0.03"
    runs = [drive("open_loop_turn", *sets, *more) for more in ((), (LONGER, wheels, *heavy))]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    driven = drive("open_loop_turn", *sets, LONGER.removeprefix("belief."))
    assert np.abs(driven.q - runs[0].q).max() > 1e-3


def test_the_law_steers_the_robot_that_it_believes_in() -> None:
    plain, believed = drive("outer_circle"), drive("outer_circle", LONGER)
    assert np.abs(believed.q - plain.q).max() > 1e-3
    # the wheel speeds of law (32) say what radius it believes in
    still = (
        "duration_s=0.033",
        "robot.servo.speed_limit_rad_s=1e3",
        "robot.servo.acceleration_limit_rad_s2=1e5",
    )
    radius = "belief.robot.tractor.wheel_radius_m=0.013"
    small = drive("sim_circle", *still, radius).wheel_command_rad_s[0]
    np.testing.assert_allclose(small, 2.0 * drive("sim_circle", *still).wheel_command_rad_s[0])


def test_the_tracker_predicts_with_the_believed_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing that is driven depends on it: the wheels turn as the open loop says."""
    sets = [
        "sensing.kind=camera",
        "sensing.preset=lab",
        "sensing.latency_s=0.033",
        "sensing.calibration_path=calibration/lab_camera.yaml",
        "initial.theta2_rad=0.6",
        "robot.hitch.damping_n_m_s_rad=0.01",
    ]
    drawn: list[RobotParameters] = []

    def drawing(robot: RobotParameters, *more: Any) -> Any:
        drawn.append(robot)
        return build_model(robot, *more)

    monkeypatch.setattr(camera_scene, "build_model", drawing)
    plain, believed = (
        drive("open_loop_turn", *sets, *more)
        for more in ((), ("belief.robot.hitch.damping_n_m_s_rad=0.1",))
    )
    assert [robot.hitch.damping_n_m_s_rad for robot in drawn] == [0.01, 0.01]
    np.testing.assert_array_equal(plain.q, believed.q)
    assert np.abs(plain.est_q - believed.est_q)[:, 0, 3].max() > 1e-4


def test_a_run_is_scored_by_the_robot_that_is_driven(tmp_path: Path) -> None:
    sets = ["duration_s=1.0", LONGER, "output.recording=false", "output.figures=false"]
    scenario = load_scenario("outer_circle", [*sets, "plant.kind=analytic"])
    metrics = run_scenario(scenario, tmp_path).metrics
    expected = score(Experiment(scenario).run().trajectory, scenario.robot)[0]
    assert metrics["trailer_rmse_m"] == expected["trailer_rmse_m"]
