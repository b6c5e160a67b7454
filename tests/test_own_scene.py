"""A scene of the user's own may add to the laboratory; the robot in it is the scenario's."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.assets import models_folder
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.floor.terrain import Kerb, Terrain
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.engine import warnings_kept
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import RobotState
from ttwmr_mj.vision.camera.labels import read_layout
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
