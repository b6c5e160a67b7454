"""The comparison against truth that needs no tuning, its files, its gate and its refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from comparisons import TURN, open_loop, run_commands
from test_hybrid import swing_energy

from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.compare.measures.deviation import Deviation
from ttwmr_mj.studies.compare.measures.residuals import Residuals
from ttwmr_mj.studies.compare.motion import replay_analytic, replay_contact, run_contact
from ttwmr_mj.studies.compare.pair import refuse_unlike, run_pair
from ttwmr_mj.studies.compare.variants import changed


def test_at_rest_both_plants_stay_where_they_are() -> None:
    scenario = open_loop((2.0, 0.0, 0.0))
    pair = run_pair(scenario)
    assert np.abs(pair.deviation.q).max() < 1e-6
    assert pair.numbers["position_deviation_per_path"] is None  # nobody moved


def test_on_a_straight_line_both_agree() -> None:
    # by the wheels' real speeds: what is left is contact physics alone
    pair = run_pair(open_loop((3.0, 5.0, 5.0)), real_wheels=True)
    assert np.abs(pair.deviation.q).max() < 1e-6


@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_a_free_trailer_on_a_circle_settles_radially_outward(plant: str) -> None:
    # damping so that it settles within the test: the swing dies as exp(−c·t/2J), J = 7.3e-3
    fast = {"preset": "fast"}
    robot = {"servo": fast, "hitch": {"damping_n_m_s_rad": 0.01}}
    scenario = open_loop((12.0, 20.0, 17.0), robot=robot)
    commands = np.tile([20.0, 17.0], (scenario.periods, 1))
    play = replay_contact if plant == "contact" else replay_analytic
    rows = play(scenario, commands)
    hitch = rows.q[:, 0, 3] - rows.q[:, 0, 2]
    # balls of 1 g and soft contacts shift the equilibrium by less than a milliradian
    assert hitch[-1] == pytest.approx(math.pi / 2, abs=2e-3)


@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_swapping_left_and_right_mirrors_the_result(plant: str) -> None:
    scenario = open_loop(*TURN)
    commands = run_commands(scenario)
    play = replay_contact if plant == "contact" else replay_analytic
    q, mirrored = play(scenario, commands).q, play(scenario, commands[:, ::-1]).q
    # MuJoCo sums contacts in the order of the geoms, so there the mirror is exact to rounding,
    # which 6,000 steps of a free trailer amplify. Where left and right of the robot are swapped as
    # well, it is exact: test_contact_plant.py
    bound = 1e-9 if plant == "contact" else 0.0
    assert np.abs(mirrored - q * [1.0, -1.0, -1.0, -1.0]).max() <= bound


def test_the_free_swing_conserves_its_energy_on_the_analytic_plant() -> None:
    scenario = open_loop((30.0, 6.0, 5.0))
    rows = replay_analytic(scenario, np.tile([6.0, 5.0], (scenario.periods, 1)))
    steady = slice(10, None)  # the servos have arrived
    q, rate = rows.q[steady, 0], rows.q_rate[steady, 0]
    forward = rate[:, 0] * np.cos(q[:, 2]) + rate[:, 1] * np.sin(q[:, 2])
    twist = np.stack([forward, rate[:, 2]], axis=-1)
    hitch, hitch_rate = q[:, 3] - q[:, 2], rate[:, 3] - rate[:, 2]
    energy = swing_energy(hitch, hitch_rate, twist, scenario.robot)
    # fourth-order steps of 11 ms over 30 s
    assert np.ptp(energy) < 1e-9 * np.abs(energy).max()


def test_the_physics_rate_record_is_the_run() -> None:
    run = run_contact(open_loop(*TURN))
    every = run.scenario.steps_per_period
    # θ1 is unwrapped by two formulas, which round differently
    np.testing.assert_allclose(run.physics.q[::every], run.trajectory.q[:, 0], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(
        run.physics.wheel_speed_rad_s[::every], run.trajectory.wheel_speed_rad_s[:, 0]
    )
    # the reconstructed setpoints are what the stiff wheels do
    lag = run.physics.inputs - run.physics.wheel_speed_rad_s[1:]
    assert np.abs(lag).max() < 0.01


def test_a_replay_is_the_run() -> None:
    run = run_contact(open_loop(*TURN))
    again = replay_contact(run.scenario, run.commands)
    np.testing.assert_array_equal(again.q, run.trajectory.q)


def test_the_residuals_are_small_and_have_the_right_signs() -> None:
    # most of a turn at speed: slip points outward, friction never gives energy back
    residuals = Residuals.of(run_contact(open_loop(*TURN)))
    turning = (residuals.time_s > 1.2) & (residuals.time_s < 2.1)  # to the left
    assert (residuals.slip_aside_m_s[turning, :2] < 0.0).all()
    assert (residuals.lateral_speed_m_s[turning] > 0.0).all()
    # 1.23 kg at 0.13 m/s carry 10 mJ
    assert 0.0 < residuals.energy_lost_j[-1] < 1e-3
    assert np.abs(residuals.trailer_torque_n_m).max() < 1e-4


def test_what_the_hitch_stores_and_burns_is_in_the_account() -> None:
    hitch = {"stiffness_n_m_rad": 0.02, "damping_n_m_s_rad": 5e-3}
    run = run_contact(open_loop(*TURN, hitch=hitch))
    q, rate = run.trajectory.q[:, 0], run.trajectory.q_rate[:, 0]
    angle, speed = q[:, 3] - q[:, 2], rate[:, 3] - rate[:, 2]
    # without the hitch's torque this much would be missing
    assert 5e-3 * np.abs(speed).max() > 1e-3
    assert 0.5 * 0.02 * angle[-1] ** 2 > 1e-5
    residuals = Residuals.of(run)
    assert np.abs(residuals.trailer_torque_n_m).max() < 1e-4
    assert 0.0 < residuals.energy_lost_j[-1] < 1e-3
    plain = Residuals.of(run_contact(open_loop(*TURN)))
    # the floor takes what it took without spring and damper; the spring alone holds ten times that
    assert residuals.energy_lost_j[-1] == pytest.approx(plain.energy_lost_j[-1], rel=0.1)


def test_dry_friction_is_in_the_account() -> None:
    friction = 1e-3
    run = run_contact(open_loop(*TURN, hitch={"coulomb_friction_n_m": friction}))
    rate = run.trajectory.q_rate[:, 0]
    sliding = np.abs(rate[:, 3] - rate[:, 2]) > 0.05
    sliding &= np.roll(sliding, 1)  # through the whole period before
    assert sliding.sum() > 10
    # as without friction; a tenth of what would be missing
    assert np.abs(Residuals.of(run).trailer_torque_n_m[sliding]).max() < 0.1 * friction


@pytest.mark.parametrize(
    ("name", "friction_n_m"),
    [
        ("straight_line", {"robot.hitch": 2e-3}),
        ("two_trailers_turn", {"robot.hitches.0": 0.02, "robot.hitches.1": 0.01}),
    ],
)
def test_friction_that_sticks_holds_by_what_it_must(
    name: str, friction_n_m: dict[str, float]
) -> None:
    sets = [f"{hitch}.coulomb_friction_n_m={torque}" for hitch, torque in friction_n_m.items()]
    run = run_contact(load_scenario(name, [*sets, "duration_s=3.0"]))
    rate = np.diff(run.trajectory.q_rate[:, 0, 2:], axis=1)
    assert (np.abs(rate) < 1e-3).mean(axis=0).min() > 0.3  # they stick for a good part of it
    # a tenth of what would be missing, as where it slides
    least = min(friction_n_m.values())
    assert np.abs(Residuals.of(run).trailer_torque_n_m).max() < 0.1 * least


def test_deviation_knows_ahead_from_aside() -> None:
    rows = replay_analytic(open_loop((0.5, 5.0, 5.0)), np.full((15, 2), 5.0))
    moved = replace(rows, q=rows.q + [3e-3, 4e-3, 1e-3, 0.0])
    deviation = Deviation.between(moved, rows)
    np.testing.assert_allclose(deviation.position_m, 5e-3)
    np.testing.assert_allclose(deviation.position_curves["ahead"], 3e-3)
    np.testing.assert_allclose(deviation.position_curves["aside"], 4e-3)
    np.testing.assert_allclose(deviation.angle_curves["hitch"], -1e-3)
    assert deviation.times()["position_over_0.001_m_s"] == 0.0
    assert deviation.times()["position_over_0.01_m_s"] is None


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (
            {"plant": {"pushes": [{"start_s": 0.1, "duration_s": 0.1, "force_n": [1.0, 0.0]}]}},
            "plant.pushes",
        ),
        (
            {
                "plant": {"analytic": {"published_spring": True}},
                "robot": {"hitch": {"stiffness_n_m_rad": 1.0}},
            },
            "plant.analytic.published_spring",
        ),
        ({"ground": {"terrain": {"rms_height_m": 0.002}}}, "ground.terrain: .*; leave ground.ter"),
        ({"robot": {"hitch": {"play_m": 1e-3}}}, "hitch.play_m: .*; leave robot.hitch.play_m out"),
    ],
)
def test_what_only_one_plant_understands_is_refused(change: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match=key):
        refuse_unlike(open_loop((0.5, 1.0, 1.0), **change))


def test_another_scene_is_refused() -> None:
    from ttwmr_mj.assets import models_folder

    scene = str(models_folder() / "scene.xml")
    scenario = open_loop((0.5, 1.0, 1.0), plant={"contact": {"model_path": scene}})
    with pytest.raises(InputError, match=r"plant\.contact\.model_path"):
        refuse_unlike(scenario)


@pytest.mark.parametrize("mode", ["open_loop", "closed_loop"])
def test_the_lab_circle_deviates_by_less_than_a_thousandth_of_its_path(mode: Any) -> None:
    scenario = load_scenario("lab_circle", ["duration_s=20.0"])
    pair = run_pair(scenario, mode, real_wheels=mode == "open_loop")
    share = pair.numbers["position_deviation_per_path"]
    assert share is not None
    assert share < 1e-3


@pytest.mark.parametrize(("mode", "share"), [("open_loop", 0.05), ("closed_loop", 0.5)])
def test_the_extended_model_is_compared_where_the_scenario_has_it(mode: Any, share: float) -> None:
    """It knows the slip and the servo's lag that most of the deviation is from."""
    scenario = load_scenario("lab_circle", ["duration_s=1.5"])
    expected = ExtendedParameters.expected(scenario.robot).model_dump() | {"slip_time_s": 7.5e-4}
    extended = changed(scenario, {"plant.analytic.extended": expected})
    off = [run_pair(one, mode).numbers["position_deviation_max_m"] for one in (scenario, extended)]
    assert 0.0 < off[1] < share * off[0]
    with pytest.raises(InputError, match="real_wheels"):
        run_pair(extended, real_wheels=True)
