"""Attribution adds up, contact physics converges, the fit finds what it was not told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from comparisons import TURN, open_loop, run_commands

from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray, RobotState
from ttwmr_mj.studies.compare.explain.attribution import attribute
from ttwmr_mj.studies.compare.explain.convergence import LEVELS, converge, refined
from ttwmr_mj.studies.compare.fit.shooting import DIFFERENCE, SCALE, SCALES, Shooting
from ttwmr_mj.studies.compare.measures.deviation import Deviation, rms
from ttwmr_mj.studies.compare.motion import replay, replay_analytic, replay_contact, run_contact

BRISK = ((0.5, 5.0, 5.0), (0.8, 5.6, 3.2))


def replay_extended(scenario: Scenario, commands: FloatArray, values: dict[str, Any]) -> Trajectory:
    """Commands (n, 2) on the extended plant; each parameter a number or one per simulation."""
    count = max(int(np.size(value)) for value in values.values())
    model = ExtendedModel(scenario.robot, values, values.get("physics_step_s", 0.0005))
    period = scenario.control.sampling_time_s
    longest_s = scenario.plant.analytic.max_step_s
    return replay(scenario, commands, ExtendedPlant(model, count, period, longest_s))


def test_studies_tell_how_far_they_are() -> None:
    scenario = open_loop((0.1, 5.0, 5.0))
    commands = np.full((scenario.periods, 2), 5.0)
    for study in (attribute, converge):
        told: list[float] = []
        study(scenario, commands, told.append)
        assert len(told) > 3
        assert told == sorted(told)
        assert 0.0 < told[0] < 0.6  # the longest run goes first, and is no more than half of it
        assert told[-1] == 1.0
        assert told[0] == pytest.approx(max(np.diff([0.0, *told])))


def test_contact_physics_converges_to_the_ideal_with_order_one() -> None:
    scenario = open_loop(*BRISK)
    study = converge(scenario, run_commands(scenario), levels=3)
    for name, order in study.orders.items():
        assert order == pytest.approx(1.0, abs=0.05), name


@pytest.mark.slow
def test_the_ideal_limit_on_a_circle_of_ten_metres() -> None:
    # R = 1 m at 0.5 rad/s for 20 s
    data = {
        "robot": {"servo": {"preset": "fast"}, "hitch": {"damping_n_m_s_rad": 0.0}},
        "initial": {"kind": "on_reference"},
        "reference": {"kind": "circle", "radius_m": 1.0, "angular_rate_rad_s": 0.5},
        "controller": {"kind": "lyapunov"},
        "duration_s": 20.0,
    }
    base = open_loop(*BRISK).model_dump(exclude=set(data))
    scenario = Scenario.model_validate({**base, **data})
    commands = run_commands(scenario)
    finest = replay_contact(refined(scenario, LEVELS - 1), commands)
    numbers = Deviation.between(finest, replay_analytic(scenario, commands)).numbers()
    assert numbers["path_length_m"] == pytest.approx(10.0, abs=0.05)
    assert numbers["position_deviation_per_path"] is not None
    assert numbers["position_deviation_per_path"] < 1e-4
    assert numbers["theta2_deviation_max_rad"] is not None
    assert numbers["theta2_deviation_max_rad"] < 1.5e-3


def test_the_extended_model_without_extras_is_the_analytic_plant() -> None:
    scenario = open_loop(*TURN, hitch={"damping_n_m_s_rad": 1e-3})
    robot = scenario.robot
    plain = ExtendedParameters(
        wheel_radius_m=robot.tractor.wheel_radius_m,
        track_width_m=robot.tractor.track_width_m,
        hitch_damping_n_m_s_rad=1e-3,
        physics_step_s=0.0,
    ).model_dump()
    commands = run_commands(scenario)
    extended = replay_extended(scenario, commands, plain)
    # Runge-Kutta of P and θ2 over 33 ms against 11 ms
    assert np.abs(extended.q - replay_analytic(scenario, commands).q).max() < 5e-6


def test_a_batch_of_extended_models_is_its_members() -> None:
    scenario = open_loop(*BRISK)
    values = ExtendedParameters.expected(scenario.robot).model_dump()
    slips = np.array([0.0, 1e-3])
    commands = run_commands(scenario)
    batch = replay_extended(scenario, commands, {**values, "slip_time_s": slips})
    for i, slip in enumerate(slips):
        alone = replay_extended(scenario, commands, {**values, "slip_time_s": float(slip)})
        np.testing.assert_array_equal(batch.q[:, i], alone.q[:, 0])


@pytest.mark.parametrize("moving", [False, True], ids=["from_rest", "in_motion"])
@pytest.mark.parametrize("friction_n_m", [0.0, 5e-5], ids=["smooth", "dry"])
def test_shooting_is_the_plant_and_its_differences(moving: bool, friction_n_m: float) -> None:
    circle = {"kind": "circle", "radius_m": 0.5, "angular_rate_rad_s": 0.2, "theta2": "outward"}
    start = {"initial": {"kind": "on_reference"}, "reference": circle} if moving else {}
    scenario = open_loop(*BRISK, **start)
    run = run_contact(scenario)
    values = ExtendedParameters.expected(scenario.robot).model_dump()
    values |= {"slip_time_s": 7e-4, "hitch_coulomb_friction_n_m": friction_n_m}
    nominal = np.array([values[name] for name in SCALES])
    q, slope = Shooting(run).run(nominal)
    moved = np.vstack([nominal, nominal + DIFFERENCE * np.diag(SCALE)])
    rows = replay_extended(scenario, run.commands, dict(zip(SCALES, moved.T, strict=True))).q
    np.testing.assert_allclose(q, rows[:, 0], rtol=0, atol=1e-12)
    expected = np.moveaxis(rows[:, 1:] - rows[:, :1], 1, -1) / DIFFERENCE
    # the differences are of second order in their size; a stop of dry friction is a kink
    size = np.abs(expected).max(axis=0)
    assert (
        np.abs(slope - expected).max(axis=0) < (0.02 if friction_n_m else 2e-3) * size + 1e-11
    ).all()


def test_shooting_marches_where_newton_does_not_close_the_gaps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = run_contact(open_loop(*BRISK))
    values = np.array(
        [getattr(ExtendedParameters.expected(run.robot), name) for name in SCALES], np.float64
    )
    q, slope = Shooting(run).run(values)
    monkeypatch.setattr("ttwmr_mj.studies.compare.shooting.MAX_ROUNDS", 0)
    marched, same_slope = Shooting(run).run(values)
    np.testing.assert_allclose(q, marched, rtol=0, atol=1e-12)
    np.testing.assert_allclose(slope, same_slope, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_rates_of_the_extended_plant_are_the_derivatives_of_its_state() -> None:
    robot = open_loop(*BRISK).robot
    model = ExtendedModel.of(robot, ExtendedParameters.expected(robot))
    plant = ExtendedPlant(model, 1, 1e-4, 1e-4)
    command = np.array([[5.6, 3.2]])
    plant.advance(command, 2000)  # beyond the ramp
    before = plant.state()
    plant.advance(command, 1)
    after = plant.state()
    # trapezoidal rule over 0.1 ms: 1e-8·(third derivative, below 100)/12
    mean = 0.5 * (before.q_rate + after.q_rate)
    np.testing.assert_allclose((after.q - before.q) / 1e-4, mean, rtol=0, atol=1e-7)


def test_dry_friction_locks_the_extended_hitch() -> None:
    scenario = open_loop(*BRISK)
    values = ExtendedParameters.expected(scenario.robot).model_dump()
    locked = replay_extended(
        scenario, run_commands(scenario), {**values, "hitch_coulomb_friction_n_m": 1.0}
    )
    hitch = locked.q[:, 0, 3] - locked.q[:, 0, 2]
    assert np.abs(hitch).max() < 1e-12


def test_extended_plant_refuses_pushes() -> None:
    from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
    from ttwmr_mj.errors import InputError

    robot = open_loop(*BRISK).robot
    model = ExtendedModel.of(robot, ExtendedParameters.expected(robot))
    plant = ExtendedPlant(model, 1, 1e-3, 0.033)
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0))
    plant.push({})
    with pytest.raises(InputError, match=r"plant\.pushes"):
        plant.push({"tractor": np.ones(2)})


def test_the_fitted_model_predicts_the_lab_robot() -> None:
    # with the numbers of the robot and the side slip of its contacts: tc/2 + half a step
    scenario = open_loop(*TURN, hitch={"damping_n_m_s_rad": 1e-3})
    contact = scenario.plant.contact
    slip = 0.5 * (contact.contact_time_constant_s + contact.timestep_s)
    values = ExtendedParameters.expected(scenario.robot).model_dump() | {"slip_time_s": slip}
    run = run_contact(scenario)
    plain = Deviation.between(run.trajectory, replay_analytic(scenario, run.commands))
    better = Deviation.between(run.trajectory, replay_extended(scenario, run.commands, values))
    assert rms(better.position_m) < 0.05 * rms(plain.position_m)
    assert rms(better.q[:, 3]) < 0.2 * rms(plain.q[:, 3])
