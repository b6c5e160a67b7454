"""The robot's numbers: lists of trailers and hitches, names of the first, states of any width."""

from __future__ import annotations

import pickle
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from pydantic import ValidationError

from ttwmr_mj.composite import tractor_chassis, trailer_chassis, wheel_inertia
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import Casters, Hitch, RobotParameters, Servo, Tractor, Trailer
from ttwmr_mj.scenario.file import check_scenario, dump_scenario, load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import RobotState, hitch_angles, unwrap_near, wrap

LONG, SHORT = Trailer(mass_kg=0.5, next_hitch_offset_m=0.3), Trailer(com_offset_m=0.1)
DAMPED, DRY = Hitch(damping_n_m_s_rad=0.1), Hitch(coulomb_friction_n_m=0.2)
TRAIN = RobotParameters(trailers=(LONG, SHORT), hitches=(DAMPED, DRY))
TABLES: dict[str, Any] = {
    "trailers": [{"mass_kg": 0.5, "next_hitch_offset_m": 0.3}, {"com_offset_m": 0.1}],
    "hitches": [{"damping_n_m_s_rad": 0.1}, {"coulomb_friction_n_m": 0.2}],
}


def scenario(robot: dict[str, Any]) -> Scenario:
    data = tomllib.loads(dump_scenario(load_scenario("lab_circle"))) | {"robot": robot}
    return check_scenario(data, "mine.toml")


def test_one_free_trailer_is_the_default() -> None:
    robot = RobotParameters()
    assert (robot.trailers, robot.hitches) == ((Trailer(),), (Hitch(),))


def test_a_summary_is_the_first_sentence_of_the_description() -> None:
    assert Tractor.summary() == (
        "The differential-drive tractor (Table I), chassis, wheels and caster together"
    )
    assert Hitch.summary() == "A trailer's revolute joint, the first at P"
    undescribed = type("Undescribed", (Tractor,), {"__doc__": None})
    assert undescribed.summary() == ""


def test_the_first_trailer_and_hitch_have_names_of_their_own() -> None:
    assert (TRAIN.trailer, TRAIN.hitch) == (LONG, DAMPED)
    assert RobotParameters(trailer=SHORT, hitch=DRY).trailers == (SHORT,)
    assert RobotParameters(trailer=SHORT, hitch=DRY).hitches == (DRY,)
    assert RobotParameters.model_validate(TABLES) == TRAIN


def test_the_names_of_the_first_set_single_values_of_a_list() -> None:
    given = {**TABLES, "trailer": {"mass_kg": 0.6}, "hitch": {"damping_n_m_s_rad": 0.3}}
    robot = RobotParameters.model_validate(given)
    assert robot.trailers == (LONG.model_copy(update={"mass_kg": 0.6}), SHORT)
    assert robot.hitches == (Hitch(damping_n_m_s_rad=0.3), DRY)
    # objects as well as tables
    mixed = RobotParameters.model_validate(
        {"trailers": (LONG, SHORT), "hitches": (DRY, DRY), "trailer": {"mass_kg": 0.6}}
    )
    assert mixed.trailers == robot.trailers


def test_a_copy_may_replace_the_first() -> None:
    copy = TRAIN.model_copy(update={"hitch": DRY, "servo": Servo(preset="fast")})
    assert copy.hitches == (DRY, DRY)
    assert copy.trailers == TRAIN.trailers
    assert copy.servo.speed_limit_rad_s == 40.0
    assert TRAIN.hitch == DAMPED
    both = TRAIN.model_copy(update={"trailers": (SHORT, LONG), "trailer": LONG})
    assert both.trailers == (LONG, LONG)
    assert TRAIN.model_copy() == TRAIN
    assert pickle.loads(pickle.dumps(TRAIN)) == TRAIN  # our own bytes


@pytest.mark.parametrize("robot", [RobotParameters(), TRAIN], ids=["one", "two"])
def test_what_is_written_loads_back_equal(robot: RobotParameters) -> None:
    assert RobotParameters.model_validate(robot.model_dump()) == robot
    assert RobotParameters.model_validate_json(robot.model_dump_json()) == robot


def test_one_trailer_is_written_by_its_name_and_several_as_a_list() -> None:
    one, two = RobotParameters().model_dump(), TRAIN.model_dump()
    names = ["preset", "looks_scale", "tractor", "trailer", "hitch", "servo", "casters"]
    assert list(one) == names
    assert one["trailer"]["mass_kg"] == 0.33
    assert list(two) == [{"trailer": "trailers", "hitch": "hitches"}.get(n, n) for n in names]


def test_a_resolved_train_loads_back_and_its_first_trailer_can_be_set(tmp_path: Path) -> None:
    found = scenario(TABLES)
    path = tmp_path / "train.toml"
    path.write_text(dump_scenario(found), encoding="utf-8")
    assert load_scenario(str(path)) == found
    assert found.robot == TRAIN
    changed = load_scenario(str(path), ["robot.trailer.mass_kg=0.7", "robot.trailers.1.mass_kg=2"])
    assert [trailer.mass_kg for trailer in changed.robot.trailers] == [0.7, 2.0]


@pytest.mark.parametrize(
    ("robot", "expected"),
    [
        ({**TABLES, "hitches": [{}]}, "robot.hitches: got 1; allowed: as many as there are tra"),
        ({"hitches": [{}, {}]}, "robot.hitches: got 2; allowed: as many as there are trailers, 1"),
        ({"trailers": []}, "robot.trailers: got []; allowed: at least 1 of them"),
        ({"trailers": [{}, {}], "hitches": [{}, {}]}, "robot.trailer.next_hitch_offset_m: missing"),
        ({"trailers": 3, "trailer": {}}, "robot.trailers: got 3"),
        ({"trailers": [], "trailer": {}}, "robot.trailers: got []; allowed: at least 1 of them"),
        ({"trailers": "", "trailer": {}}, "robot.trailers: got ''; allowed: a list"),
        ({"trailers": {}, "trailer": {}}, "robot.trailers: got a table; allowed: a list"),
        ({"hitches": [], "hitch": {}}, "robot.hitches: got 0; allowed: as many as there are tr"),
        ({"hitches": 0, "hitch": {}}, "robot.hitches: got 0; allowed: a list"),
        ({"hitches": False, "hitch": {}}, "robot.hitches: got False; allowed: a list"),
        ({"trailer": 3}, "robot.trailer: got 3"),
        ({"trailers": [{"mass_kg": -1.0}]}, "robot.trailer.mass_kg: got -1.0"),
        ({"hitch": {"dampin": 1}}, "robot.hitch.dampin: unknown key"),
        ({"traler": {}}, "robot.traler: unknown key (did you mean 'trailer'?)"),
        (
            {**TABLES, "trailers": [TABLES["trailers"][0], {"mas_kg": 1}]},
            "robot.trailers.1.mas_kg: unknown key (did you mean 'mass_kg'?)",
        ),
        (
            {**TABLES, "trailers": [TABLES["trailers"][0], {"yaw_inertia_kg_m2": 1e-6}]},
            "robot.trailers.1.yaw_inertia_kg_m2: got 1e-06; the wheels and casters",
        ),
        (
            {"casters": {"mass_kg": 0.4}},
            "robot.trailer.mass_kg: got 0.33; wheels and casters weigh 0.8 kg",
        ),
        (
            {"tractor": {"mass_kg": 0.06}},
            "robot.tractor.mass_kg: got 0.06; wheels and casters weigh 0.061 kg",
        ),
    ],
)
def test_faults_name_the_key(robot: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        scenario(robot)
    assert f"1 error\n  {expected}" in str(caught.value)


def test_the_schema_shows_both_forms() -> None:
    schema = Scenario.model_json_schema()["$defs"]
    robot = schema["RobotParameters"]["properties"]
    assert robot["trailer"] == robot["trailers"]["items"] == {"$ref": "#/$defs/Trailer"}
    assert robot["hitch"] == robot["hitches"]["items"] == {"$ref": "#/$defs/Hitch"}
    assert schema["BeliefOptions"]["properties"]["robot"]["$ref"] == "#/$defs/RobotParameters"


def test_other_values_are_laid_over_a_robot() -> None:
    fast = RobotParameters(servo=Servo(preset="fast", stall_torque_n_m=2.0))
    over = fast.overridden({"servo": {"preset": "lab"}, "trailer": {"mass_kg": 0.3}})
    assert over.servo == Servo(preset="lab", stall_torque_n_m=2.0)
    assert over.trailers == (Trailer(mass_kg=0.3),)
    assert fast.overridden({"servo": {"speed_limit_rad_s": 9.0}}).servo == Servo(
        preset="fast", stall_torque_n_m=2.0, speed_limit_rad_s=9.0
    )
    first = TRAIN.overridden({"trailer": {"mass_kg": 0.3}})
    assert first.trailers == (LONG.model_copy(update={"mass_kg": 0.3}), SHORT)
    every = TRAIN.overridden(
        {"trailers": [{"next_hitch_offset_m": 0.4}, {"mass_kg": 3.0}], "hitches": [{}, {}]}
    )
    assert [trailer.mass_kg for trailer in every.trailers] == [0.5, 3.0]
    assert every.trailer.next_hitch_offset_m == 0.4
    assert every.hitches == TRAIN.hitches
    with pytest.raises(ValidationError, match=r"greater than or equal to 0\.000000001"):
        fast.overridden({"trailer": {"mass_kg": 0.0}})
    assert fast.overridden({}) == fast


def test_swing_length_and_inertia_are_those_of_a_pendulum() -> None:
    """A point mass on a massless rod: K is the rod; a rod about its end: two thirds of it."""
    point = Trailer(mass_kg=2.0, com_offset_m=0.25, yaw_inertia_kg_m2=1e-12)
    assert point.swing_length_m == pytest.approx(0.25, rel=1e-9)
    assert point.swing_inertia_kg_m2 == pytest.approx(2.0 * 0.25**2, rel=1e-9)
    rod = Trailer(mass_kg=2.0, com_offset_m=0.3, yaw_inertia_kg_m2=2.0 * 0.6**2 / 12)
    assert rod.swing_length_m == pytest.approx(0.4, rel=1e-12)
    assert rod.swing_inertia_kg_m2 == pytest.approx(2.0 * 0.6**2 / 3, rel=1e-12)
    robot = RobotParameters(trailer=rod, tractor=Tractor(track_width_m=0.2))
    assert robot.swing_length_m == rod.swing_length_m
    assert robot.swing_inertia_kg_m2 == rod.swing_inertia_kg_m2
    assert robot.half_track_m == 0.1


def test_chassis_and_parts_make_the_whole() -> None:
    robot = TRAIN.model_copy(update={"casters": Casters(mass_kg=0.01)})
    for index, trailer in enumerate(robot.trailers):
        chassis = trailer_chassis(robot, index)
        assert chassis.mass_kg == pytest.approx(trailer.mass_kg - 0.02)
        assert chassis.x_m == pytest.approx(-trailer.com_offset_m)
        ball = 0.4 * 0.01 * 0.008**2 + 0.01 * 0.05**2
        assert chassis.yaw_inertia_kg_m2 == pytest.approx(trailer.yaw_inertia_kg_m2 - 2 * ball)
    chassis = tractor_chassis(robot)
    # the COM of the parts, weighed, is Table I's
    moment = chassis.mass_kg * chassis.x_m + 0.01 * robot.casters.tractor_position_m
    assert moment / robot.tractor.mass_kg == pytest.approx(robot.tractor.com_offset_m)
    # and so is their inertia about it (Steiner): two wheels aside of P, the ball ahead of it
    com, (_, wheel) = robot.tractor.com_offset_m, wheel_inertia(robot)
    parts = [
        chassis.yaw_inertia_kg_m2 + chassis.mass_kg * (chassis.x_m - com) ** 2,
        2 * (wheel + 0.03 * (com**2 + 0.0595**2)),
        0.4 * 0.01 * 0.008**2 + 0.01 * (0.075 - com) ** 2,
    ]
    assert sum(parts) == pytest.approx(robot.tractor.yaw_inertia_kg_m2)
    # a solid cylinder of 0.03 kg, r = 26 mm, 12 mm wide
    assert wheel == pytest.approx(0.03 * (3 * 0.026**2 + 0.012**2) / 12)
    assert wheel_inertia(robot)[0] == pytest.approx(0.5 * 0.03 * 0.026**2)


def test_a_state_is_as_wide_as_the_robot_is_long() -> None:
    state = RobotState.at_rest(1, 2, 0.1, [0.4, 0.2], nsim=3)
    assert state.q.shape == state.q_rate.shape == (3, 5)
    assert state.q[2].tolist() == [1.0, 2.0, 0.1, 0.4, 0.2]
    assert not state.q_rate.any()
    np.testing.assert_allclose(hitch_angles(state.q), [[0.3, -0.2]] * 3, atol=1e-15)
    np.testing.assert_array_equal(state.hitch_angle_rad, hitch_angles(state.q)[:, 0])
    single = RobotState.at_rest(0, 0, 0, 0.5)
    assert single.q.dtype == np.float64
    assert single.hitch_angle_rad.tolist() == [0.5]


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_angles_on_the_circle_are_in_the_half_open_range_to_the_last_bit(kind: type) -> None:
    pi = kind(np.pi)
    ends = [turns * pi for turns in (-3, -1, 1, 3)]
    near = np.array([*ends, *(np.nextafter(end, kind(to)) for end in ends for to in (-99, 99))])
    assert wrap(near).dtype == near.dtype == kind
    assert ((wrap(near) >= -pi) & (wrap(near) < pi)).all()
    assert wrap(np.nextafter(-np.pi, -4.0)) == np.nextafter(np.pi, 0.0)
    angles = np.random.default_rng(0).uniform(-50.0, 50.0, 10_000).astype(kind)
    assert np.array_equal(wrap(angles), (angles + pi) % (2 * pi) - pi)  # as it ever was
    assert np.isnan(wrap(np.array([np.nan]))).all()


def test_an_infinite_angle_is_nowhere_on_the_circle_and_no_warning() -> None:
    with warnings.catch_warnings(action="error"):
        wrapped = wrap(np.array([np.inf, 4.0, -np.inf]))
    assert np.isnan(wrapped[[0, 2]]).all()
    assert wrapped[1] == 4.0 - 2 * np.pi


def test_an_angle_is_unwrapped_to_the_nearest_representative() -> None:
    near = unwrap_near(np.array([0.1, -3.0, 3.0]), np.array([6.0, 3.0, -3.0 - 2 * np.pi]))
    np.testing.assert_allclose(near, [0.1 + 2 * np.pi, 2 * np.pi - 3.0, 3.0 - 4 * np.pi])


def test_curves_of_a_train_look_at_every_angle() -> None:
    rows = Trajectory.empty(np.arange(2.0), 1, trailers=2)
    rows.q[:] = [0.0, 0.0, 0.1, 0.4, 0.2]
    rows.ref_q[:] = [0.3, 0.4, 0.0, 0.4, 2 * np.pi]
    curves = Curves.of(rows, TRAIN)
    np.testing.assert_allclose(curves.theta_error_rad[0, 0], [0.1, 0.0, 0.2], atol=1e-15)
    np.testing.assert_allclose(curves.hitch_angle_rad, 0.3)
    np.testing.assert_allclose(curves.tractor_error_m, 0.5)


def test_tables_written_by_hand_load_as_lists(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    data = tomllib.loads(dump_scenario(load_scenario("lab_circle")))
    data["robot"] = {}
    text = "[[robot.trailers]]\nmass_kg = 0.4\n[[robot.hitches]]\ndamping_n_m_s_rad = 0.2\n"
    path.write_text(tomli_w.dumps(data).replace("[robot]\n", text), encoding="utf-8")
    robot = load_scenario(str(path)).robot
    assert (robot.trailer.mass_kg, robot.hitch.damping_n_m_s_rad) == (0.4, 0.2)


def test_wheels_may_differ_by_no_more_than_their_mean_radius() -> None:
    with pytest.raises(InputError) as caught:
        scenario({"tractor": {"wheel_radius_difference_m": 0.03}})
    assert "robot.tractor.wheel_radius_difference_m: got 0.03" in str(caught.value)
    assert "between -0.026 and 0.026" in str(caught.value)
