"""The robot that a camera draws is the plant's, in fewer pieces."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from vision_poses import train_of
from vision_scene import random_pose

from ttwmr_mj.assets import models_folder
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.outline import VISUAL_GROUP
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.vision.camera.labels import read_layout
from ttwmr_mj.vision.camera.options import CameraOptions
from ttwmr_mj.vision.camera.rendering.drawn import SURFACES, build_drawn_model
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera

OPTIONS = ContactOptions()


@cache
def both(trailers: int) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    robot = RobotParameters() if trailers == 1 else train_of(trailers)
    return build_model(robot, OPTIONS), build_drawn_model(robot, OPTIONS)


@pytest.mark.parametrize("trailers", [1, 3])
def test_bodies_joints_and_labels_are_the_same(trailers: int) -> None:
    plain, drawn = both(trailers)
    for name in ("jnt_type", "jnt_pos", "body_pos", "body_parentid", "key_qpos", "qpos0"):
        np.testing.assert_array_equal(getattr(drawn, name), getattr(plain, name))
    ours, theirs = read_layout(drawn), read_layout(plain)
    for name in ("offset_m", "height_m", "colour_bgr", "reach_m", "hue"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert ours.radius_m == theirs.radius_m


@pytest.mark.parametrize("trailers", [1, 3])
def test_of_each_body_every_colour_is_one_part(trailers: int) -> None:
    _, drawn = both(trailers)
    seen = np.flatnonzero(drawn.geom_group == VISUAL_GROUP)
    looks = list(zip(drawn.geom_bodyid[seen], drawn.geom_matid[seen], strict=True))
    assert len(looks) == len(set(looks))


def test_in_a_scene_of_ones_own_parts_that_weigh_are_left_alone(tmp_path: Path) -> None:
    """Also in bodies without a name."""
    box = '<geom type="box" size="0.1 0.1 0.1" group="2" pos="{x} 0 0" mass="{mass}"/>'
    body = '<body pos="1 1 0.5"><freejoint/>{}</body>'
    heavy = body.format("".join(box.format(x=x, mass=1) for x in (0, 1)))
    light = [box.format(x=x, mass=0) for x in (0, 1)] + [box.format(x=2, mass=1)]
    scene = (models_folder() / "scene.xml").read_text()
    scene = scene.replace('file="', f'file="{models_folder()}/')
    path = tmp_path / "scene.xml"
    path.write_text(
        scene.replace("</worldbody>", f"{heavy}{body.format(''.join(light))}</worldbody>")
    )
    options = ContactOptions(model_path=str(path))
    plain, drawn = (make(RobotParameters(), options) for make in (build_model, build_drawn_model))
    np.testing.assert_array_equal(drawn.body_mass, plain.body_mass)
    ends = [
        [int((model.geom_bodyid == model.nbody - i).sum()) for i in (2, 1)]
        for model in (plain, drawn)
    ]
    assert ends == [[2, 3], [2, 2]]


def test_the_pictures_differ_at_edges_only() -> None:
    rng = np.random.default_rng(0)
    plain, drawn = (
        VirtualCamera(CameraOptions(), model, np.random.default_rng(0)) for model in both(1)
    )
    wheels = Joints(plain.model).wheel_qpos
    for _ in range(10):
        q = random_pose(rng)
        qpos = plain.posture.positions(q)
        qpos[wheels] = rng.uniform(-np.pi, np.pi, 2)
        region = plain._renderer.robot_region([qpos], 3)
        pictures = [source._renderer.robot(qpos, region).astype(int) for source in (plain, drawn)]
        differ = np.abs(pictures[0] - pictures[1]).max(axis=2) > 2
        # of some 100 parts' corners and round sides, where they have fewer sides than MuJoCo's
        assert 0 < differ.sum() < 0.02 * pictures[0].any(axis=2).sum()
        inner = differ[1:-1, 1:-1] & differ[:-2, 1:-1] & differ[2:, 1:-1]
        inner &= differ[1:-1, :-2] & differ[1:-1, 2:]
        assert not inner.any()  # nowhere more than a line of two pixels


def test_labels_have_the_same_pixels() -> None:
    cameras = [VirtualCamera(CameraOptions(), model, np.random.default_rng(0)) for model in both(1)]
    qpos = cameras[0].posture.positions(np.array([0.31, -0.12, 0.7, 1.9]))
    region = cameras[0]._renderer.robot_region([qpos], 3)
    plain, drawn = (source._classes[source._renderer.robot_ids(qpos, region)] for source in cameras)
    for label in range(3, 7):
        np.testing.assert_array_equal(drawn == label, plain == label)
        assert (plain == label).sum() > 700
    assert (plain != drawn).mean() < 2e-3  # tractor and trailer: at edges


@pytest.mark.parametrize("kind", SURFACES)
def test_surfaces_are_closed_and_look_outwards(kind: mujoco.mjtGeom) -> None:
    size = np.array([0.03, 0.02, 0.01])
    points, normals, triangles = SURFACES[kind](size)
    corners = points[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = across / np.linalg.norm(across, axis=1, keepdims=True)
    # half the angle of a side of the polygon, at most 22.5°
    assert ((facing[:, None] * normals[triangles]).sum(axis=2) > np.cos(np.radians(22.6))).all()
    # Gauss's theorem: the volume
    volume = (corners[:, 0] * across).sum() / 6.0
    whole = {mujoco.mjtGeom.mjGEOM_BOX: 8 * size.prod()}
    expected = whole.get(kind, 2.0 * np.pi * size[0] ** 2 * size[1])
    assert volume == pytest.approx(expected, rel=0.03)  # a polygon of 25 sides lacks 1 %
    np.testing.assert_allclose(across.sum(axis=0), 0.0, atol=1e-12)
