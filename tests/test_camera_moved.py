"""A camera that is not where it was calibrated, and one that reads its rows one after another."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vision_scene import camera, model

import ttwmr_mj as tt
from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.results.frame import PlaneFrame, rotated
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.judgement.judged import camera_frame, frame_metrics, judged
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.model import CameraModel, hang_camera
from ttwmr_mj.vision.camera.options import CameraOptions, Exposure
from ttwmr_mj.vision.moved import camera_frame as fitted
from ttwmr_mj.vision.tracking.detection import Detector

HEIGHT_M = 1.9
MOVED = CameraOptions(x_m=0.02, y_m=-0.01, roll_rad=0.1, pitch_rad=-0.2, yaw_rad=0.3)


def hung(**keys: float) -> CameraModel:
    return hang_camera(copy(model()), CameraOptions.model_validate(keys))


def test_a_camera_is_moved_and_turned_about_the_worlds_axes() -> None:
    at_home, moved = hung(), hung(**MOVED.model_dump(include={"x_m", "y_m"}))
    assert moved.position_m - at_home.position_m == pytest.approx([0.02, -0.01, 0.0])
    turned = hang_camera(copy(model()), MOVED)
    turn = Rotation.from_euler("xyz", [0.1, -0.2, 0.3]).as_matrix()  # fixed axes, in this order
    np.testing.assert_allclose(turned.rotation, at_home.rotation @ turn.T, atol=1e-12)
    # leaning about +x it looks to +y, about +y to -x
    middle = at_home.principal_px
    assert hung(roll_rad=0.1).to_plane(middle, 0.0) == pytest.approx([0, HEIGHT_M * np.tan(0.1)])
    assert hung(pitch_rad=0.1).to_plane(middle, 0.0) == pytest.approx([-HEIGHT_M * np.tan(0.1), 0])


def test_a_rigid_frame_is_found_exactly_and_the_best_one_otherwise() -> None:
    rng = np.random.default_rng(0)
    points, offset = rng.normal(size=(30, 2)), np.array([0.3, -0.2])
    frame = PlaneFrame.fit(points, rotated(points, 2.5) + offset)
    assert frame.turn_rad == pytest.approx(2.5)
    assert frame.offset_m == pytest.approx(offset)
    assert frame.distance_m == pytest.approx(np.hypot(0.3, 0.2))
    noisy = rotated(points, 2.5) + offset + 0.1 * rng.normal(size=points.shape)

    def cost(turn: float, moved: FloatArray) -> float:
        return float(((rotated(points, turn) + moved - noisy) ** 2).sum())

    best = PlaneFrame.fit(points, noisy)
    for step in (-1e-3, 1e-3):
        assert cost(best.turn_rad + step, best.offset_m) > cost(best.turn_rad, best.offset_m)
        aside = best.offset_m + [step, step]
        assert cost(best.turn_rad, aside) > cost(best.turn_rad, best.offset_m)


def test_what_a_moved_camera_takes_for_the_world() -> None:
    """Moves and yaw are rigid and exact; a tilt by α moves the floor by α·H to first order."""
    home = CameraOptions()
    frame = fitted(model(), CameraOptions(x_m=0.02, y_m=-0.01), home)
    assert frame.offset_m == pytest.approx([-0.02, 0.01], abs=1e-12)
    assert frame.turn_rad == pytest.approx(0.0, abs=1e-12)
    frame = fitted(model(), CameraOptions(x_m=0.1, yaw_rad=0.3), home)
    assert frame.turn_rad == pytest.approx(-0.3)
    assert frame.offset_m == pytest.approx(rotated(np.array([-0.1, 0.0]), -0.3))
    frame = fitted(model(), CameraOptions(roll_rad=0.001), home)
    # more by the mean of (1 + y²/H²), H = 1.9 m less the labels' height; the picture ends at 0.7 m
    low, high = 0.001 * 1.8, 0.001 * 1.9 * (1 + 0.7**2 / 3 / 1.8**2)
    assert -high < frame.offset_m[1] < -low
    assert abs(frame.offset_m[0]) < 1e-6


def test_a_run_is_moved_as_a_whole_and_its_reference_stays() -> None:
    rng = np.random.default_rng(1)
    rows = tt.Trajectory.empty(np.arange(20.0), nsim=2)
    for name in ("q", "q_rate", "ref_q", "est_q"):
        getattr(rows, name)[:] = rng.normal(size=rows.q.shape)
    frame = PlaneFrame(0.4, np.array([1.0, 2.0]))
    seen = frame.applied(rows)
    np.testing.assert_allclose(seen.q[..., 2:], rows.q[..., 2:] + 0.4)
    x, y = rows.q[..., 0], rows.q[..., 1]
    np.testing.assert_allclose(seen.q[..., 0], 1.0 + np.cos(0.4) * x - np.sin(0.4) * y)
    np.testing.assert_allclose(seen.q[..., 1], 2.0 + np.sin(0.4) * x + np.cos(0.4) * y)
    speed = np.hypot(rows.q_rate[..., 0], rows.q_rate[..., 1])
    np.testing.assert_allclose(np.hypot(seen.q_rate[..., 0], seen.q_rate[..., 1]), speed)
    np.testing.assert_array_equal(seen.ref_q, rows.ref_q)
    np.testing.assert_array_equal(seen.est_q, rows.est_q)
    there = replace(rows, q=rows.ref_q)
    assert PlaneFrame(0.0, np.zeros(2)).applied(there).q == pytest.approx(rows.ref_q, nan_ok=True)


def camera_run(*sets: str) -> tuple[tt.Scenario, tt.Trajectory]:
    scenario = tt.load_scenario("lab_circle_camera", ["duration_s=3.0", *sets])
    return scenario, Experiment(scenario, scenarios_folder()).run().trajectory


def test_a_camera_moved_after_calibration_is_judged_in_its_frame() -> None:
    moved, rows = camera_run("sensing.camera.x_m=0.01", "sensing.camera.yaw_rad=0.05")
    assert moved.believed_camera.x_m == moved.believed_camera.yaw_rad == 0.0
    assert frame_metrics(moved)["camera_frame_offset_m"] == pytest.approx(0.01)
    assert frame_metrics(moved)["camera_frame_turn_rad"] == pytest.approx(-0.05)
    off = (rows.est_q - rows.q)[20:, 0]
    assert np.hypot(*off[:, :2].T).min() > 0.005
    # the same in its own frame as a camera's that nobody moved: calibration, noise
    seen = judged(rows, moved)
    error = (seen.est_q - seen.q)[20:, 0]
    assert np.hypot(*error[:, :2].T).max() < 5e-4
    assert np.abs(error[:, 2]).max() < np.radians(0.25)


def test_who_was_moved_before_calibration_defines_the_world() -> None:
    inside = ["sensing.kind=camera", "sensing.camera.x_m=0.01"]
    scenario = tt.load_scenario("lab_circle", inside)
    assert camera_frame(scenario) is None
    assert set(frame_metrics(scenario).values()) == {0.0}
    stale = tt.load_scenario("lab_circle", [*inside, "belief.camera.x_m=0.0"])
    frame = camera_frame(stale)
    assert frame is not None
    assert frame.offset_m == pytest.approx([-0.01, 0.0], abs=1e-12)
    assert set(frame_metrics(tt.load_scenario("lab_circle")).values()) == {None}


def centres(exposure: Exposure, q: FloatArray, q_rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the labels are found, and where they are at the frame's time (4, 2) [px]."""
    with_rows = camera(CameraOptions(exposure=exposure))
    frame = with_rows.take(with_rows.posture.positions(q), q_rate, 0.0)
    radius_px = with_rows.layout.radius_m / with_rows.true.metres_per_pixel(0.1)
    assert frame.truth is not None
    assert frame.time_s == -0.5 * (exposure.exposure_s + exposure.rolling_shutter_s)
    found, sound = Detector(with_rows.layout, radius_px).track(
        frame.image, frame.truth.centres_px, 12.0
    )
    with_rows.close()
    assert sound.all()
    return found, frame.truth.centres_px


Q = np.array([0.2, 0.25, 1.2, 0.8])


def test_a_blurred_label_is_where_it_was_in_the_middle_of_the_exposure() -> None:
    moving = np.array([0.3, -0.2, 0.0, 0.0])
    found, truth = centres(Exposure(exposure_s=0.02, blur_step_px=0.2), Q, moving)
    # 2 px of motion; half of it off would be 1 px
    assert np.abs(found - truth).max() < 0.06


def test_a_row_is_exposed_as_much_later_as_it_lies_below_the_middle() -> None:
    """Shift = speed × row time × rows from the picture's middle."""
    rolling, speed = 0.03, 0.5
    moving = np.array([speed, 0.0, 0.0, 0.0])
    found, truth = centres(Exposure(rolling_shutter_s=rolling, blur_step_px=0.05), Q, moving)
    still, _ = centres(Exposure(rolling_shutter_s=rolling), Q, np.zeros(4))
    late_s = rolling * (truth[:, 1] - 239.5) / 479
    labels = camera()
    pixel_m = labels.true.metres_per_pixel(float(labels.layout.height_m.mean()))
    labels.close()
    expected = speed * late_s / pixel_m
    assert np.abs(expected).max() > 1.2  # px
    # bands of 0.05 px, and what a label's centre is off by in any frame
    assert found[:, 0] - truth[:, 0] == pytest.approx(expected, abs=0.08)
    assert found[:, 1] == pytest.approx(still[:, 1], abs=0.06)


@pytest.mark.parametrize(
    ("sets", "late_s"),
    [
        ([], 0.0),
        (["belief.latency_s=0.0"], 0.033),
        (["belief.latency_s=0.066"], -0.033),
        (["sensing.clock_offset_s=0.01"], 0.01),
        (["sensing.latency_s=0.099", "sensing.clock_offset_s=-0.02"], -0.02),
        (["sensing.drop_probability=0.3"], 0.0),
    ],
)
def test_a_stamp_that_is_late_shows_the_robot_behind(sets: list[str], late_s: float) -> None:
    """At speed v by v times as much; the tracker carries all the rest to now."""
    circle = ['initial={kind="on_reference"}', "reference.angular_rate_rad_s=0.6"]
    _, rows = camera_run(*circle, *sets)
    error, velocity = ((a[30:, 0, :2]) for a in (rows.est_q - rows.q, rows.q_rate))
    behind_s = -(error * velocity).sum() / (velocity**2).sum()
    # 0.2 mm of bias, which is calibration's, at 0.26 m/s
    assert behind_s == pytest.approx(late_s, abs=1e-3)


def test_the_tracker_knows_when_commands_act() -> None:
    """What it takes for the wheels' twist is what they do, a physics step or two of servo aside."""
    error = []
    for told in (0.066, 0.0):
        sets = ["control.command_latency_s=0.066", f"belief.command_latency_s={told}"]
        scenario = tt.load_scenario("lab_circle_camera", ["duration_s=1.5", *sets])
        experiment = Experiment(scenario, scenarios_folder())
        rows = experiment.run().trajectory
        history = experiment.sensor.trackers[0].commands  # type: ignore[union-attr]
        taken = np.array([history.twist(time_s) for time_s in rows.time_s])
        true = twist_from_wheels(rows.wheel_speed_rad_s[:, 0], scenario.robot)
        error.append(np.abs(taken - true).mean())
    assert error[0] < 0.2 * error[1]
