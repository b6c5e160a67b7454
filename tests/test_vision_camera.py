"""Projection, its inverse, and the labels' geometry, against analytic truth."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from vision_scene import model

from ttwmr_mj.errors import InputError
from ttwmr_mj.references.shared.feasibility import FRONT_LABEL_M, REAR_LABEL_M
from ttwmr_mj.vision.calibration.check import camera_fault
from ttwmr_mj.vision.camera.labels import NAMES, LabelLayout, read_layout
from ttwmr_mj.vision.camera.lens import LensMap
from ttwmr_mj.vision.camera.model import CameraModel, distort, hang_camera, stretch, undistort
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions, Lens
from ttwmr_mj.vision.tracking.pose import solve_pose


def lab() -> CameraModel:
    return hang_camera(model(), LAB_CAMERA)


def test_the_ideal_camera_is_where_the_scene_says() -> None:
    camera = hang_camera(model(), CameraOptions())
    assert camera.position_m == pytest.approx([0.0, 0.0, 1.9])
    focal = 240.0 / np.tan(np.radians(41.1 / 2))
    assert camera.focal_px == pytest.approx([focal, focal])
    assert camera.matrix.tolist() == [[camera.focal_px[0], 0, 319.5], [0, focal, 239.5], [0, 0, 1]]
    # below the camera: the picture's centre; +x right, +y up
    assert camera.project(np.zeros(3)) == pytest.approx([319.5, 239.5])
    right, up = camera.project(np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]))
    assert right == pytest.approx([319.5 + 0.1 * focal / 1.9, 239.5])
    assert up == pytest.approx([319.5, 239.5 - 0.1 * focal / 1.9])


def test_projection_agrees_with_opencv() -> None:
    camera, points = lab(), np.random.default_rng(0).uniform(-0.6, 0.6, (50, 3))
    turn = cv2.Rodrigues(camera.rotation)[0]
    shift = -camera.rotation @ camera.position_m
    expected, _ = cv2.projectPoints(points, turn, shift, camera.matrix, camera.distortion)
    assert camera.project(points) == pytest.approx(np.asarray(expected).reshape(-1, 2), abs=1e-9)


def test_undistort_inverts_distort() -> None:
    slopes = np.random.default_rng(1).uniform([-0.5, -0.38], [0.5, 0.38], (200, 2))
    coefficient = lab().distortion
    assert undistort(distort(slopes, coefficient), coefficient) == pytest.approx(slopes, abs=1e-12)


def test_the_stretch_is_the_lower_eigenvalue_of_the_derivatives() -> None:
    slopes = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 2))
    coefficient, step = np.array([-0.3, 0.1, 0.02, -0.03, 0.05]), 1e-6
    apart = [
        distort(slopes + step * axis, coefficient) - distort(slopes - step * axis, coefficient)
        for axis in np.eye(2)
    ]
    derivatives = np.stack(apart, axis=-1) / (2.0 * step)
    expected = np.linalg.eigvals(derivatives).real.min(axis=-1)
    assert stretch(slopes, coefficient) == pytest.approx(expected, abs=1e-8)


def test_rays_meet_the_plane_they_came_from() -> None:
    camera, rng = lab(), np.random.default_rng(2)
    height = rng.uniform(0.0, 0.3, 60)
    points = np.column_stack([rng.uniform(-0.6, 0.6, (60, 2)), height])
    assert camera.to_plane(camera.project(points), height) == pytest.approx(
        points[:, :2], abs=1e-11
    )


def test_ignoring_a_labels_height_would_cost_centimetres() -> None:
    camera = lab()
    seen = camera.to_plane(camera.project(np.array([0.6, 0.0, 0.0696])), 0.0)
    # parallax: 0.6 m · 0.0696 m / (1.9 m − 0.0696 m)
    assert seen[0] - 0.6 == pytest.approx(0.6 * 0.0696 / (1.9 - 0.0696), rel=1e-6)


def test_a_lens_that_folds_the_picture_is_refused() -> None:
    camera = hang_camera(model(), CameraOptions(lens=Lens(k1=-1.0)))
    with pytest.raises(InputError, match="folds the image"):
        LensMap(camera, 3, 0.0)


def test_layout_comes_from_the_models_sites() -> None:
    layout = read_layout(model())
    assert layout.offset_m[:, 0] == pytest.approx([0.085, -0.015, -0.095, -0.195])
    assert layout.offset_m[:, 1] == pytest.approx(np.zeros(4))
    assert layout.height_m == pytest.approx(np.full(4, 0.026 + 0.0436), abs=1e-4)
    assert len(NAMES) == 4
    # where plans and references keep the labels in view
    assert layout.offset_m[0, 0] + layout.radius_m == pytest.approx(FRONT_LABEL_M)
    assert layout.offset_m[3, 0] - layout.radius_m == pytest.approx(-REAR_LABEL_M)


def beside_the_axis() -> LabelLayout:
    """Labels off the axis, each half's on one side: those of the robot's own model have y = 0."""
    layout = read_layout(model())
    aside = np.array([0.05, 0.03, -0.06, -0.02])
    return replace(layout, offset_m=np.column_stack([layout.offset_m[:, 0], aside]))


def test_label_jacobian_against_differences() -> None:
    layout, q, step = beside_the_axis(), np.array([0.2, -0.1, 0.7, 2.1]), 1e-6
    jacobian = layout.jacobian(q)
    for i, change in enumerate(step * np.eye(4)):
        ahead, behind = layout.centres_m(q + change), layout.centres_m(q - change)
        slope = (ahead - behind)[:, :2].ravel() / (2 * step)
        assert jacobian[:, i] == pytest.approx(slope, abs=1e-9)


@pytest.mark.parametrize("hidden", [(), (0,), (1,), (2,), (3,)])
def test_pose_is_exact_from_four_or_three_labels(hidden: tuple[int, ...]) -> None:
    layout, q = beside_the_axis(), np.array([0.31, -0.22, -2.9, 1.3])
    points = layout.centres_m(q)[:, :2]
    points[list(hidden)] = np.nan
    pose = solve_pose(points, layout)
    assert pose is not None
    assert pose.q == pytest.approx(q, abs=1e-12)
    assert pose.residual_m < 1e-12


@pytest.mark.parametrize("hidden", [(0, 1), (2, 3), (0, 2), (0, 1, 2)])
def test_too_few_labels_give_no_pose(hidden: tuple[int, ...]) -> None:
    layout = read_layout(model())
    points = layout.centres_m(np.zeros(4))[:, :2]
    points[list(hidden)] = np.nan
    assert solve_pose(points, layout) is None


@pytest.mark.parametrize(
    ("coefficients", "focal_px"),
    [
        ((-0.12, 0.05, 6e-4, -4e-4, 0.0), 640.0),
        ((-0.35, 0.12, 0.0, 0.0, 0.0), 400.0),  # 106° from corner to corner
        ((-0.3, 0.08, 1e-3, -5e-4, 0.0), 300.0),
        ((0.5, 0.0, 0.0, 0.0, 0.0), 300.0),
        ((0.0, 0.0, 0.0, 0.0, 0.0), 10.0),
    ],
)
def test_every_pixel_of_a_wide_lens_has_its_ray(
    coefficients: tuple[float, ...], focal_px: float
) -> None:
    camera = replace(lab(), distortion=np.array(coefficients), focal_px=np.full(2, focal_px))
    assert camera_fault(camera) is None
    column, row = np.meshgrid(np.arange(0.0, 640.0, 3.0), np.arange(0.0, 480.0, 3.0))
    pixel = np.stack([column, row], axis=-1)
    assert camera.to_pixels(camera.to_tangents(pixel)) == pytest.approx(pixel, abs=1e-6)


@pytest.mark.parametrize(
    ("coefficients", "focal_px"),
    [
        ((-0.6, 0.05, 0.0, 0.0, 0.0), 640.0),
        ((-1.9, 0.05, 0.0, 0.0, 0.0), 640.0),
        ((-50.0, 0.05, 0.0, 0.0, 0.0), 640.0),
        ((-5000.0, 0.05, 0.0, 0.0, 0.0), 640.0),
        # in a corner only
        ((-1.351, 1.463, -0.01, 0.047, -0.262), 288.0),
        # each pixel that is looked at has a ray that leads back to it, beyond the fold
        ((-450.0, 62000.0, 0.0, 0.0, 0.0), 213.0),
        ((0.0, 0.0, 5.0, 0.0, 0.0), 640.0),
        ((1e9, -1e9, 1e9, 1e9, 1e9), 640.0),
    ],
)
def test_a_lens_that_turns_back_within_the_picture_folds_it(
    coefficients: tuple[float, ...], focal_px: float
) -> None:
    assert replace(lab(), distortion=np.array(coefficients), focal_px=np.full(2, focal_px)).folds
