"""What a recording of a run holds, written and read back with rerun's own reader."""

from __future__ import annotations

from dataclasses import replace
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
    robot_model,
)

from ttwmr_mj.plants.contact import read_contacts
from ttwmr_mj.recording.floor import floor_corners
from ttwmr_mj.recording.series import time_column
from ttwmr_mj.recording.target import reference_pieces
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.results.curves import Curves, trailer_com
from ttwmr_mj.state import FloatArray


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    run = contact_run()
    reference = circle_reference()
    return Recording(record(tmp_path_factory.mktemp("rrd") / "run.rrd", reference, run))


def test_every_row_is_there_in_exact_nanoseconds(recording: Recording) -> None:
    run = contact_run()
    expected = [33_000_000 * k for k in range(len(run))]
    for name in ("x", "y", "theta1", "theta2", "wheel_speed", "hitch_angle", "tractor_error"):
        assert recording.times_ns(f"/plots/{name}/true", "Scalars:scalars") == expected
    for body in BODIES:
        assert recording.times_ns(f"/world/{body}", "Transform3D:translation") == expected
    for path in ("/world/driven/tractor", "/world/driven/trailer"):
        assert recording.times_ns(path, "LineStrips3D:strips") == expected
    assert recording.timelines == {"sim_time"}


def test_times_are_rounded_not_truncated() -> None:
    time_s = np.array([0.57, 1.001])
    assert (1e9 * time_s).astype(int).tolist() != [570_000_000, 1_001_000_000]
    column = time_column(time_s).as_arrow_array()
    assert column.cast("int64").to_pylist() == [570_000_000, 1_001_000_000]


def test_plots_hold_the_rows(recording: Recording) -> None:
    run = contact_run()
    curves = Curves.of(run, ROBOT)

    def scalars(entity: str) -> FloatArray:
        return recording.values(f"/plots/{entity}", "Scalars:scalars")

    for i, (name, scale) in enumerate((("x", 1e3), ("y", 1e3), ("theta1", 1.0), ("theta2", 1.0))):
        np.testing.assert_array_equal(scalars(f"{name}/true"), scale * run.q[:, 0, [i]])
        np.testing.assert_array_equal(scalars(f"{name}/reference"), scale * run.ref_q[:, 0, [i]])
    np.testing.assert_array_equal(scalars("wheel_speed/true"), run.wheel_speed_rad_s[:, 0])
    np.testing.assert_array_equal(scalars("wheel_speed/command"), run.wheel_command_rad_s[:, 0])
    np.testing.assert_array_equal(scalars("tractor_error/true"), 1e3 * curves.tractor_error_m)
    np.testing.assert_array_equal(scalars("trailer_error/true"), 1e3 * curves.trailer_error_m)
    # on a log scale that ends at a micrometre: the run starts on its reference
    for name, error_m in (("tractor", curves.tractor_error_m), ("trailer", curves.trailer_error_m)):
        told_mm = 10 ** scalars(f"position_error/{name}")
        np.testing.assert_allclose(told_mm, np.maximum(1e3 * error_m, 1e-3), rtol=1e-12)
    degrees = np.degrees(curves.theta_error_rad[:, 0])
    np.testing.assert_array_equal(scalars("angle_error/theta1"), degrees[:, [0]])
    np.testing.assert_array_equal(scalars("angle_error/theta2"), degrees[:, [1]])
    np.testing.assert_array_equal(scalars("hitch_angle/true"), np.degrees(curves.hitch_angle_rad))


def test_series_are_named_and_coloured(tmp_path: Path) -> None:
    run = contact_run()
    rows = replace(run, est_q=run.est_q + 0.01)
    recording = Recording(record(tmp_path / "run.rrd", circle_reference(), rows))
    named = {
        entity.removeprefix("/plots/"): components["SeriesLines:names"][0][1]
        for entity, components in recording.entities.items()
        if entity.startswith("/plots/")
    }
    against = {"true": ["true"], "seen": ["estimated"], "reference": ["reference"]}
    angles, error = {"theta1": ["θ1"], "theta2": ["θ2"]}, {"true": ["true"]}
    known, wheels = {"seen": ["estimated"]}, {"true": ["right", "left"]}
    plots = {
        **dict.fromkeys(("x", "y", "theta1", "theta2"), against),
        **dict.fromkeys(("tractor_error", "trailer_error", "hitch_angle"), error),
        **dict.fromkeys(("angle_error", "estimate_angle_error"), angles),
        **dict.fromkeys(("estimate_error", "measurement_age"), known),
        "position_error": {"tractor": ["tractor, P"], "trailer": ["trailer, COM"]},
        "wheel_speed": wheels | {"command": ["right command", "left command"]},
    }
    expected = {
        (plot, line): names for plot, lines in plots.items() for line, names in lines.items()
    }
    assert named == {f"{plot}/{line}": names for (plot, line), names in expected.items()}
    linear = recording.entities["/plots/x/true"]["SeriesLines:interpolation_mode"]
    for entity, names in named.items():
        looks = recording.entities[f"/plots/{entity}"]
        assert len(looks["SeriesLines:colors"][0][1]) == len(names)
        # what was asked for is a wide band under the line of what happened
        wide = entity.endswith(("/reference", "/command"))
        assert looks["SeriesLines:widths"] == [(None, [5.0 if wide else 2.0] * len(names))]
        stepped = entity == "wheel_speed/command"
        assert (looks["SeriesLines:interpolation_mode"] != linear) == stepped


def test_an_estimate_equal_to_the_truth_is_not_drawn(recording: Recording) -> None:
    assert not [entity for entity in recording.entities if entity.endswith("/seen")]


def test_states_hold_their_changes(recording: Recording) -> None:
    assert recording.entities["/wheels"]["StateChange:state"] == [
        (0, ["free"]),
        (330_000_000, ["saturated"]),
        (495_000_000, ["free"]),
    ]
    assert recording.entities["/law"]["StateChange:state"] == [(0, ["regular"])]


def test_rest_is_not_called_singular(tmp_path: Path) -> None:
    """Not while the robot starts either, only a standstill that it comes to while it moves."""
    run = contact_run()
    near, q_rate = run.near_singular.copy(), run.q_rate.copy()
    near[:6], near[20:25] = True, True
    q_rate[0, 0, :2], q_rate[1:, 0, :2] = 0.0, 0.005
    rows = replace(run, near_singular=near, q_rate=q_rate)
    # a cut within the start: what came before is not forgotten
    read = Recording(record(tmp_path / "run.rrd", circle_reference(), rows, cuts=(3,)))
    assert read.entities["/law"]["StateChange:state"] == [
        (0, ["resting"]),
        (198_000_000, ["regular"]),
        (660_000_000, ["near_singular"]),
        (825_000_000, ["regular"]),
    ]


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


def test_report_ends_with_the_result(recording: Recording) -> None:
    (*_, (_, last)) = recording.entities["/report"]["TextDocument:text"]
    assert last == ["**ok**"]
    (*_, (_, last)) = recording.entities["/details"]["TextDocument:text"]
    assert last == ["| rms | 1 mm |\n\n# circle\nseed 7"]


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


def test_an_undefined_reference_gives_no_series(tmp_path: Path) -> None:
    run = contact_run()
    rows = replace(run, ref_q=np.full_like(run.ref_q, np.nan))
    recording = Recording(record(tmp_path / "run.rrd", None, rows))
    for entity in recording.entities:
        assert not entity.startswith(("/world/reference", "/world/miss")), entity
        assert not entity.endswith("/reference"), entity
        assert "_error" not in entity
    for (entity, name), values in recording.temporal().items():
        if name == "Scalars:scalars":
            assert np.isfinite([value for _, value in values]).all(), entity


def test_rows_of_a_broken_run_are_left_out(tmp_path: Path) -> None:
    run = contact_run()
    reference = circle_reference()
    rows = replace(run, q=run.q.copy())
    rows.q[40:] = np.nan
    read = Recording(record(tmp_path / "run.rrd", reference, rows, cuts=(30, 50)))
    for entity, component in (
        ("/world/tractor", "Transform3D:translation"),
        ("/plots/wheel_speed/true", "Scalars:scalars"),
    ):
        assert len(read.times_ns(entity, component)) == 40


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


def test_what_the_sensor_saw_is_plotted_against_the_truth(tmp_path: Path) -> None:
    run = contact_run()
    rows = replace(
        run,
        est_q=run.est_q + [0.003, 0.004, 0.01, -0.02],
        measurement_age_s=np.full_like(run.measurement_age_s, 0.05),
    )
    recording = Recording(record(tmp_path / "run.rrd", None, rows))

    def scalars(entity: str) -> FloatArray:
        return recording.values(f"/plots/{entity}", "Scalars:scalars")

    np.testing.assert_array_equal(scalars("theta2/seen"), rows.est_q[:, 0, [3]])
    np.testing.assert_allclose(scalars("estimate_error/seen"), 5.0)  # mm
    np.testing.assert_allclose(scalars("estimate_angle_error/theta1"), 10.0)  # mrad
    np.testing.assert_allclose(scalars("estimate_angle_error/theta2"), -20.0)
    np.testing.assert_allclose(scalars("measurement_age/seen"), 50.0)  # ms


def test_the_only_properties_are_the_name_and_the_scenario(recording: Recording) -> None:
    """The time of the recording is not among them: it says nothing about the run."""
    properties = {
        entity: sorted(components)
        for entity, components in recording.entities.items()
        if entity.startswith("/__properties")
    }
    assert properties == {
        "/__properties": ["RecordingInfo:name"],
        "/__properties/scenario": [],  # its name, a component of no archetype: the reader skips it
    }
