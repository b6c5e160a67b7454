"""Planar coordinates and MuJoCo's: there and back, and what MuJoCo makes of them."""

from __future__ import annotations

import mujoco
import numpy as np

from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.joints import HEIGHT, Joints, W, Y
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.robot import RobotParameters

MODEL = build_model(RobotParameters(), ContactOptions())
JOINTS = Joints(MODEL)
Q = np.array([[0.3, -0.2, 1.1, 0.4], [-1.0, 0.5, -2.9, -3.3]])
RATE = np.array([[0.1, 0.2, -0.5, 0.7], [0.0, -0.3, 0.4, 0.2]])
WHEELS = np.array([[3.0, -2.0], [1.0, 0.5]])


def test_there_and_back() -> None:
    qpos, qvel = JOINTS.standing(MODEL.qpos0, Q), JOINTS.moving(RATE, WHEELS, MODEL.nv)
    q, rate = JOINTS.planar(qpos, qvel)
    np.testing.assert_allclose(q, Q, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rate, RATE, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(qvel[:, JOINTS.wheel_qvel], WHEELS)


def test_a_tilted_robot_keeps_its_tilt_and_height_when_it_is_turned() -> None:
    pattern = np.array(MODEL.qpos0)
    pattern[JOINTS.free_qpos + HEIGHT] = 0.02
    pattern[JOINTS.free_qpos + Y], pattern[JOINTS.free_qpos + W] = np.sin(0.1), np.cos(0.1)
    qpos = JOINTS.standing(pattern, Q)
    for i, (x, y, theta1, _) in enumerate(Q):
        data = mujoco.MjData(MODEL)
        data.qpos[:] = qpos[i]
        mujoco.mj_kinematics(MODEL, data)
        np.testing.assert_allclose(data.body("tractor").xpos, [x, y, 0.02], atol=1e-15)
        # pitched by 0.2 rad nose down, then turned by θ1 about the vertical
        cos, sin = np.cos(theta1), np.sin(theta1)
        ahead = data.body("tractor").xmat.reshape(3, 3)[:, 0]
        expected = [np.cos(0.2) * cos, np.cos(0.2) * sin, -np.sin(0.2)]
        np.testing.assert_allclose(ahead, expected, atol=1e-14)


def test_the_bodies_are_where_the_coordinates_say_and_move_as_they_say() -> None:
    data = mujoco.MjData(MODEL)
    data.qpos[:] = JOINTS.standing(MODEL.qpos0, Q)[0]
    data.qvel[:] = JOINTS.moving(RATE, WHEELS, MODEL.nv)[0]
    mujoco.mj_forward(MODEL, data)
    for name, angle, rate in (("tractor", Q[0, 2], RATE[0, 2]), ("trailer", Q[0, 3], RATE[0, 3])):
        ahead = data.body(name).xmat.reshape(3, 3)[:, 0]
        np.testing.assert_allclose(ahead, [np.cos(angle), np.sin(angle), 0.0], atol=1e-14)
        velocity = np.zeros(6)
        body = MODEL.body(name).id
        mujoco.mj_objectVelocity(MODEL, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
        np.testing.assert_allclose(velocity[2], rate, atol=1e-14)
        np.testing.assert_allclose(velocity[3:5], RATE[0, :2], atol=1e-14)
