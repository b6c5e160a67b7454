"""The tracker's decisions, with labels put exactly where a test wants them: no pictures."""

from __future__ import annotations

import numpy as np
import pytest
from vision_scene import ROBOT, model

from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.state import BoolArray, FloatArray
from ttwmr_mj.vision.camera.labels import read_layout
from ttwmr_mj.vision.camera.model import hang_camera
from ttwmr_mj.vision.camera.options import LAB_CAMERA
from ttwmr_mj.vision.tracking.detection import Candidates
from ttwmr_mj.vision.tracking.estimate import Status
from ttwmr_mj.vision.tracking.options import TrackerOptions
from ttwmr_mj.vision.tracking.tracker import (
    LONGEST_GAP_S,
    MAX_MISFITS,
    MAX_SEARCH_PX,
    MIN_SEARCH_PX,
    SEARCH_SIGMAS,
    Tracker,
)

POSE = np.array([0.2, -0.1, 0.7, 1.1])
PICTURE = np.zeros((1, 1, 3), dtype=np.uint8)
STEP_S = 0.02  # between two frames: five of them are less than TrackerOptions.max_blind_s
WHEELS = np.array([3.0, 1.0])


class Labels:
    """A detector that sees labels where it is told."""

    def __init__(self) -> None:
        self.centres = np.full((4, 2), np.nan)

    def track(
        self, image: object, predicted_px: FloatArray, search_px: float
    ) -> tuple[FloatArray, BoolArray]:
        del image, predicted_px, search_px
        return self.centres.copy(), np.isfinite(self.centres[:, 0])

    def search(self, image: object) -> Candidates:
        del image
        label = np.flatnonzero(np.isfinite(self.centres[:, 0]))
        return Candidates(label, self.centres[label])


class Scene:
    """A tracker and the labels it sees."""

    def __init__(self, **options: float) -> None:
        self.camera = hang_camera(model(), LAB_CAMERA)
        self.layout = read_layout(model())
        self.tracker = Tracker(self.camera, self.layout, ROBOT, TrackerOptions(**options))
        self.labels = self.tracker.detector = Labels()

    def see(
        self,
        time_s: float,
        q: FloatArray = POSE,
        off_m: float = 0.0,
        labels: int = 4,
        hidden: tuple[int, ...] = (),
    ) -> None:
        """A frame of a robot at q, of which the last so many labels are off to the side."""
        points = self.layout.centres_m(q)
        points[4 - labels :, 1] += off_m
        self.labels.centres = self.camera.project(points)
        self.labels.centres[list(hidden)] = np.nan
        self.tracker.see(PICTURE, time_s)

    def settle(self) -> None:
        """Frames of a robot at rest up to time zero, so that its rates are known as well."""
        for k in range(-15, 1):
            self.see(STEP_S * k)

    def see_nothing(self, time_s: float) -> None:
        self.labels.centres = np.full((4, 2), np.nan)
        self.tracker.see(PICTURE, time_s)


def test_before_the_first_frame_nothing_is_known() -> None:
    estimate = Scene().tracker.estimate(1.0)
    assert np.isnan(estimate.q).all()
    assert np.isnan(estimate.covariance.diagonal()).all()
    assert (estimate.valid, estimate.status, estimate.labels) == (False, Status.LOST, 0)
    assert estimate.measurement_age_s == np.inf


def test_the_first_sighting_gives_the_pose() -> None:
    scene = Scene()
    scene.see(0.5)
    estimate = scene.tracker.estimate(0.5)
    assert estimate.q == pytest.approx(POSE, abs=1e-9)
    assert (estimate.valid, estimate.status, estimate.labels) == (True, Status.TRACKED, 4)
    assert estimate.covariance.shape == (4, 4)
    assert estimate.measurement_age_s == 0.0
    assert scene.tracker.estimate(0.6).measurement_age_s == pytest.approx(0.1)
    assert np.isnan(scene.tracker.sighting.predicted_px).all()
    # a label's noise over half of the labels' distance, 50 mm
    noise_m = 0.0225 * scene.camera.metres_per_pixel(0.07)
    assert np.sqrt(estimate.covariance[2, 2]) == pytest.approx(noise_m / 0.0707, rel=0.15)


def test_rates_are_what_the_wheels_were_told() -> None:
    scene = Scene()
    scene.tracker.commands.roll(WHEELS)
    scene.tracker.assume(0.0, POSE, 0.3)
    u1, u2 = twist_from_wheels(WHEELS, ROBOT)
    rates = scene.tracker.estimate(0.0).q_rate
    assert rates == pytest.approx([u1 * np.cos(0.7), u1 * np.sin(0.7), u2, 0.3], abs=1e-12)


def test_put_down_by_hand_it_counts_as_lost_until_it_is_seen() -> None:
    scene = Scene()
    turned = POSE + [0.0, 0.0, 2 * np.pi, 2 * np.pi]
    scene.tracker.assume(0.0, turned + [0.02, 0.0, 0.1, -0.1], 0.5)
    estimate = scene.tracker.estimate(0.0)
    assert (estimate.valid, estimate.status) == (False, Status.LOST)
    scene.see(0.0)
    # the turn that was told is kept, and so is the trailer's rate, which one frame does not show
    # where it was put down, known to 50 mm and 0.2 rad, weighs a little beside the labels
    assert scene.tracker.estimate(0.0).q == pytest.approx(turned, abs=1e-5)
    assert scene.tracker.estimate(0.0).q_rate[3] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("silent", [True, False])
def test_blind_then_lost_when_nothing_is_seen_for_long(silent: bool) -> None:
    scene = Scene(max_blind_s=0.15)
    scene.settle()
    expected = {0.05: Status.BLIND, 0.149: Status.BLIND, 0.151: Status.LOST, 0.2: Status.LOST}
    for time_s, status in expected.items():
        scene.tracker.miss(time_s) if silent else scene.see_nothing(time_s)
        estimate = scene.tracker.estimate(time_s)
        assert (estimate.status, estimate.valid) == (status, status is Status.BLIND)
        assert estimate.labels == 0
        assert estimate.measurement_age_s == pytest.approx(time_s)
    scene.see(0.3)
    assert scene.tracker.estimate(0.3).status is Status.TRACKED


def test_a_label_that_is_off_is_not_used() -> None:
    scene = Scene()
    scene.settle()
    for k in range(1, 2 * MAX_MISFITS):
        scene.see(STEP_S * k, off_m=0.01, labels=1)
    assert scene.tracker.status is Status.TRACKED
    assert scene.tracker.sighting.labels == 3
    assert np.isnan(scene.tracker.sighting.found_px[3]).all()
    assert np.isfinite(scene.tracker.sighting.predicted_px).all()
    assert scene.tracker.estimate(STEP_S * (2 * MAX_MISFITS - 1)).q == pytest.approx(POSE, abs=1e-6)


@pytest.mark.parametrize("labels", [2, 4])
def test_after_frames_full_of_misfits_it_starts_afresh(labels: int) -> None:
    scene = Scene()
    scene.settle()
    moved = POSE + [0.0, 0.01, 0.0, 0.0]
    for k in range(1, MAX_MISFITS):
        scene.see(STEP_S * k, off_m=0.01, labels=labels)
        assert scene.tracker.sighting.labels == 4 - labels
        assert scene.tracker.status is (Status.TRACKED if labels < 4 else Status.BLIND)
    scene.see(STEP_S * MAX_MISFITS, moved)
    assert scene.tracker.status is Status.TRACKED
    assert np.isnan(scene.tracker.sighting.predicted_px).all()
    assert scene.tracker.estimate(STEP_S * MAX_MISFITS).q == pytest.approx(moved, abs=1e-6)


def test_one_good_frame_forgives_the_misfits_before() -> None:
    scene = Scene()
    scene.settle()
    for k in range(1, 3 * MAX_MISFITS):
        scene.see(STEP_S * k, off_m=0.01 if k % MAX_MISFITS else 0.0)
        assert np.isfinite(scene.tracker.sighting.predicted_px).all()


def test_a_picture_without_the_motion_there_must_be_is_frozen() -> None:
    moving, still = Scene(), Scene()
    moving.tracker.commands.roll(WHEELS)  # 52 mm/s: 0.3 px in STEP_S, with the turn more
    for scene in (moving, still):
        scene.see(0.0)
        scene.see(2 * STEP_S)
    assert moving.tracker.sighting.labels == 0
    assert moving.tracker.status is Status.BLIND
    assert still.tracker.sighting.labels == 4
    assert still.tracker.status is Status.TRACKED


@pytest.mark.parametrize("frozen", [True, False])
def test_frames_without_news_are_no_misfits(frozen: bool) -> None:
    """However many they are, dead reckoning goes on while blindness is allowed."""
    scene = Scene(max_blind_s=1.0)
    scene.settle()
    scene.tracker.commands.roll(WHEELS)
    for k in range(1, 3 * MAX_MISFITS):
        # after one step the labels need not have moved visibly
        scene.see(STEP_S * k) if frozen and k > 1 else scene.see_nothing(STEP_S * k)
        assert scene.tracker.status is Status.BLIND
        assert np.isfinite(scene.tracker.sighting.predicted_px).all()
    gone = np.linalg.norm(scene.tracker.estimate(STEP_S * k).q[:2] - POSE[:2])
    # an arc of a fifth of a radian is longer than its chord by 1/600
    assert gone == pytest.approx(STEP_S * k * twist_from_wheels(WHEELS, ROBOT)[0], rel=0.01)


@pytest.mark.parametrize("wheels", [WHEELS, 0.02 * WHEELS])
def test_a_frozen_camera_is_not_believed_until_it_shows_something_new(wheels: FloatArray) -> None:
    """Not in a search of the whole frame either, nor where each step is too short to be seen."""
    scene = Scene(max_blind_s=0.1)
    scene.tracker.commands.roll(wheels)
    seconds = 0.5 if wheels is WHEELS else 3.0  # 1 mm/s
    for k in range(round(seconds / STEP_S)):
        scene.see(STEP_S * k)
    assert scene.tracker.status is Status.LOST
    estimate = scene.tracker.estimate(seconds)
    assert not estimate.valid
    assert estimate.measurement_age_s > 0.1
    scene.see(seconds, estimate.q)
    assert scene.tracker.estimate(seconds).valid


@pytest.mark.parametrize("blind_s", [0.0, 20.0])
def test_a_robot_at_rest_may_be_in_the_same_picture_for_long(blind_s: float) -> None:
    scene = Scene()
    scene.settle()
    scene.tracker.miss(blind_s)
    assert (scene.tracker.status is Status.LOST) == (blind_s > 0.0)
    for time_s in blind_s + np.arange(0.1, 60.0, 0.1):
        scene.see(time_s)
        estimate = scene.tracker.estimate(time_s)
        assert estimate.valid
        assert estimate.q == pytest.approx(POSE, abs=1e-4)


def test_a_label_that_was_hidden_before_is_not_frozen() -> None:
    scene = Scene()
    scene.see(0.0, hidden=(3,))
    assert scene.tracker.sighting.labels == 3
    scene.see(STEP_S, hidden=(0, 1, 2))
    assert scene.tracker.sighting.labels == 1


def test_the_first_misfits_count_from_zero() -> None:
    scene, quick_s = Scene(), 0.005
    scene.see(0.0)
    for k in range(1, MAX_MISFITS + 1):
        scene.see(quick_s * k, off_m=0.05)
        started_afresh = bool(np.isnan(scene.tracker.sighting.predicted_px).all())
        assert started_afresh == (k == MAX_MISFITS)


def test_labels_are_looked_for_as_far_as_they_may_be() -> None:
    scene = Scene(max_blind_s=60.0)
    scene.settle()
    for time_s in (0.1, 0.4):
        covariance = scene.tracker.estimate(time_s).covariance
        scene.see_nothing(time_s)
        variance = np.diag(covariance)
        reach = 0.195  # of the trailer's rear label from P
        spread_m = np.sqrt(variance[:2].sum() + reach**2 * variance[2:].max())
        pixels = spread_m / scene.camera.metres_per_pixel(0.026 + 0.0436)
        # the layout's height is 0.0696 within the balls' tilt
        expected = MIN_SEARCH_PX + SEARCH_SIGMAS * pixels
        assert scene.tracker.sighting.search_px == pytest.approx(expected, rel=1e-3)
    predicted = scene.camera.project(scene.layout.centres_m(POSE))
    assert scene.tracker.sighting.predicted_px == pytest.approx(predicted, abs=1e-6)
    # when that would be too wide, the whole frame is searched, however long blindness is allowed
    scene.see_nothing(5.0)
    assert scene.tracker.status is Status.LOST
    assert np.isnan(scene.tracker.sighting.search_px)
    assert expected < MAX_SEARCH_PX


@pytest.mark.parametrize("limit", ["max_position_std_m", "max_angle_std_rad"])
def test_too_uncertain_is_invalid(limit: str) -> None:
    generous, narrow = Scene(max_blind_s=60.0), Scene(max_blind_s=60.0, **{limit: 1e-5})
    for scene in (generous, narrow):
        scene.see(0.0)
    assert generous.tracker.estimate(0.0).valid
    assert not narrow.tracker.estimate(0.0).valid
    assert narrow.tracker.status is Status.TRACKED


def test_without_frames_it_dead_reckons_at_the_same_pace() -> None:
    """What is carried along early and what is carried in one go agree."""
    missed, kept = Scene(), Scene()
    for scene in (missed, kept):
        scene.tracker.commands.roll(WHEELS)
        scene.see(0.0)
    for k in range(1, 60):
        missed.tracker.miss(0.05 * k)
        for scene in (missed, kept):
            scene.tracker.commands.tell(0.05 * k, WHEELS, 0.05)
    now = 0.05 * 59
    assert missed.tracker._filtered.time_s == pytest.approx(now - LONGEST_GAP_S)
    estimates = [scene.tracker.estimate(now) for scene in (missed, kept)]
    assert estimates[0].q == pytest.approx(estimates[1].q, abs=1e-6)
    assert missed.tracker.sighting is None
