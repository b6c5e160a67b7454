"""Labels in rendered frames: sub-pixel centres, no distractor taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from vision_scene import camera, lab_calibration, model, random_pose, with_faults

from ttwmr_mj.state import FloatArray, wrap
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.labels import LabelLayout, read_layout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions, Distractor
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera
from ttwmr_mj.vision.tracking import constellation
from ttwmr_mj.vision.tracking.detection import (
    Candidates,
    Detector,
    blobs,
    label_sized,
    neutral_colour,
)

STILL = np.zeros(4)


def detector_for(source: VirtualCamera, known: CameraModel) -> Detector:
    height = float(source.layout.height_m.mean())
    return Detector(source.layout, source.layout.radius_m / known.metres_per_pixel(height))


def find(
    frame: Frame, detector: Detector, known: CameraModel, layout: LabelLayout
) -> tuple[FloatArray, FloatArray]:
    """Pose and the four centres of a whole-frame search that must succeed."""
    candidates = detector.search(frame.image)
    points = known.to_plane(candidates.centre_px, layout.height_m[candidates.hue])
    got = constellation.choose(candidates, points, layout)
    assert got is not None
    assert (got[1] >= 0).all()
    return got[0].q, candidates.centre_px[got[1]]


def accuracy(options: CameraOptions, known: CameraModel, speed: float) -> tuple[float, float]:
    """Position [mm] and angle [°], root mean square over random poses."""
    source, rng = camera(options), np.random.default_rng(9)
    detector = detector_for(source, known)
    position, angle = [], []
    for k in range(60):
        q = random_pose(rng)
        q_rate = speed * np.array([np.cos(q[2]), np.sin(q[2]), 0.0, 0.0])
        frame = source.take(source.posture.positions(q), q_rate, 0.033 * k)
        assert frame.truth is not None
        pose, _ = find(frame, detector, known, source.layout)
        position.append(pose[:2] - frame.truth.q[:2])
        angle.append(wrap(pose[2:] - frame.truth.q[2:]))
    distance = np.sqrt((np.array(position) ** 2).sum(axis=1).mean())
    return 1e3 * float(distance), float(
        np.degrees(np.sqrt((np.array(angle) ** 2).mean(axis=0))).max()
    )


def test_clean_frames_give_the_pose_to_a_fifth_of_a_millimetre() -> None:
    position_mm, angle_deg = accuracy(CameraOptions(), camera().true, 0.0)
    assert position_mm < 0.20
    assert angle_deg < 0.06


def test_lab_frames_give_the_pose_to_half_a_millimetre() -> None:
    position_mm, angle_deg = accuracy(LAB_CAMERA, lab_calibration().camera, 0.3)
    assert position_mm < 0.50
    assert angle_deg < 0.25


def test_tracking_finds_what_the_search_finds() -> None:
    source = camera(LAB_CAMERA)
    detector = detector_for(source, source.true)
    q = np.array([0.2, -0.3, 1.0, 2.5])
    frame = source.take(source.posture.positions(q), STILL, 0.0)
    assert frame.truth is not None
    _, searched = find(frame, detector, source.true, source.layout)
    centres, found = detector.track(frame.image, frame.truth.centres_px + [2.0, -1.5], 3.0)
    assert found.all()
    assert centres == pytest.approx(searched, abs=1e-3)
    assert centres == pytest.approx(frame.truth.centres_px, abs=0.15)


def test_labels_beside_the_picture_are_not_found() -> None:
    source = camera()
    detector = detector_for(source, source.true)
    q = np.array([0.2, 0.0, 0.0, 0.0])
    frame = source.take(source.posture.positions(q), STILL, 0.0)
    beside = np.array([[-50.0, 10.0], [700.0, 300.0], [np.nan, np.nan], [0.0, 479.0]])
    centres, found = detector.track(frame.image, beside, 3.0)
    assert not found.any()
    assert np.isnan(centres).all()


def test_distractors_of_every_colour_are_not_taken_for_labels() -> None:
    source = camera(LAB_CAMERA)
    detector = detector_for(source, source.true)
    source.lay_out(
        tuple(
            Distractor(colour_of=name, position_m=place)
            for name in ("tractor_front", "tractor_rear", "trailer_front", "trailer_rear")
            for place in ((0.5, 0.45), (-0.5, 0.3), (0.4, -0.45))
        )
    )
    q = np.array([-0.2, -0.2, 0.3, 0.9])
    frame = source.take(source.posture.positions(q), STILL, 0.0)
    assert frame.truth is not None
    assert len(detector.search(frame.image).hue) > 4
    _, centres = find(frame, detector, source.true, source.layout)
    assert centres == pytest.approx(frame.truth.centres_px, abs=0.3)


def test_distractors_alone_are_no_robot() -> None:
    source = camera()
    source.lay_out((Distractor(), Distractor(colour_of="trailer_rear", position_m=(0.0, 0.0))))
    away = source.posture.positions(np.array([9.0, 0.0, 0.0, 0.0]))
    candidates = detector_for(source, source.true).search(source.take(away, STILL, 0.0).image)
    points = source.true.to_plane(candidates.centre_px, source.layout.height_m[candidates.hue])
    assert len(candidates.hue) == 2
    assert constellation.choose(candidates, points, source.layout) is None


def test_a_faded_label_and_a_warm_light_move_nothing() -> None:
    faded = with_faults(CameraOptions(), faded=[{"label": "trailer_rear", "fading": 0.5}])
    source = camera(faded)
    detector = detector_for(source, source.true)
    q = np.array([0.1, 0.25, 2.0, 0.6])
    frame = source.take(source.posture.positions(q), STILL, 0.0)
    warm = (frame.image * np.array([0.85, 0.95, 1.0])).astype(np.uint8)
    assert frame.truth is not None
    _, centres = find(Frame(warm, 0.0, None), detector, source.true, source.layout)
    assert centres == pytest.approx(frame.truth.centres_px, abs=0.15)


def painted(
    centres: FloatArray, layout: LabelLayout, radius_px: float, longer: float, angle_rad: float
) -> FloatArray:
    """Labels (4, 2) as ellipses of a disc's area on a grey floor, each pixel's light averaged."""
    fine = (np.arange(8) + 0.5) / 8 - 0.5
    y, x = np.ogrid[:120, :160]
    image = np.full((120, 160, 3), 110.0)
    for centre, colour in zip(centres, layout.colour_bgr, strict=True):
        cover = np.zeros((120, 160))
        for dx in fine:
            for dy in fine:
                u, v = x + dx - centre[0], y + dy - centre[1]
                along = np.cos(angle_rad) * u + np.sin(angle_rad) * v
                across = np.cos(angle_rad) * v - np.sin(angle_rad) * u
                cover += (along / longer) ** 2 + (across * longer) ** 2 < radius_px**2
        image += (cover / 64)[..., None] * (230.0 * colour - image)
    return np.rint(image).astype(np.uint8)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, -0.4), (-0.5, 0.25)])
def test_discs_are_found_at_their_centres(shift: tuple[float, float]) -> None:
    layout = read_layout(model())
    centres = np.array([[30.0, 30.0], [110.0, 40.0], [50.0, 90.0], [120.0, 85.0]]) + shift
    image, detector = painted(centres, layout, 6.0, 1.0, 0.0), Detector(layout, 6.0)
    found, sound = detector.track(image, centres + [1.3, -0.8], 3.0)
    assert sound.all()
    # an edge sampled eight by eight, of which the faintest tenth is cut off
    assert found == pytest.approx(centres, abs=0.02)
    anywhere = detector.search(image)
    assert anywhere.hue.tolist() == [0, 1, 2, 3]
    assert anywhere.centre_px == pytest.approx(centres, abs=0.02)


@pytest.mark.parametrize("nearer", [0, 1])
def test_of_two_discs_of_a_colour_the_nearer_is_the_label(nearer: int) -> None:
    layout = read_layout(model())
    centres = np.array([[30.0, 30.0], [110.0, 40.0], [50.0, 90.0], [120.0, 85.0]])
    beside = centres + [18.0, 0.0]
    one, two = (painted(c, layout, 6.0, 1.0, 0.0).astype(float) for c in (centres, beside))
    image = (one + two - 110.0).astype(np.uint8)  # they do not touch
    meant = (centres, beside)[nearer]
    other = (centres, beside)[1 - nearer]
    near = meant + 0.3 * (other - meant)  # both lie in the region
    found, sound = Detector(layout, 6.0).track(image, near, 14.0)
    assert sound.all()
    assert found == pytest.approx(meant, abs=0.05)


def test_a_disc_is_round_wherever_its_moments_are_taken_about() -> None:
    layout = read_layout(model())
    y, x = np.ogrid[:31, :31]
    light = ((x - 15.0) ** 2 + (y - 15.0) ** 2 < 6.0**2).astype(np.float32)[None]
    rough = np.array([[14.2, 14.2]], dtype=np.float32)
    centre, whole = Detector(layout, 6.0)._centroids(light, rough)
    assert whole.all()
    assert centre == pytest.approx(np.array([[15.0, 15.0]]), abs=1e-5)


@pytest.mark.parametrize("angle_deg", [0, 45, 90, 135])
def test_what_is_longer_than_wide_is_no_label(angle_deg: float) -> None:
    layout = read_layout(model())
    centres = np.array([[30.2, 30.0], [110.0, 40.4], [50.7, 90.0], [120.0, 85.1]])
    detector = Detector(layout, 6.0)
    # variances along and across as 1.08 and as 1.36 to 1; LONGEST is 1.2
    for longer, passes in ((1.02, True), (1.08, False)):
        image = painted(centres, layout, 6.0, longer, np.radians(angle_deg))
        _, sound = detector.track(image, centres, 3.0)
        assert sound.tolist() == [passes] * 4


def test_neutral_colour_follows_the_light() -> None:
    grey = np.full((64, 64, 3), 100, dtype=np.uint8)
    assert neutral_colour(grey) == pytest.approx(np.ones(3))
    tinted = np.full((64, 64, 3), (80, 100, 120), dtype=np.uint8)
    assert neutral_colour(tinted) == pytest.approx([0.8, 1.0, 1.2])
    assert neutral_colour(np.zeros((64, 64, 3), dtype=np.uint8)) == pytest.approx(np.ones(3))


def test_blobs_larger_or_smaller_than_a_label_are_removed() -> None:
    row, column = np.ogrid[:100, :200]
    mask = np.zeros((100, 200), dtype=np.uint8)
    for x, radius in ((20, 3.0), (60, 6.0), (120, 12.0)):
        mask |= ((column - x) ** 2 + (row - 50) ** 2 <= radius**2).astype(np.uint8)
    mask[80:84, 20:60] = 1  # the area of a label, not its shape
    centre_px, area_px, size_px = blobs(mask)
    kept = centre_px[label_sized(area_px, size_px, 6.0)]
    assert kept == pytest.approx(np.array([[60.0, 50.0]]))


def test_halves_that_share_no_hitch_are_no_robot() -> None:
    layout = read_layout(model())
    points = layout.centres_m(np.array([0.1, 0.2, 0.3, 1.4]))[:, :2]
    four = Candidates(np.arange(4), np.zeros((4, 2)))
    got = constellation.choose(four, points, layout)
    assert got is not None
    assert got[1].tolist() == [0, 1, 2, 3]
    # along the trailer: each half still measures what it must, and both do not meet in P
    points[2:] -= 0.06 * np.array([np.cos(1.4), np.sin(1.4)])
    assert constellation.choose(four, points, layout) is None


def test_a_third_label_is_enough_and_a_fourth_is_preferred() -> None:
    layout = read_layout(model())
    points = layout.centres_m(np.array([0.1, 0.2, 0.3, 1.4]))[:, :2]
    for hidden in range(4):
        label = np.delete(np.arange(4), hidden)
        got = constellation.choose(Candidates(label, np.zeros((3, 2))), points[label], layout)
        assert got is not None
        assert got[1].tolist() == np.insert(np.arange(3), hidden, -1).tolist()
    # a stray front of the trailer, which fits as well but for a millimetre, comes first
    stray = np.vstack([points[:2], points[2] + [0.001, 0.0], points[2:]])
    label = np.array([0, 1, 2, 2, 3])
    got = constellation.choose(Candidates(label, np.zeros((5, 2))), stray, layout)
    assert got is not None
    assert got[1].tolist() == [0, 1, 3, 4]


def test_nothing_found_is_no_constellation() -> None:
    nothing = Candidates(np.zeros(0, dtype=np.intp), np.zeros((0, 2)))
    assert constellation.choose(nothing, np.zeros((0, 2)), camera().layout) is None


def test_a_label_half_covered_is_not_found_rather_than_misplaced() -> None:
    # the occluder's edge passes 6 mm beside the middle of the tractor's front label
    q = np.array([0.0, 0.0, 0.0, 0.0])
    path = {"from_m": (0.085 + 0.1 + 0.006, 0.0), "to_m": (0.2, 0.0), "diameter_m": 0.2}
    source = camera(with_faults(LAB_CAMERA, occluders=[path]))
    frame = source.take(source.posture.positions(q), STILL, 0.01)
    assert frame.truth is not None
    assert 0.5 < frame.truth.visible[0] < 0.9
    detector = detector_for(source, source.true)
    _, found = detector.track(frame.image, frame.truth.centres_px, 3.0)
    assert found.tolist() == [False, True, True, True]
