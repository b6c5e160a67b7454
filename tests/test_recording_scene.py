"""What the 3D scene of a recording shows: bodies, forces, paths, floor, where they are."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from recordings import (
    BODIES,
    FLOAT32_M,
    ROBOT,
    Recording,
    analytic,
    circle_reference,
    contact_run,
    record,
    recorder,
    robot_model,
)

from ttwmr_mj.plants.contact_readings import read_contacts
from ttwmr_mj.recording.scene.floor import floor_corners
from ttwmr_mj.recording.scene.robot import force_scale_m_n
from ttwmr_mj.recording.scene.target import reference_pieces
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.results.curves import trailer_com
from ttwmr_mj.robot import RobotParameters


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    run = contact_run()
    reference = circle_reference()
    return Recording(record(tmp_path_factory.mktemp("rrd") / "run.rrd", reference, run))


def test_bodies_are_where_mujoco_puts_them(recording: Recording) -> None:
    model = robot_model()
    run = contact_run()
    data = mujoco.MjData(model)
    for k in (0, 17, len(run) - 1):
        data.qpos[:] = run.joint_positions[k, 0]
        mujoco.mj_kinematics(model, data)
        for body in BODIES:
            translation = recording.values(f"/world/{body}", "Transform3D:translation")[k, 0]
            quaternion = recording.values(f"/world/{body}", "Transform3D:quaternion")[k, 0]
            np.testing.assert_allclose(translation, data.body(body).xpos, atol=FLOAT32_M)
            np.testing.assert_allclose(quaternion, data.body(body).xquat[[1, 2, 3, 0]], atol=1e-6)


def test_there_is_no_robot_before_it_is_known_where(tmp_path: Path) -> None:
    with recorder(tmp_path / "run.rrd", circle_reference()):
        pass
    drawn = Recording(tmp_path / "run.rrd").entities
    assert "/world/floor" in drawn
    assert not any(path.startswith(f"/world/{body}") for path in drawn for body in BODIES)


def test_p_is_the_origin_of_the_tractor(recording: Recording) -> None:
    ((_, points),) = recording.entities["/world/tractor/P"]["Points3D:positions"]
    assert points == [[0.0, 0.0, 0.0]]


def test_every_visual_geom_is_drawn_once(recording: Recording) -> None:
    model = robot_model()
    for i in np.flatnonzero(model.geom_group == 2):
        geom = model.geom(int(i))
        body = model.body(geom.bodyid[0]).name
        components = recording.entities[f"/world/{body}/{geom.name}"]
        (shape,) = {name.split(":")[0] for name in components}
        (colour,) = components[f"{shape}:colors"]
        rgba = [(colour[1][0] >> shift) & 255 for shift in (24, 16, 8, 0)]
        np.testing.assert_allclose(rgba, 255 * model.mat_rgba[geom.matid[0]], atol=1)
        if shape == "Cylinders3D":
            ((_, (length,)),) = components["Cylinders3D:lengths"]
            ((_, (radius,)),) = components["Cylinders3D:radii"]
            assert (radius, length) == pytest.approx((geom.size[0], 2 * geom.size[1]))
        else:
            ((_, (half,)),) = components[f"{shape}:half_sizes"]
            np.testing.assert_allclose(half, model.geom_aabb[i, 3:], rtol=1e-6)


def test_contact_forces_carry_the_robot(recording: Recording) -> None:
    run = contact_run()
    vectors = recording.values("/world/contact_forces", "Arrows3D:vectors")
    origins = recording.values("/world/contact_forces", "Arrows3D:origins")
    contacts = read_contacts(run.contact_readings[:, 0])
    np.testing.assert_allclose(origins, contacts.position_m, atol=FLOAT32_M)
    np.testing.assert_allclose(vectors, 0.03 * contacts.force_n, atol=1e-6)
    weight = 9.81 * (ROBOT.tractor.mass_kg + ROBOT.trailer.mass_kg)
    np.testing.assert_allclose(vectors[-1, :, 2].sum() / 0.03, weight, rtol=0.02)


def test_a_heavier_robot_has_shorter_arrows_per_newton() -> None:
    outdoor = RobotParameters.model_validate({"preset": "outdoor"})
    ratio = outdoor.tractor.mass_kg / ROBOT.tractor.mass_kg
    # 2.3 times as large and 12 times as heavy: an axle's load is 2.3 times as long, to one digit
    assert force_scale_m_n(outdoor) == pytest.approx(0.03 * outdoor.looks_scale / ratio, rel=0.1)
    assert force_scale_m_n(outdoor) == 0.006
    assert force_scale_m_n(ROBOT) == 0.03


def test_driven_paths_are_connected(recording: Recording) -> None:
    run = contact_run()
    for path, points in (
        ("/world/driven/tractor", run.q[:, 0, :2]),
        ("/world/driven/trailer", trailer_com(run.q, ROBOT)[:, 0]),
    ):
        rows = [
            row for row in recording.entities[path]["LineStrips3D:strips"] if row[0] is not None
        ]
        strips = np.array([strip for _, strip in rows])[:, 0]
        np.testing.assert_allclose(strips[:, 1, :2], points, atol=FLOAT32_M)
        np.testing.assert_array_equal(strips[1:, 0], strips[:-1, 1])


def test_analytic_rows_stand_on_their_wheels(tmp_path: Path) -> None:
    run = contact_run()
    reference = circle_reference()
    rows = analytic(run)
    recording = Recording(record(tmp_path / "run.rrd", reference, rows))
    assert "Arrows3D:vectors" not in recording.entities["/world/contact_forces"]
    p = recording.values("/world/tractor", "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(p[:, :2], rows.q[:, 0, :2], atol=FLOAT32_M)
    np.testing.assert_allclose(p[:, 2], ROBOT.tractor.wheel_radius_m, atol=FLOAT32_M)
    x, y, z, w = recording.values("/world/trailer", "Transform3D:quaternion")[:, 0].T
    np.testing.assert_allclose([x, y], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.cos(2 * np.arctan2(z, w) - rows.q[:, 0, 3]), 1.0, atol=1e-6)
    # the wheel has turned by the integral of its speed: its spoke points there
    turned = recording.values("/world/wheel_right", "Transform3D:quaternion")[-1, 0]
    yaw = np.array([np.cos(rows.q[-1, 0, 2] / 2), 0, 0, np.sin(rows.q[-1, 0, 2] / 2)])
    angle = np.trapezoid(rows.wheel_speed_rad_s[:, 0, 0], rows.time_s)
    expected = np.empty(4)
    mujoco.mju_mulQuat(expected, yaw, np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0]))
    assert abs(turned @ expected[[1, 2, 3, 0]]) == pytest.approx(1.0, abs=1e-6)


def test_the_floor_reaches_beyond_the_reference_but_is_never_smaller_than_the_lab() -> None:
    low, high = floor_corners(None)
    assert (low.tolist(), high.tolist()) == ([-0.95, -0.71], [0.95, 0.71])
    circle = Circle(centre_m=(2.0, 0.0), radius_m=1.0, angular_rate_rad_s=0.5, theta2="outward")
    path = circle.sample(0.01 * np.arange(1300))  # a whole turn takes 12.6 s
    low, high = floor_corners(path)
    # 0.4 m beyond the circle; 1e-4 m: samples are 5 mm apart, so 3 µm from the extremes at most
    np.testing.assert_allclose(low, [-0.95, -1.4], atol=1e-4)
    np.testing.assert_allclose(high, [3.4, 1.4], atol=1e-4)


def test_floor_and_reference_are_drawn_where_they_are(recording: Recording) -> None:
    reference = circle_reference()
    low, high = floor_corners(reference)
    ((_, corner),) = recording.entities["/world/floor"]["Boxes3D:centers"]
    np.testing.assert_allclose(corner[0][:2], (low + high) / 2, atol=FLOAT32_M)
    ((_, half),) = recording.entities["/world/floor"]["Boxes3D:half_sizes"]
    np.testing.assert_allclose(half[0][:2], (high - low) / 2, atol=FLOAT32_M)
    assert corner[0][2] + half[0][2] == pytest.approx(0.0, abs=FLOAT32_M)  # its top
    ((_, lines),) = recording.entities["/world/floor/grid"]["LineStrips3D:strips"]
    ends = np.array(lines)
    upright = ends[ends[:, 0, 0] == ends[:, 1, 0]]
    level = ends[ends[:, 0, 1] == ends[:, 1, 1]]
    for across, lines in ((0, upright), (1, level)):  # at every whole multiple of 0.1 m
        first, last = np.ceil(10 * low[across]), np.floor(10 * high[across])
        expected = 0.1 * np.arange(first, last + 1)
        np.testing.assert_allclose(lines[:, 0, across], expected, atol=FLOAT32_M)
        reach = np.sort(lines[:, :, 1 - across], axis=1)
        np.testing.assert_allclose(
            reach, [[low[1 - across], high[1 - across]]] * len(lines), atol=FLOAT32_M
        )
    assert (ends[..., :2] >= low - FLOAT32_M).all()
    assert (ends[..., :2] <= high + FLOAT32_M).all()
    for name, points, width in (
        ("tractor", reference.position_m[:, 0], 0.014),
        ("trailer", trailer_com(reference.q, ROBOT)[:, 0], 0.008),
    ):
        ((_, corners),) = recording.entities[f"/world/reference/{name}"]["Mesh3D:vertex_positions"]
        left, right = np.split(np.array(corners), 2)
        np.testing.assert_allclose(np.linalg.norm(left - right, axis=1), width, atol=FLOAT32_M)
        middle = (0.5 * (left + right))[:, None, :2]
        away = np.linalg.norm(middle - points, axis=2).min(axis=1)
        np.testing.assert_allclose(away, 0.0, atol=FLOAT32_M)
        np.testing.assert_allclose(middle[[0, -1], 0], points[[0, -1]], atol=FLOAT32_M)
    marker = recording.values("/world/reference/marker", "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(marker[:, :2], contact_run().ref_q[:, 0, :2], atol=FLOAT32_M)
    assert not marker[:, 2].any()
    ((_, (ball,)),) = recording.entities["/world/reference/marker/ball"]["Ellipsoids3D:centers"]
    assert ball == pytest.approx([0.0, 0.0, 0.11])


def test_a_reference_of_the_trailer_that_ceases_or_jumps_is_cut() -> None:
    points = np.arange(16.0).reshape(8, 2)
    theta2 = np.array([0.0, 0.1, np.nan, 0.3, 0.4, 0.5 - np.pi, 0.6 - np.pi, 0.7 - np.pi])
    cut = [piece[:, 0].tolist() for piece in reference_pieces(points, theta2)]
    assert cut == [[0.0, 2.0], [6.0, 8.0], [10.0, 12.0, 14.0]]
    # a quarter of a turn between samples is a jump
    cut = [len(piece) for piece in reference_pieces(points[:5], np.array([0, 1.5, 3, 4.6, 6.1]))]
    assert cut == [3, 2]
