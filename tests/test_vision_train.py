"""Trains before the camera: labels told apart by the hitches, and the filter for any number."""

from dataclasses import replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from trains import motley, train
from vision_scene import with_faults

import ttwmr_mj as tt
from ttwmr_mj.dynamics.train import links
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, RobotState
from ttwmr_mj.vision.camera.frame import TRAILER_CLASS
from ttwmr_mj.vision.camera.labels import LabelLayout, read_layout
from ttwmr_mj.vision.camera.model import hang_camera
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions
from ttwmr_mj.vision.camera.rendering.drawn import build_drawn_model
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera
from ttwmr_mj.vision.coco import category
from ttwmr_mj.vision.tracking import constellation
from ttwmr_mj.vision.tracking.commands import CommandHistory
from ttwmr_mj.vision.tracking.detection import Candidates, Detector
from ttwmr_mj.vision.tracking.kalman import update_pose
from ttwmr_mj.vision.tracking.motion import Gaussian, MotionModel
from ttwmr_mj.vision.tracking.options import TrackerOptions
from ttwmr_mj.vision.tracking.pose import solve_pose
from ttwmr_mj.vision.tracking.tracker import Tracker

PERIOD = 0.033
Q = np.array([0.1, -0.05, 0.4, 1.2, 0.3, -0.6])
FREE = {"stiffness_n_m_rad": 0.02, "damping_n_m_s_rad": 0.01, "coulomb_friction_n_m": 2e-4}


@cache
def model(count: int) -> mujoco.MjModel:
    return build_drawn_model(train(count), ContactOptions())


def layout(count: int = 3) -> LabelLayout:
    return read_layout(model(count))


def aside() -> LabelLayout:
    """Labels off their bodies' axes."""
    straight = layout()
    shift = np.array([0.01, -0.02, 0.03, 0.0, -0.01, 0.02, 0.01, -0.03])
    return replace(straight, offset_m=straight.offset_m + np.outer(shift, [0.0, 1.0]))


def test_labels_are_where_the_models_sites_are() -> None:
    camera = VirtualCamera(CameraOptions(), model(3), np.random.default_rng(0))
    data = mujoco.MjData(camera.model)
    data.qpos[:] = camera.posture.positions(Q)
    mujoco.mj_kinematics(camera.model, data)
    parts = ["label_tractor_front", "label_tractor_rear"]
    parts += [f"{at}label_trailer_{end}" for at in ("", "trailer_2/", "trailer_3/")
              for end in ("front", "rear")]  # fmt: skip
    sites = np.array([data.site(part).xpos for part in parts])
    assert layout().centres_m(Q) == pytest.approx(sites, abs=1e-12)
    pins = np.array(
        [data.joint(f"{at}hitch").xanchor[:2] for at in ("", "trailer_2/", "trailer_3/")]
    )
    assert layout().hitches_m(Q) == pytest.approx(pins, abs=1e-12)
    assert camera.posture.coordinates(data.qpos) == pytest.approx(Q, abs=1e-12)
    assert layout().names[4:] == (
        "trailer_2_front", "trailer_2_rear", "trailer_3_front", "trailer_3_rear"
    )  # fmt: skip
    assert category(layout())["keypoints"] == list(layout().names)
    camera.close()


def test_derivatives_of_the_labels_against_differences() -> None:
    labels, step = aside(), 1e-6
    jacobian = labels.jacobian(Q)
    for i, change in enumerate(step * np.eye(6)):
        slope = (labels.centres_m(Q + change) - labels.centres_m(Q - change)) / (2 * step)
        assert jacobian[:, i] == pytest.approx(slope[:, :2].ravel(), abs=1e-9)


HIDDEN = [(), (0,), (3,), (0, 3, 5), (1, 2, 7), (3, 4, 6), (0, 2, 4)]


@pytest.mark.parametrize("hidden", HIDDEN)
def test_the_pose_is_exact_while_every_body_shows_a_label_and_one_both(
    hidden: tuple[int, ...],
) -> None:
    points = aside().centres_m(Q)[:, :2]
    points[list(hidden)] = np.nan
    pose = solve_pose(points, aside())
    assert pose is not None
    assert pose.q == pytest.approx(Q, abs=1e-9)


@pytest.mark.parametrize("hidden", [(4, 5), (0, 1), (0, 2, 4, 6)])
def test_a_body_that_cannot_be_seen_gives_no_pose(hidden: tuple[int, ...]) -> None:
    points = layout().centres_m(Q)[:, :2]
    points[list(hidden)] = np.nan
    assert solve_pose(points, layout()) is None


@pytest.mark.parametrize("hidden", [None, 0, 2, 5, 7])
def test_labels_of_equal_colour_are_told_apart_by_the_hitches(hidden: int | None) -> None:
    """In any order, with stray discs among them."""
    rng, labels = np.random.default_rng(4), layout()
    for _ in range(20):
        q = np.array([*rng.uniform(-0.3, 0.3, 2), *rng.uniform(-3, 3) + rng.uniform(-1, 1, 4)])
        points, hue = labels.centres_m(q)[:, :2], labels.hue
        stray, painted = rng.uniform(-1.0, 1.0, (4, 2)), rng.integers(4, size=4)
        seen = np.arange(8) != hidden
        order = rng.permutation(seen.sum() + 4)
        where = np.concatenate([points[seen], stray])[order]
        candidates = Candidates(np.concatenate([hue[seen], painted])[order], where)
        got = constellation.choose(candidates, where, labels)
        assert got is not None
        assert got[0].q[:2] == pytest.approx(q[:2], abs=1e-9)
        assert np.cos(got[0].q[2:] - q[2:]) == pytest.approx(1.0, abs=1e-12)
        assert (got[1] < 0).tolist() == (np.arange(8) == hidden).tolist()


@pytest.mark.parametrize("count", [2, 3])
def test_all_labels_are_found_in_a_frame_and_followed(count: int) -> None:
    camera = VirtualCamera(CameraOptions(), model(count), np.random.default_rng(0))
    labels, q = layout(count), Q[: 3 + count]
    height = float(labels.height_m.mean())
    detector = Detector(labels, labels.radius_m / camera.true.metres_per_pixel(height))
    frame = camera.take(camera.posture.positions(q), np.zeros(3 + count), 0.0)
    assert frame.truth is not None
    found = detector.search(frame.image)
    points = camera.true.to_plane(found.centre_px, labels.height_m[found.hue])
    got = constellation.choose(found, points, labels)
    assert got is not None
    centres = found.centre_px[got[1]]
    # as of one trailer's, test_vision_detection: 0.2 mm at 3 mm to a pixel
    assert centres == pytest.approx(frame.truth.centres_px, abs=0.1)
    tracked, sound = detector.track(frame.image, frame.truth.centres_px + [2.0, -1.5], 3.0)
    assert sound.all()
    assert tracked == pytest.approx(centres, abs=1e-3)
    camera.close()


def test_faults_can_be_of_a_trailer_behind() -> None:
    occluder = {"over": "trailer", "trailer": 2, "diameter_m": 0.2}
    faded = {"label": "trailer_rear", "trailer": 3, "fading": 1.0}
    options = with_faults(CameraOptions(), occluders=[occluder], faded=[faded])
    camera = VirtualCamera(options, model(3), np.random.default_rng(0), segmentation=True)
    labels, q = layout(), np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    frame = camera.take(camera.posture.positions(q), np.zeros(6), 0.0)
    assert frame.truth is not None
    assert frame.truth.visible[4:6].max() == 0.0
    assert frame.truth.visible[[0, 1, 2, 3, 6, 7]].min() == 1.0
    detector = Detector(labels, labels.radius_m / camera.true.metres_per_pixel(0.07))
    _, found = detector.track(frame.image, frame.truth.centres_px, 3.0)
    assert np.flatnonzero(~found).tolist() == [4, 5, 7]
    # between the last trailer's labels is its bed
    column, row = frame.truth.centres_px[6:8].mean(axis=0).astype(int)
    assert frame.truth.segmentation is not None
    assert frame.truth.segmentation[row, column] == TRAILER_CLASS
    camera.close()


@pytest.mark.slow
def test_a_train_whose_last_trailer_is_covered_is_said_to_be_lost_and_comes_back() -> None:
    labels, robot = layout(2), train(2)
    seconds = [{"over": "trailer", "trailer": 2, "diameter_m": 0.2, "start_s": 0.5, "end_s": 4.0}]
    camera = VirtualCamera(
        with_faults(CameraOptions(), occluders=seconds), model(2), np.random.default_rng(0)
    )
    options = TrackerOptions(max_angle_std_rad=0.05)
    tracker = Tracker(camera.true, labels, robot, options)
    q, valid = Q[:5], []
    tracker.assume(0.0, q, np.zeros(2))
    for k in range(150):
        frame = camera.take(camera.posture.positions(q), np.zeros(5), PERIOD * k)
        answer = tracker.follow([frame], PERIOD * k)
        valid.append(answer.valid)
        if answer.valid:
            assert answer.q == pytest.approx(q, abs=0.2)
    covered = np.arange(150) * PERIOD
    assert all(np.array(valid)[(covered > 0.1) & (covered < 0.5)])
    assert not any(np.array(valid)[(covered > 3.0) & (covered < 4.0)])
    assert all(valid[-10:])
    camera.close()


class Seen:
    """A detector that finds every label where it is, and hues as they are."""

    def __init__(self, labels: LabelLayout) -> None:
        self.hue, self.centres = labels.hue, np.empty((labels.count, 2))

    def search(self, image: object) -> Candidates:
        del image
        return Candidates(self.hue, self.centres)

    def track(self, image: object, near: FloatArray, search_px: float) -> tuple[FloatArray, Any]:
        del image, near, search_px
        return self.centres.copy(), np.ones(len(self.centres), dtype=bool)


def test_two_searches_tell_how_fast_the_trailers_of_a_long_train_turn() -> None:
    """Their rates are unknown at first, so the second frame is searched as a whole as well."""
    robot, camera = train(3), hang_camera(model(3), LAB_CAMERA)
    tracker, motion = (
        Tracker(camera, layout(), robot, TrackerOptions()),
        MotionModel(robot, TrackerOptions()),
    )
    tracker.detector = seen = Seen(layout())  # type: ignore[assignment]
    rate = np.array([0.3, -0.6, 0.4])
    truth = Gaussian(0.0, np.concatenate([Q, [0.0, 0.0], rate]), np.zeros((11, 11)))
    whole = []
    for k in range(6):
        time = PERIOD * k
        truth = motion.predict(truth, time, CommandHistory(robot).ramps(truth.time_s, time))
        seen.centres = camera.project(layout().centres_m(truth.mean[:6]))
        sighting = tracker.see(np.zeros((1, 1, 3), dtype=np.uint8), time)
        whole.append(bool(np.isnan(sighting.search_px)))
    assert whole == [True, True, False, False, False, False]
    estimate = tracker.estimate(time)
    assert estimate.q == pytest.approx(truth.mean[:6], abs=1e-4)
    # noise of 1 mrad, as labels of the laboratory's camera give, over a few frames
    assert estimate.q_rate[3:] == pytest.approx(truth.mean[8:], abs=0.01)


def test_a_pose_is_worked_into_what_was_known() -> None:
    """As Bayes' theorem in the form of information has it; a pose that is elsewhere is refused."""
    rng, size = np.random.default_rng(3), 11
    root = rng.normal(size=(size, size))
    prior = Gaussian(1.0, rng.normal(size=size), root @ root.T)
    pose = np.diag(rng.uniform(1e-3, 1e-2, size))
    seen = Gaussian(1.0, prior.mean + 0.01, pose)
    got = update_pose(prior, seen, 6)
    assert got is not None
    information = np.linalg.inv(prior.covariance)
    added = np.zeros((size, size))
    added[:6, :6] = np.linalg.inv(pose[:6, :6])
    covariance = np.linalg.inv(information + added)
    mean = covariance @ (information @ prior.mean + added @ seen.mean)
    assert got.covariance == pytest.approx(covariance, rel=1e-6, abs=1e-9)
    assert got.mean == pytest.approx(mean, rel=1e-6)
    for off, kept in ((30.0, True), (34.0, False)):  # squared, of the first number alone
        sure = Gaussian(1.0, prior.mean, 0.5 * np.eye(size))
        far = Gaussian(1.0, prior.mean + np.eye(size)[0] * off**0.5, 0.5 * np.eye(size))
        assert (update_pose(sure, far, 6) is not None) == kept


@pytest.mark.parametrize("robot", [train(2, **FREE), motley()])
def test_prediction_follows_the_analytic_plant(robot: RobotParameters) -> None:
    n = len(robot.trailers)
    plant = AnalyticPlant(robot, 1, PERIOD, 0.0005)
    start = RobotState.at_rest(0.1, -0.2, 0.4, [1.1, 0.2, -0.5][:n])
    plant.reset(start)
    history, motion = CommandHistory(robot), MotionModel(robot, TrackerOptions())
    state = Gaussian(0.0, np.append(start.q[0], np.zeros(2 + n)), 1e-8 * np.eye(motion.size))
    for k in range(15):
        time = PERIOD * k
        command = np.array([[2.35 + 1.5 * np.sin(0.05 * k), 1.8 + np.cos(0.031 * k)]])
        history.tell(time, command, PERIOD)
        plant.advance(command, 1)
        state = motion.predict(state, time + PERIOD, history.ramps(time, time + PERIOD))
    dry = any(hitch.coulomb_friction_n_m for hitch in robot.hitches)
    # steps of a ramp; dry friction is smoothed over 0.02 rad/s, and 2e-4 N·m move 0.02 rad in 0.5 s
    assert state.mean[: 3 + n] == pytest.approx(plant.state().q[0], abs=0.02 if dry else 2e-4)
    assert state.mean[5 + n :] == pytest.approx(
        plant.state().q_rate[0, 3:], abs=0.1 if dry else 2e-3
    )


@pytest.mark.parametrize("hitch", [{}, FREE, {"stiffness_n_m_rad": 2.0, "damping_n_m_s_rad": 0.5}])
def test_covariance_follows_the_linearized_motion(hitch: dict[str, float]) -> None:
    robot = train(3, **hitch)
    motion, history = MotionModel(robot, TrackerOptions()), CommandHistory(robot)
    history.roll(np.array([4.0, 2.0]))
    history.tell(0.0, np.array([9.0, 1.0]), PERIOD)
    duration, size = 1e-4, motion.size
    ramps = list(history.ramps(0.0, duration))
    mean = np.concatenate([Q, [0.01, -0.05], [0.4, -0.2, 0.3]])

    def after(state: FloatArray, covariance: FloatArray) -> Gaussian:
        return motion.predict(Gaussian(0.0, state, covariance), duration, ramps)

    nothing, step = np.zeros((size, size)), 1e-6
    slopes = [
        (after(mean + d, nothing).mean - after(mean - d, nothing).mean) / (2 * step)
        for d in step * np.eye(size)
    ]
    transition = np.array(slopes).T
    spread = np.diag(np.linspace(1.0, 2.0, size))
    moved = after(mean, spread).covariance - after(mean, nothing).covariance
    # third order in 0.1 ms, times rates of up to 2000 1/s² of the springs
    assert moved == pytest.approx(transition @ spread @ transition.T, abs=1e-5)


def test_a_train_of_one_is_one_trailer() -> None:
    from ttwmr_mj.vision.tracking.swing import Instant, LoneSwing, TrainSwing

    robot = RobotParameters.model_validate({"hitch": FREE, "trailer": {"com_lateral_m": 0.02}})
    lone, one = LoneSwing(robot), TrainSwing(robot)
    assert len(links(robot)) == 1
    at = Instant(0.3, 0.5, 0.8)
    ramp = at, Instant(0.32, 0.52, 0.7), Instant(0.35, 0.54, 0.6)
    for a, b in zip(
        lone.advance((1.0,), (0.4,), ramp, 0.7, PERIOD),
        one.advance((1.0,), (0.4,), ramp, 0.7, PERIOD),
        strict=True,
    ):
        assert a == pytest.approx(b, abs=1e-12)
    for a, b in zip(
        lone.slopes((1.0,), (0.4,), at, 0.7, 3.0),
        one.slopes((1.0,), (0.4,), at, 0.7, 3.0),
        strict=True,
    ):
        assert a == pytest.approx(b, abs=1e-9)


@pytest.mark.slow
def test_the_double_inverted_train_is_held_by_camera() -> None:
    short = tt.load_scenario("double_inverted_camera", ["duration_s=6.0"])
    result = tt.simulate(short)
    rows = result.trajectory
    assert (rows.labels_found[2:] == 6).mean() > 0.995
    # after the start's 10 mm and 3° have gone; unstable at 2.8 1/s, unheld it is metres off by then
    off = np.abs(rows.est_q - rows.q)[60:, 0]
    assert off[:, :2].max() < 5e-4
    assert off[:, 2:].max() < 0.01
    late = np.abs(np.diff(rows.q[-30:, 0, 2:] - rows.ref_q[-30:, 0, 2:], axis=1))
    assert late.max() < 0.05
