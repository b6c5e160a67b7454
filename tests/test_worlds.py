"""Worlds: what they fill in, what stays, what is believed, and that a seed is a world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.errors import InputError
from ttwmr_mj.robot import Trailer
from ttwmr_mj.scenario.file import check_scenario, dump_scenario, load_scenario, put_value
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.tables import worlds

TRUTH, CAMERA = "inverted_trailer", "inverted_trailer_camera"


def unkind(seed: int, name: str = TRUTH, *more: str) -> Scenario:
    return load_scenario(name, ["world=unkind", f"seed={seed}", *more])


@pytest.mark.parametrize("world", ["lab", "unkind"])
@pytest.mark.parametrize("name", [TRUTH, "lab_circle_camera"])
def test_a_resolved_scenario_is_the_same_world(name: str, world: str, tmp_path: Path) -> None:
    scenario = load_scenario(name, [f"world={world}", "seed=3"])
    path = tmp_path / "again.toml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    again = load_scenario(str(path))
    assert again == scenario


def test_kind_fills_in_nothing() -> None:
    assert load_scenario(TRUTH, ["world=kind"]) == load_scenario(TRUTH)


def test_the_laboratory_has_each_of_its_numbers_and_tells_none() -> None:
    kind, lab = load_scenario(TRUTH), load_scenario(TRUTH, ["world=lab"])
    for known in worlds.LAB:
        place = lab
        for part in known.key.split("."):
            place = getattr(place, part)
        if known.key == "robot.servo.motor":
            assert place is not None
        else:
            assert place == known.value
    believed = lab.believed_robot.model_copy(update={"servo": kind.robot.servo})
    assert believed == kind.robot
    assert lab.believed_ground.gravity_m_s2 == pytest.approx([0.0, 0.0])
    assert lab.sensing.latency_s == worlds.PERIOD_S
    assert lab.belief.latency_s is None
    assert load_scenario(CAMERA, ["world=lab"]).sensing == load_scenario(CAMERA).sensing


def test_what_the_scenario_gives_stays() -> None:
    given = unkind(5, TRUTH, "ground.slope_rad=0.1", "robot.hitch.coulomb_friction_n_m=0.002")
    drawn = unkind(5)
    assert given.ground.slope_rad == 0.1
    assert given.believed_ground.slope_rad == 0.1  # who gives a slope is believed to know it
    assert given.robot.hitch.coulomb_friction_n_m == 0.002
    assert given.robot.casters == drawn.robot.casters  # and leaves the other draws alone
    assert given.robot.trailer == drawn.robot.trailer
    longer = unkind(5, TRUTH, "robot.trailer.com_offset_m=0.2")
    ratio = drawn.robot.trailer.com_offset_m / Trailer().com_offset_m
    assert longer.robot.trailer.com_offset_m == pytest.approx(0.2 * ratio)
    assert longer.believed_robot.trailer.com_offset_m == 0.2


def test_of_a_list_the_first_is_what_the_scenario_gives() -> None:
    drawn = unkind(5)
    ratio = drawn.robot.trailer.com_offset_m / Trailer().com_offset_m
    listed = unkind(5, TRUTH, "robot.trailers=[{com_offset_m=0.2}]")
    assert listed.robot.trailer.com_offset_m == pytest.approx(0.2 * ratio)
    assert listed.believed_robot.trailer.com_offset_m == 0.2
    rough = load_scenario(TRUTH, ["world=lab", "robot.hitches=[{coulomb_friction_n_m=0.002}]"])
    assert rough.robot.hitch.coulomb_friction_n_m == 0.002


def test_a_presets_robot_stays_that_robot() -> None:
    drawn, usual = unkind(5, "outdoor_circle"), load_scenario("outdoor_circle").robot
    for believed, true, told in (
        (drawn.believed_robot.tractor.wheel_radius_m, drawn.robot.tractor.wheel_radius_m)
        + (usual.tractor.wheel_radius_m,),
        (drawn.believed_robot.trailer.com_offset_m, drawn.robot.trailer.com_offset_m)
        + (usual.trailer.com_offset_m,),
    ):
        assert believed == told
        assert true != told
        assert true == pytest.approx(told, rel=worlds.LENGTH_SHARE)


def test_draws_stay_in_their_ranges_and_reach_far_into_them() -> None:
    many = [unkind(seed) for seed in range(200)]
    kind = load_scenario(TRUTH).robot
    ranges = {
        "slope": ([s.ground.slope_rad for s in many], 0.0, worlds.SLOPE_RAD),
        "downhill": ([s.ground.downhill_rad for s in many], -np.pi, np.pi),
        "rolling": ([s.robot.casters.rolling_resistance_m for s in many], 0.0, worlds.ROLLING_M),
        "dry": ([s.robot.hitch.coulomb_friction_n_m for s in many], 0.0, worlds.DRY_N_M),
        "l": (
            [s.robot.trailer.com_offset_m / kind.trailer.com_offset_m - 1.0 for s in many],
            -worlds.LENGTH_SHARE,
            worlds.LENGTH_SHARE,
        ),
        "r": (
            [s.robot.tractor.wheel_radius_m / kind.tractor.wheel_radius_m - 1.0 for s in many],
            -worlds.RADIUS_SHARE,
            worlds.RADIUS_SHARE,
        ),
        "latency": ([s.sensing.latency_s for s in many], 0.0, 0.066),
    }
    for name, (values, low, high) in ranges.items():
        assert low <= min(values) < low + 0.05 * (high - low), name
        assert high - 0.05 * (high - low) < max(values) <= high * (1 + 1e-12), name
    # a third each, within three standard deviations of a draw of 200
    shares = [
        np.mean([np.isclose(s.sensing.latency_s, t) for s in many]) for t in (0, 0.033, 0.066)
    ]
    assert np.abs(np.array(shares) - 1 / 3).max() < 3.0 * np.sqrt(2 / 9 / 200)
    assert {s.belief.latency_s for s in many} == {worlds.PERIOD_S}
    assert all(s.believed_robot == many[0].believed_robot for s in many)


def test_a_camera_is_moved_after_its_calibration() -> None:
    many = [unkind(seed, CAMERA) for seed in range(50)]
    off = [np.hypot(s.sensing.camera.x_m, s.sensing.camera.y_m) for s in many]
    tilt = [np.hypot(s.sensing.camera.roll_rad, s.sensing.camera.pitch_rad) for s in many]
    assert 0.9 * worlds.CAMERA_M < max(off) <= worlds.CAMERA_M
    assert 0.9 * worlds.CAMERA_RAD < max(tilt) <= worlds.CAMERA_RAD
    for scenario in many:
        assert scenario.believed_camera == load_scenario(CAMERA).believed_camera
    without = unkind(1, "lab_circle_camera")
    kind = load_scenario("lab_circle_camera")
    assert without.sensing.camera != kind.sensing.camera
    assert without.believed_camera == kind.believed_camera


def test_one_seed_is_one_world() -> None:
    assert unkind(7) == unkind(7)
    assert unkind(7).ground != unkind(8).ground


def test_an_unknown_world_is_refused() -> None:
    with pytest.raises(InputError, match="world: got 'cruel'"):
        load_scenario(TRUTH, ["world=cruel"])


GIVEN_WRONG = (
    *("sensing.latency_s=-1", "sensing.latency_s=-inf", "sensing.latency_s=99"),
    *(f"sensing.latency_s={what}" for what in ("fast", "[]", "{}", "[1]", "0.02")),
    *("robot.tractor.wheel_radius_m=26mm", "robot.tractor.wheel_radius_m=1.1"),
    *("robot.trailer.com_offset_m=true", "robot.trailer.com_offset_m=x"),
    *("robot.trailers=[]", "robot.trailers={}", "robot.preset=indoor"),
    *("control.sampling_time_s=-0.033", "control.sampling_time_s=0", "seed=-1", "seed=x"),
)


@pytest.mark.parametrize("given", GIVEN_WRONG)
def test_what_is_given_wrong_is_told_as_in_the_kind_world(given: str) -> None:
    def told(world: str, seed: int) -> str:
        with pytest.raises(InputError) as caught:
            load_scenario("lab_circle", [f"seed={seed}", f"world={world}", given])
        return str(caught.value)

    for seed in range(4):
        assert told("lab", seed) == told("unkind", seed) == told("kind", seed)


@pytest.mark.parametrize(
    "key",
    [
        *("sensing.latency_s", "control.sampling_time_s"),
        *("robot.trailer.com_offset_m", "robot.tractor.wheel_radius_m"),
    ],
)
def test_numbers_beyond_a_floats_are_refused_with_their_key(key: str) -> None:
    data = load_scenario("lab_circle").model_dump(exclude_unset=True)
    data["world"] = "unkind"
    put_value(data, key.split("."), 10**400, "test")
    with pytest.raises(InputError, match=key):
        check_scenario(data, "mine")


def test_what_only_the_world_makes_wrong_is_told_so() -> None:
    wide = ["robot.tractor.wheel_radius_m=1.0", "robot.tractor.yaw_inertia_kg_m2=1.0"]
    assert load_scenario("lab_circle", wide).robot.tractor.wheel_radius_m == 1.0
    larger = r"wheel_radius_m: got 1\.00\d*; allowed: less than or equal to 1; due to what world = "
    with pytest.raises(InputError, match=larger + "'unkind' sets; with 'kind' it is sound"):
        load_scenario("lab_circle", [*wide, "world=unkind"])
    steps = "a whole number of steps of 0.003 s .*; due to what world = 'lab' sets"
    with pytest.raises(InputError, match=steps):  # of the motor, which only the world has
        load_scenario("lab_circle", ["plant.contact.timestep_s=0.003", "world=lab"])
