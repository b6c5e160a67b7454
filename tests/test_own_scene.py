"""A scene of the user's own may add to the laboratory; the robot in it is the scenario's."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.assets import models_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.floor.terrain import Kerb, Terrain
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.engine import warnings_kept
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.overlap import overlaps_m
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import RobotState
from ttwmr_mj.vision.camera.labels import read_layout
from ttwmr_mj.vision.camera.model import hang_camera
from ttwmr_mj.vision.camera.options import CameraOptions
from ttwmr_mj.vision.camera.rendering.posture import Posture

ROBOT = RobotParameters()
SCENE = (models_folder() / "scene.xml").read_text()
XML = (models_folder() / "ttwmr.xml").read_text()
KEY = (
    '<keyframe><key name="mine" qpos="1 1 0.5 0.7 0 0 0.7 0 0 1 0 0 0 0.3 1 0 0 0 1 0 0 0" '
    'qvel="1 0 0 0 0 3 0 0 0 0 0 5 0 0 0 0 0 0"/></keyframe>'
)
AROUND = '<worldbody><body pos="2 2 {z}">{joint}<geom size="0.02" mass="1"/></body></worldbody>'
FLOOR = '<geom name="floor" type="plane" size="0 0 0.05"'
HITCH, WHEEL = '<joint class="hitch" name="hitch"', '<joint class="wheel" name="wheel_right"'
TRAILER = '<body name="trailer">'
RIGHT, LEFT = (
    f'<velocity class="wheel" name="wheel_{side}" joint="wheel_{side}"/>'
    for side in ("right", "left")
)
SLAB = '<geom name="floor" type="box" size="2 2 0.05" pos="0 0 -0.05"'
MOCAP = '<worldbody><body mocap="true" pos="2 2 0"><geom size="0.1"/></body></worldbody>'


def edited(text: str, edits: dict[str, str]) -> str:
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new)
    return text


def scene(
    folder: Path, *, before: str = "", after: str = "", floor: str = FLOOR, robot: Any = None
) -> ContactOptions:
    """A scene in a folder: the shipped one with more in it, and with edits to the robot."""
    text = edited(SCENE, {"<include": f"{before}<include", FLOOR: floor})
    (folder / "scene.xml").write_text(text.replace("</mujoco>", f"{after}</mujoco>"))
    (folder / "ttwmr.xml").write_text(edited(XML, robot or {}))
    return ContactOptions(model_path=str(folder / "scene.xml"))


def driven(options: ContactOptions) -> tuple[np.ndarray, np.ndarray]:
    """Where the robot is at first, and after a turn."""
    plant = ContactPlant(ROBOT, options)
    start = np.array([[0.4, -0.1, 0.7, 0.2]])
    plant.reset(RobotState(q=start, q_rate=np.zeros_like(start)))
    first = plant.state().q
    plant.advance(np.array([[4.0, 1.0]]), 300)
    return first, plant.state().q


@pytest.mark.parametrize(
    "change",
    [
        {"before": KEY},
        {"before": AROUND.format(z=0.02, joint="<freejoint/>")},
        {"before": AROUND.format(z=0.3, joint='<joint type="hinge"/>')},
        {"robot": {XML[XML.index("<keyframe>") : XML.index("</keyframe>")]: "<keyframe>"}},
        {"robot": {RIGHT: "", LEFT: LEFT + RIGHT}},  # the left one first
        {"after": "<worldbody><light pos='0 0 3'/><camera name='mine'/></worldbody>"},
        {"after": MOCAP},
        {"after": '<sensor><gyro site="P"/></sensor><option magnetic="1 0 0"/>'},
    ],
    ids=["keyframe", "box", "door", "no keyframe", "swapped", "looks", "mocap", "sensor"],
)
def test_what_stands_around_the_robot_does_not_change_its_motion(
    change: dict[str, Any], tmp_path: Path
) -> None:
    for got, expected in zip(
        driven(scene(tmp_path, **change)), driven(ContactOptions()), strict=True
    ):
        # with more bodies the solver sums in another order
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-12)


def test_a_slab_is_a_floor_too(tmp_path: Path) -> None:
    """MuJoCo finds contacts with a box in another way than with a plane."""
    turns = [driven(options)[1] for options in (scene(tmp_path, floor=SLAB), ContactOptions())]
    np.testing.assert_allclose(*turns, rtol=0.0, atol=1e-3)


def test_the_camera_knows_the_robot_from_its_own_pose_not_from_a_keyframe(tmp_path: Path) -> None:
    own, shipped = (
        build_model(ROBOT, scene(tmp_path, before=KEY)),
        build_model(ROBOT, ContactOptions()),
    )
    layouts = read_layout(own), read_layout(shipped)
    np.testing.assert_array_equal(layouts[0].offset_m, layouts[1].offset_m)
    np.testing.assert_array_equal(layouts[0].height_m, layouts[1].height_m)
    q = np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(Posture(own).positions(q), Posture(shipped).positions(q))


IN_SCENE = {
    '<compiler boundmass="0.5"/>': "body 'wheel_left': mass 0.5; allowed: 0.03; "
    "robot.tractor.wheel_mass_kg sets it",
    '<compiler boundinertia="0.01"/>': "body 'trailer': inertia 0.01 0.01 0.01; allowed: 0.00042",
    '<option gravity="0 0 -1.62"/>': "option gravity 0 0 -1.62; allowed: 0 0 -9.81; it is",
    '<option timestep="0.01"/>': "option timestep 0.01; allowed: 0.0005; plant.contact.timestep_s",
    '<option integrator="Euler"/>': "option integrator euler; allowed: discrete; no key sets it",
    '<option iterations="1"/>': "option iterations 1; allowed: 50",
    '<option viscosity="5"/>': "option viscosity 5; allowed: 0",
    '<option><flag gravity="disable"/></option>': 'flag gravity="disable"',
    '<option><flag sleep="enable"/></option>': 'flag sleep="enable"',
    '<option o_friction="1 1 1 1 1"/>': "option o_friction 1 1 1 1 1",
    '<worldbody><geom name="ice" size="0.1" pos="3 0 0" priority="1"/></worldbody>': "geom 'ice': "
    "priority 1; give it a priority below the robot's",
    '<equality><weld body1="tractor"/></equality>': "unnamed equality of the robot; leave it out",
    '<equality><joint name="lock" joint1="hitch"/></equality>': "equality 'lock' of the robot",
    '<tendon><fixed name="t"><joint joint="hitch" coef="1"/></fixed></tendon>': "tendon 't' of",
    '<contact><pair geom1="wheel_left" geom2="floor"/></contact>': "contact pair of the robot",
    '<contact><exclude body1="tractor" body2="world"/></contact>': "contact exclude of the robot",
    '<actuator><motor joint="hitch"/></actuator>': "3 actuators; allowed: the two of the wheels",
}
IN_ROBOT = [
    ("<default>", '<default><joint damping="1"/>', "joint 'wheel_right': damping 1; allowed: 0"),
    (HITCH, f'{HITCH} stiffness="0 1 1"', "joint 'hitch': stiffnesspoly 1 1"),
    (HITCH, f'{HITCH} range="-0.1 0.1"', "joint 'hitch': range -0.1 0.1"),
    (HITCH, f'{HITCH} ref="0.5"', "joint 'hitch': ref 0.5; allowed: 0"),
    (HITCH, f'{HITCH} springref="0.5"', "joint 'hitch': springref 0.5"),
    (HITCH, f'{HITCH} armature="0.1"', "joint 'hitch': armature 0.1"),
    (HITCH, f'<joint name="pitch" axis="0 1 0"/>{HITCH}', "joint 'pitch' on the robot"),
    (WHEEL, f'{WHEEL} frictionloss="1"', "joint 'wheel_right': frictionloss 1; allowed: 0"),
    (TRAILER, '<body name="trailer" euler="0 0 0.5">', "body 'trailer': quat 0.968912 0 0 0.2474"),
    (TRAILER, f'<body name="box"><geom size="0.02"/></body>{TRAILER}', "body 'box' on the robot"),
    (TRAILER, f'{TRAILER}<geom name="bumper" size="0.02"/>', "geom 'bumper' on the robot"),
    (RIGHT, RIGHT.replace("/>", ' gear="2"/>'), "actuator 'wheel_right': gear 2; allowed: 1"),
    (RIGHT, RIGHT.replace('t="wheel_right', 't="wheel_left'), "joint wheel_left; allowed: wheel_r"),
    ('026" condim="3"', '026" condim="1"', "geom 'wheel_right': condim 1; allowed: 3"),
    ('<site name="P" ', '<site name="P" pos="0.05 0 0" ', "site 'P': pos 0.05; allowed: 0"),
    ('<contact name="contact_wheel_left"', '<contact name="c"', "no sensor 'contact_wheel_left'"),
]


def refused(options: ContactOptions) -> list[str]:
    with pytest.raises(InputError) as error:
        build_model(ROBOT, options)
    assert {fault.where for fault in error.value.faults} == {"plant.contact.model_path"}
    return [fault.message for fault in error.value.faults]


@pytest.mark.parametrize("added", IN_SCENE)
def test_no_setting_of_a_scene_changes_the_robot_or_its_physics(added: str, tmp_path: Path) -> None:
    told = refused(scene(tmp_path, after=added))
    assert any(IN_SCENE[added] in message for message in told)


@pytest.mark.parametrize(("part", "other", "expected"), IN_ROBOT)
def test_an_edited_robot_is_refused(part: str, other: str, expected: str, tmp_path: Path) -> None:
    told = refused(scene(tmp_path, robot={part: other}))
    assert any(expected in message for message in told)


def test_all_changes_are_told_at_once_and_by_validate_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = scene(
        tmp_path,
        after='<option iterations="1"><flag sleep="enable"/></option>',
        robot={HITCH: f'{HITCH} armature="0.1"'},
    )
    given = ["--set", f"plant.contact.model_path={own.model_path}"]
    for command in (["validate"], ["run", "--out", str(tmp_path / "out")]):
        assert main([*command, "lab_circle", *given]) == 2
        told = capsys.readouterr().err
        for part in ("option iterations 1", 'flag sleep="enable"', "joint 'hitch': armature 0.1"):
            assert f"plant.contact.model_path: got a scene with {part}" in told


def test_a_scene_may_state_what_the_scenario_says(tmp_path: Path) -> None:
    own = scene(tmp_path, after='<option timestep="0.001" gravity="0 0 -9.81" impratio="20"/>')
    step = {"timestep_s": 0.001, "contact_time_constant_s": 0.002, "friction_impedance_ratio": 20.0}
    model = build_model(ROBOT, own.model_copy(update=step))
    assert model.opt.timestep == 0.001


KERB = Kerb(x_m=1.0, y_m=0.0, length_m=0.2, width_m=0.2, height_m=0.002)
MANY = {"trailers": [{"next_hitch_offset_m": 0.23}, {}], "hitches": [{}, {}]}


@pytest.mark.parametrize(
    ("robot", "ground"),
    [
        (RobotParameters.model_validate(MANY), LEVEL),
        (RobotParameters(servo=Servo.model_validate({"motor": {}})), LEVEL),
        (RobotParameters(hitch=Hitch(play_m=1e-3)), LEVEL),
        (ROBOT, Ground(slope_rad=0.1, terrain=Terrain(rms_height_m=0.002), kerbs=(KERB,))),
    ],
    ids=["train", "motor", "play", "ground"],
)
def test_every_robot_and_ground_is_the_same_in_a_scene_of_ones_own(
    robot: RobotParameters, ground: Ground, tmp_path: Path
) -> None:
    ContactPlant(robot, scene(tmp_path), ground=ground)


@pytest.mark.parametrize(
    ("floor", "place"),
    [
        (f'{FLOOR} pos="0 0 -0.1"', "100 mm below its place"),
        (f'{FLOOR} euler="0 0.002 0"', "tilted by 2 mrad"),
        (f'<geom size="0.01" pos="0 0.06 0"/>{FLOOR}', "above its place"),
    ],
    ids=["low", "tilted", "obstacle"],
)
def test_where_the_robot_would_not_stand_is_refused(floor: str, place: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=place) as refused:
        ContactPlant(ROBOT, scene(tmp_path, floor=floor))
    assert refused.value.faults[0].where == "plant.contact.model_path"


ROW = "".join(
    f'<body pos="{1 + 0.12 * i} 1 0.05"><freejoint/><geom size="0.05"/></body>' for i in range(60)
)
FAST = """<body pos="2 2 1"><joint axis="0 0 1" stiffness="1" springref="90"
  damping="-10"/>
<geom size="0.1" pos="0.2 0 0"/></body>"""
FALLING = '<body pos="0.02 0.03 2"><freejoint/><geom type="box" size="0.5 0.5 0.02"/></body>'


def filled(memory: str, bodies: str) -> str:
    return f'<size memory="{memory}"/><worldbody>{bodies}</worldbody>'


@pytest.mark.parametrize(
    ("after", "told", "do"),
    [
        (filled("10K", ""), "out of memory", "<size memory="),
        (filled("200K", ROW), "Insufficient arena memory", "<size memory="),
        (filled("1M", FAST), "Nan, Inf or huge value", "moving that fast"),
    ],
    ids=["no robot fits", "full", "unstable"],
)
def test_a_scene_in_which_physics_fails_is_refused_for_that(
    after: str, told: str, do: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = scene(tmp_path, after=after).model_path
    given = f"plant.contact.model_path={path}"
    for command in ("validate", "run"):
        words = ["--out", str(tmp_path / "run")] if command == "run" else []
        assert main([command, "outer_circle", "--set", given, *words]) == 2
        error = capsys.readouterr().err
        assert told in error
        assert do in error
        assert "floor level" not in error
    assert not (tmp_path / "run").exists()


def test_memory_that_is_full_only_later_ends_the_run_with_the_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = scene(tmp_path, after=filled("32K", FALLING)).model_path
    given = ["duration_s=0.8", f"plant.contact.model_path={path}"]
    given += ["output.recording=false", "output.figures=false"]
    sets = [word for one in given for word in ("--set", one)]
    assert main(["run", "outer_circle", *sets, "--out", str(tmp_path / "run")]) == 1
    said = capsys.readouterr()
    assert "the physics failed: " in said.out + said.err
    assert "memory" in said.out + said.err
    assert "unexpected" not in said.err


def test_what_only_looks_at_a_scene_needs_no_memory_for_contacts(tmp_path: Path) -> None:
    own = scene(tmp_path, after=filled("50K", ROW))
    model = build_model(ROBOT, own)
    shipped = build_model(ROBOT, ContactOptions())
    np.testing.assert_array_equal(read_layout(model).offset_m, read_layout(shipped).offset_m)
    cameras = [hang_camera(each, CameraOptions()) for each in (model, shipped)]
    np.testing.assert_array_equal(cameras[0].rotation, cameras[1].rotation)
    assert overlaps_m(ROBOT, own, np.array([[1.0, 1.0, 0.0, 0.0]])) == {}


def test_warnings_in_python_are_kept_like_those_in_c(tmp_path: Path) -> None:
    own = scene(tmp_path, after='<compiler settotalmass="50"/>')
    with warnings.catch_warnings(record=True) as printed:
        warnings.simplefilter("always")
        with pytest.raises(InputError, match="'settotalmass' is deprecated"):
            build_model(ROBOT, own)
    assert printed == []
    with warnings_kept() as warned:
        warnings.warn("of MuJoCo", UserWarning, stacklevel=1)
        warnings.warn("of a file left open", ResourceWarning, stacklevel=1)
    assert warned == ["of MuJoCo"]
