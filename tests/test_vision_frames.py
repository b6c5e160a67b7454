"""Frames, their truth, the sensor model, and everything that can go wrong with them."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from vision_scene import camera, random_pose, with_faults

from ttwmr_mj.errors import MachineError
from ttwmr_mj.vision.camera.delivery import DeliveryFaults
from ttwmr_mj.vision.camera.frame import DISTRACTOR_CLASS, FIRST_LABEL_CLASS, OCCLUDER_CLASS, Frame
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions, Delivery, Exposure, Lens
from ttwmr_mj.vision.camera.rendering import gl
from ttwmr_mj.vision.camera.rendering.region import Region
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera

POSE = np.array([0.3, 0.2, 0.5, 1.4])
STILL = np.zeros(4)


def shot(
    options: CameraOptions, q_rate: np.ndarray = STILL, *, segmentation: bool = False, seed: int = 0
) -> Frame:
    source = camera(options, seed, segmentation=segmentation)
    return source.take(source.posture.positions(POSE), q_rate, 1.0)


def class_centre(frame: Frame, number: int) -> np.ndarray:
    assert frame.truth is not None
    assert frame.truth.segmentation is not None
    rows, columns = np.nonzero(frame.truth.segmentation == number)
    return np.array([columns.mean(), rows.mean()])


def test_segmentation_shows_each_label_where_the_truth_projects_it() -> None:
    # a pixel's class is that of the nearest of 2 × 2 rendered ones, up to a quarter of a pixel off;
    # the mean of 125 whole pixels is good to a tenth
    frame = shot(LAB_CAMERA, segmentation=True)
    assert frame.truth is not None
    for i, centre in enumerate(frame.truth.centres_px):
        assert class_centre(frame, FIRST_LABEL_CLASS + i) == pytest.approx(centre, abs=0.35)
    assert frame.truth.visible == pytest.approx(np.ones(4))


def test_a_region_has_the_bits_of_the_whole() -> None:
    source = camera()
    renderer, qpos = source._renderer, source.posture.positions(POSE)
    whole = renderer.robot(qpos, Region(100, -400, 600, 100))
    part = renderer.robot(qpos, Region(207, -311, 401, -5))
    assert np.array_equal(part, whole[89:395, 107:301])
    assert part.any()


def test_a_region_holds_the_robot_and_little_else() -> None:
    source = camera()
    renderer = source._renderer
    ends = [source.posture.positions(POSE + shift) for shift in ([0.0] * 4, [0.3, 0.1, 0.0, 1.0])]
    region = renderer.robot_region(ends, 3)
    wide = region.grown(60)
    seen = np.zeros(wide.shape, dtype=bool)
    for qpos in ends:
        seen |= renderer.robot(qpos, wide).any(axis=2)
    inner = region.grown(-3).within(wide)
    assert seen[inner].sum() == seen.sum()
    # boxes around round parts that are turned are larger by (1 - 1/√2)·36 mm, 21 of these pixels
    rows, columns = np.nonzero(seen[inner])
    ends_px = [columns.min(), rows.min(), *np.subtract(seen[inner].shape[::-1], 1)]
    ends_px = np.subtract(ends_px, [0, 0, columns.max(), rows.max()])
    assert np.abs(ends_px).max() <= 21
    assert renderer.robot_region(ends, 7) == region.grown(4)


def test_the_classes_of_a_moving_robot_are_those_of_the_middle_of_the_exposure() -> None:
    moving = np.array([0.5, 0.0, 0.0, 0.0])  # 15 mm in the exposure, or 3 px
    frame = shot(CameraOptions(exposure=Exposure(exposure_s=0.03)), moving, segmentation=True)
    assert frame.truth is not None
    # half of what lies between two averaged instants, and a tenth
    assert class_centre(frame, FIRST_LABEL_CLASS) == pytest.approx(
        frame.truth.centres_px[0], abs=0.3
    )


def test_a_frame_is_timed_in_the_middle_of_its_exposure() -> None:
    moving = np.array([0.3, 0.0, 0.0, 0.0])
    frame = shot(CameraOptions(exposure=Exposure(exposure_s=0.02)), moving)
    assert frame.time_s == pytest.approx(0.99)
    assert frame.truth is not None
    assert frame.truth.q == pytest.approx(POSE - 0.01 * moving)


def test_motion_blur_smears_along_the_motion_only() -> None:
    still = shot(CameraOptions()).image.astype(int)
    moving = np.array([0.5, 0.0, 0.0, 0.0])
    blurred = shot(CameraOptions(exposure=Exposure(exposure_s=0.03)), moving).image.astype(int)
    steepest = [np.abs(np.diff(image, axis=1)).max() for image in (still, blurred)]
    across = [np.abs(np.diff(image, axis=0)).max() for image in (still, blurred)]
    assert steepest[1] < 0.6 * steepest[0]
    assert across[1] > 0.8 * across[0]


def test_defocus_softens_edges() -> None:
    sharp, soft = shot(CameraOptions()), shot(CameraOptions(lens=Lens(defocus_px=1.5)))
    edges = [np.abs(np.diff(f.image.astype(int), axis=1)).max() for f in (sharp, soft)]
    assert edges[1] < 0.5 * edges[0]


def test_same_seed_same_bits_other_seed_other_noise() -> None:
    first, again, other = (shot(LAB_CAMERA, seed=seed).image for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_occluder_glare_distractor_and_fading_show() -> None:
    plain = shot(CameraOptions())
    faults = with_faults(
        CameraOptions(),
        occluders=[{"over": "trailer", "diameter_m": 0.16}],
        glare=[{"position_px": (100.0, 100.0), "start_s": 0.5, "end_s": 2.0}],
        distractors=[{"colour_of": "trailer_rear", "position_m": (-0.5, -0.3)}],
        faded=[{"label": "tractor_front", "fading": 0.6}],
    )
    frame = shot(faults, segmentation=True)
    assert frame.truth is not None
    assert frame.truth.visible == pytest.approx([1.0, 1.0, 0.0, 0.0])
    assert class_centre(frame, OCCLUDER_CLASS)[0] > 0
    ideal = camera().true.project(np.array([-0.5, -0.3, 0.0]))
    assert class_centre(frame, DISTRACTOR_CLASS) == pytest.approx(ideal, abs=0.3)
    assert frame.image[100, 100].min() == 255
    column, row = np.rint(frame.truth.centres_px[0]).astype(int)
    colour = [np.ptp(f.image[row, column].astype(int)) for f in (plain, frame)]
    assert colour[1] < 0.6 * colour[0]


def test_labels_outside_of_the_picture_are_not_visible() -> None:
    source = camera()
    frame = source.take(source.posture.positions(np.array([0.97, 0.0, np.pi, 0.0])), STILL, 0.0)
    assert frame.truth is not None
    assert frame.truth.visible[0] == 1.0
    assert frame.truth.visible[1] < 0.5


def test_a_robot_far_away_leaves_an_empty_floor() -> None:
    source = camera()
    frame = source.take(source.posture.positions(np.array([5.0, 5.0, 0.0, 0.0])), STILL, 0.0)
    assert np.ptp(frame.image.astype(int)) < 30


def test_the_asked_shares_of_frames_are_lost() -> None:
    faults = DeliveryFaults(Delivery(dropped=0.2), np.random.default_rng(0))
    image = np.zeros((1, 1, 3), dtype=np.uint8)
    frames = [faults.deliver(float(k), lambda k=k: Frame(image, k, None)) for k in range(200)]
    # 5.7 is the binomial's deviation
    assert sum(map(len, frames)) == pytest.approx(160, abs=20)


def test_without_opengl_the_error_names_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "_egl_starts", lambda: False)
    monkeypatch.setattr(gl, "probe", lambda name: gl.Probe(name, None, "not here"))
    gl.chosen_backend.cache_clear()
    try:
        with pytest.raises(MachineError, match="apt-get install libegl1 libgl1 libgl1-mesa-dri"):
            gl.make_context()
    finally:
        gl.chosen_backend.cache_clear()


def test_egl_starts_where_a_process_can_draw_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    assert gl._egl_starts() == (gl.probe("egl").renderer is not None)
    monkeypatch.setattr(ctypes, "CDLL", not_here)
    assert not gl._egl_starts()


def not_here(name: str) -> None:
    raise OSError(name)


def test_two_cameras_do_not_disturb_each_other() -> None:
    options, rng = CameraOptions(), np.random.default_rng(6)
    q = random_pose(rng)

    def take(source: VirtualCamera) -> np.ndarray:
        return source.take(source.posture.positions(q), STILL, 0.0).image

    first = camera(options)
    before = take(first)
    second = camera(options)
    assert np.array_equal(take(second), before)
    second.close()
    assert np.array_equal(take(first), before)
