"""The tracker's Kalman filter by closed forms and differences: no pictures, no simulator."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import least_squares
from vision_scene import ROBOT, model

from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.robot import Hitch
from ttwmr_mj.state import FloatArray, RobotState
from ttwmr_mj.vision.camera.labels import LabelLayout, read_layout
from ttwmr_mj.vision.tracking.commands import MEMORY_S, CommandHistory
from ttwmr_mj.vision.tracking.kalman import update
from ttwmr_mj.vision.tracking.motion import (
    ACCELERATION_TIME_S,
    ANGLE_WALK,
    POSITION_WALK,
    Gaussian,
    MotionModel,
    exponential,
)
from ttwmr_mj.vision.tracking.options import TrackerOptions
from ttwmr_mj.vision.tracking.pose import solve_pose
from ttwmr_mj.vision.tracking.swing import FASTEST_1_S, STICTION_RATE_RAD_S

PERIOD_S, SIZE = 0.033, 7
NOISE_M2 = 1e-6
EVERY = np.ones(4, dtype=np.bool_)
NO_GATE = 1e9
MEAN = np.array([0.1, 0.2, 0.5, 1.3, 0.01, -0.05, 0.4])


def layout() -> LabelLayout:
    return read_layout(model())


def command(k: int) -> FloatArray:
    return np.array([[2.35 + 1.5 * np.sin(0.05 * k), 1.8 + np.cos(0.031 * k)]])


def prior() -> Gaussian:
    """Uncertain to a millimetre, with everything correlated with everything."""
    root = 1e-3 * (np.eye(SIZE) + 0.4 * np.random.default_rng(3).standard_normal((SIZE, SIZE)))
    return Gaussian(0.5, MEAN, root @ root.T)


def predicted(hitch: dict[str, float], periods: int) -> Gaussian:
    robot = ROBOT.model_copy(update={"hitch": Hitch.model_construct(**hitch)})
    history, motion = CommandHistory(robot), MotionModel(robot, TrackerOptions())
    state = Gaussian(0.0, np.zeros(SIZE), 1e-8 * np.eye(SIZE))
    for k in range(periods):
        time = PERIOD_S * k
        history.tell(time, command(k), PERIOD_S)
        state = motion.predict(state, time + PERIOD_S, history.ramps(time, time + PERIOD_S))
    return state


# The update -----------------------------------------------------------------


def test_the_update_is_bayes_rule_for_normal_distributions() -> None:
    before, labels = prior(), layout()
    points = labels.centres_m(MEAN[:4])[:, :2] + 1e-3 * np.arange(8).reshape(4, 2)
    after, used = update(before, points, EVERY, labels, NOISE_M2, NO_GATE)
    assert used.all()
    slope = np.zeros((8, SIZE))
    slope[:, :4] = labels.jacobian(MEAN[:4])
    information = np.linalg.inv(before.covariance) + slope.T @ slope / NOISE_M2
    off = (points - labels.centres_m(MEAN[:4])[:, :2]).ravel()
    assert after.covariance == pytest.approx(np.linalg.inv(information), rel=1e-6, abs=1e-16)
    step = np.linalg.solve(information, slope.T @ off / NOISE_M2)
    assert after.mean - MEAN == pytest.approx(step, rel=1e-6, abs=1e-12)
    assert after.time_s == before.time_s


@pytest.mark.parametrize("label", range(4))
def test_the_gate_is_a_labels_mahalanobis_distance(label: int) -> None:
    before, labels = prior(), layout()
    slope = labels.jacobian(MEAN[:4])[2 * label : 2 * label + 2]
    spread = slope @ before.covariance[:4, :4] @ slope.T + NOISE_M2 * np.eye(2)
    off = np.array([2e-3, 3e-3])
    distance2 = off @ np.linalg.inv(spread) @ off
    points = labels.centres_m(MEAN[:4])[:, :2].copy()
    points[label] += off
    for gate, passes in ((1.001 * distance2, True), (0.999 * distance2, False)):
        after, used = update(before, points, EVERY, labels, NOISE_M2, gate)
        assert used.tolist() == [passes or i != label for i in range(4)]
        # what does not pass counts as not found
        alone, _ = update(before, points, used, labels, NOISE_M2, NO_GATE)
        assert after.mean == pytest.approx(alone.mean, abs=1e-15)


def test_without_labels_nothing_changes() -> None:
    before = prior()
    after, used = update(before, np.zeros((4, 2)), ~EVERY, layout(), NOISE_M2, NO_GATE)
    assert after is before
    assert not used.any()


# The motion -----------------------------------------------------------------


def test_prediction_follows_the_hybrid_model() -> None:
    plant = AnalyticPlant(ROBOT, 1, PERIOD_S, 0.001)
    start = RobotState.at_rest(0.1, -0.2, 0.4, 1.1)
    plant.reset(start)
    history, motion = CommandHistory(ROBOT), MotionModel(ROBOT, TrackerOptions())
    state = Gaussian(0.0, np.append(start.q[0], np.zeros(3)), 1e-8 * np.eye(SIZE))
    for k in range(30):
        time = PERIOD_S * k
        history.tell(time, command(k), PERIOD_S)
        plant.advance(command(k), 1)
        state = motion.predict(state, time + PERIOD_S, history.ramps(time, time + PERIOD_S))
    # both exact but for Simpson's rule and fourth-order steps of 33 ms
    assert state.mean[:4] == pytest.approx(plant.state().q[0], abs=1e-6)
    assert state.mean[6] == pytest.approx(plant.state().q_rate[0, 3], abs=1e-6)
    assert state.time_s == pytest.approx(30 * PERIOD_S)


@pytest.mark.parametrize(
    "hitch",
    [
        {"damping_n_m_s_rad": 9.3},
        {"stiffness_n_m_rad": 9.3, "damping_n_m_s_rad": 1.0},
        {"coulomb_friction_n_m": 0.05},
        {"damping_n_m_s_rad": 1e4, "stiffness_n_m_rad": 1e4},
    ],
)
def test_a_stiff_hitch_neither_blows_up_nor_swings(hitch: dict[str, float]) -> None:
    state = predicted(hitch, 60)
    assert abs(state.mean[3] - state.mean[2]) < 0.02
    assert np.linalg.eigvalsh(state.covariance).min() > 0
    assert state.covariance.max() < 0.1


def test_the_hitch_does_not_move_the_tractor() -> None:
    """A stiff hitch is followed in short parts of every ramp, which lead to the same place."""
    free, stiff = predicted({}, 20).mean, predicted({"damping_n_m_s_rad": 9.3}, 20).mean
    assert stiff[2] == pytest.approx(free[2], abs=1e-12)
    # Simpson's rule over 33 ms
    assert stiff[:2] == pytest.approx(free[:2], abs=1e-7)


def test_a_hitch_beyond_what_can_be_followed_is_as_stiff_as_can_be_followed() -> None:
    inertia = ROBOT.swing_inertia_kg_m2
    bounds = {
        "damping_n_m_s_rad": FASTEST_1_S * inertia,
        "stiffness_n_m_rad": FASTEST_1_S**2 * inertia,
        "coulomb_friction_n_m": FASTEST_1_S * STICTION_RATE_RAD_S * inertia,
    }
    for name, bound in bounds.items():
        at, beyond, below = (predicted({name: share * bound}, 3) for share in (1.0, 1.5, 0.9))
        assert beyond.mean == pytest.approx(at.mean, abs=1e-12), name
        assert abs(below.mean[3] - at.mean[3]) > 1e-10, name


@pytest.mark.parametrize(
    "hitch",
    [
        {},
        {"stiffness_n_m_rad": 0.02, "damping_n_m_s_rad": 0.01},
        {"coulomb_friction_n_m": 0.0002},
        {"stiffness_n_m_rad": 2.0, "damping_n_m_s_rad": 0.5},
    ],
)
def test_covariance_follows_the_linearized_motion(hitch: dict[str, float]) -> None:
    robot = ROBOT.model_copy(update={"hitch": Hitch.model_validate(hitch)})
    motion = MotionModel(robot, TrackerOptions())
    history = CommandHistory(robot)
    history.roll(np.array([4.0, 2.0]))
    history.tell(0.0, np.array([9.0, 1.0]), PERIOD_S)
    duration_s = 1e-4
    ramps = list(history.ramps(0.0, duration_s))

    def after(state: FloatArray, covariance: FloatArray) -> Gaussian:
        return motion.predict(Gaussian(0.0, state, covariance), duration_s, ramps)

    nothing, step = np.zeros((SIZE, SIZE)), 1e-6
    slopes = [
        (after(MEAN + d, nothing).mean - after(MEAN - d, nothing).mean) / (2 * step)
        for d in step * np.eye(SIZE)
    ]
    transition = np.array(slopes).T
    spread = np.diag(np.linspace(1.0, 2.0, SIZE))
    moved = after(MEAN, spread).covariance - after(MEAN, nothing).covariance
    # the error is of third order in 0.1 ms, times rates of up to 100/s
    assert moved == pytest.approx(transition @ spread @ transition.T, abs=1e-6)


@pytest.mark.parametrize("norm", [0.0, 1e-3, 0.24, 0.26, 7.0, 140.0])
def test_exponential_is_exact_to_rounding(norm: float) -> None:
    """140: a hitch that settles in 1 ms, over two periods."""
    matrix = np.random.default_rng(5).standard_normal((SIZE, SIZE))
    matrix *= norm / np.abs(matrix).sum(axis=1).max()
    matrix -= 0.5 * norm * np.eye(SIZE)  # decays, as what a hitch does
    size = max(np.abs(expected := expm(matrix)).max(), 1.0)
    # rounding, which every squaring may double: |A| of it
    assert np.abs(exponential(matrix) - expected).max() < 4e-16 * max(norm, 4.0) * size


@pytest.mark.parametrize("rate_1_s", [50.0, FASTEST_1_S])
def test_a_stiff_damper_stops_the_swing_as_its_closed_form_says(rate_1_s: float) -> None:
    damping = rate_1_s * ROBOT.swing_inertia_kg_m2
    hitch = Hitch.model_construct(damping_n_m_s_rad=damping)
    motion = MotionModel(ROBOT.model_copy(update={"hitch": hitch}), TrackerOptions())
    history = CommandHistory(ROBOT)
    history.tell(0.0, np.zeros(2), PERIOD_S)
    ramps, nothing = list(history.ramps(0.0, PERIOD_S)), np.zeros((SIZE, SIZE))

    def after(covariance: FloatArray) -> FloatArray:
        still = Gaussian(0.0, np.zeros(SIZE), covariance)
        return motion.predict(still, PERIOD_S, ramps).covariance

    swinging = nothing.copy()
    swinging[-1, -1] = 1.0
    left = np.exp(-rate_1_s * PERIOD_S)
    way = np.array([(1.0 - left) / rate_1_s, left])
    spread = (after(swinging) - after(nothing))[np.ix_([3, -1], [3, -1])]
    assert spread == pytest.approx(np.outer(way, way), rel=1e-9, abs=1e-16)


def test_what_the_model_lacks_is_added_in_proportion_to_time() -> None:
    options = TrackerOptions(
        speed_noise_m_s=0.2, turn_noise_rad_s=2.0, noise_time_s=0.5, swing_noise_rad_s2=0.7
    )
    motion, history = MotionModel(ROBOT, options), CommandHistory(ROBOT)
    still = Gaussian(0.0, np.zeros(SIZE), np.zeros((SIZE, SIZE)))
    added = motion.predict(still, 0.01, history.ramps(0.0, 0.01)).covariance
    rates = [
        *np.square([*POSITION_WALK, ANGLE_WALK, ANGLE_WALK]),
        2.0 * 0.2**2 / 0.5,
        2.0 * 2.0**2 / 0.5,
        0.7**2 * ACCELERATION_TIME_S,
    ]
    assert added == pytest.approx(0.01 * np.diag(rates), abs=1e-15)
    assert motion.deviation.tolist() == [0.2, 2.0]


def test_deviations_from_the_commands_fade_and_keep_their_size() -> None:
    options = TrackerOptions(noise_time_s=0.5)
    motion, history = MotionModel(ROBOT, options), CommandHistory(ROBOT)
    spread = np.zeros(SIZE)
    spread[4:6] = motion.deviation**2
    mean = np.array([0.0, 0.0, 0.0, 0.0, 0.1, -0.3, 0.0])
    state = Gaussian(0.0, mean, np.diag(spread))
    for k in range(60):
        time = 0.02 * k
        state = motion.predict(state, time + 0.02, history.ramps(time, time + 0.02))
    assert state.mean[4:6] == pytest.approx(np.exp(-1.2 / 0.5) * mean[4:6], rel=1e-12)
    # stationary but for the steps: dt/τ = 4 %
    assert np.diag(state.covariance)[4:6] == pytest.approx(motion.deviation**2, rel=0.05)


def test_a_long_way_is_linearized_in_pieces() -> None:
    """A second in one call spreads like a second of periods, though not to the bit."""
    options = TrackerOptions()
    motion, history = MotionModel(ROBOT, options), CommandHistory(ROBOT)
    for k in range(30):
        history.tell(PERIOD_S * k, command(k), PERIOD_S)
    start, end = Gaussian(0.0, np.zeros(SIZE), 1e-6 * np.eye(SIZE)), 30 * PERIOD_S
    whole = motion.predict(start, end, history.ramps(0.0, end))
    state = start
    for k in range(30):
        until = PERIOD_S * (k + 1)
        state = motion.predict(state, until, history.ramps(PERIOD_S * k, until))
    assert whole.mean == pytest.approx(state.mean, abs=1e-6)
    # pieces of 66 ms against 33 ms, δ stirred up by dt/τ = 22 % and 11 % more than it fades
    stds = [np.sqrt(np.diag(one.covariance)) for one in (whole, state)]
    assert stds[0] == pytest.approx(stds[1], rel=0.06)


# The commands ---------------------------------------------------------------


def test_ramps_cover_the_time_without_gaps() -> None:
    history = CommandHistory(ROBOT)
    for k in range(5):
        history.tell(PERIOD_S * k, command(k), PERIOD_S)
    parts = list(history.ramps(0.01, 0.2))
    assert sum(part.duration_s for part in parts) == pytest.approx(0.19)
    assert all(a.u1_end == b.u1_start and a.u2_end == b.u2_start for a, b in pairwise(parts))
    assert history.twist(9.0) == history.twist(5 * PERIOD_S)
    assert list(history.ramps(0.1, 0.1)) == []
    assert list(history.ramps(0.2, 0.1)) == []


def test_a_command_is_a_ramp_that_ends_in_a_kink() -> None:
    limit = ROBOT.servo.acceleration_limit_rad_s2
    history = CommandHistory(ROBOT, time_s=1.0)
    history.roll(np.array([1.0, 2.0]))
    change = np.array([0.3, -0.6]) * limit * 0.02  # reached after 6 and 12 ms
    history.tell(1.0, np.array([1.0, 2.0]) + change, 0.02)
    knots = [0.0, 0.006, 0.012, 0.02]
    parts = list(history.ramps(1.0, 1.02))
    assert [part.duration_s for part in parts] == pytest.approx(list(np.diff(knots)))
    for time in (0.0, 0.003, 0.006, 0.01, 0.012, 0.017, 0.02, 0.5):
        done = np.minimum(limit * time, np.abs(change)) * np.sign(change)
        expected = twist_from_wheels(np.array([1.0, 2.0]) + done, ROBOT)
        assert history.twist(1.0 + time) == pytest.approx(tuple(expected), rel=1e-12)


def test_a_pause_between_commands_holds_the_last_speed_reached() -> None:
    history = CommandHistory(ROBOT)
    history.tell(0.0, np.array([0.5, 0.5]), 0.033)
    history.tell(0.5, np.array([0.0, 0.0]), 0.033)
    assert history.twist(0.25) == pytest.approx(history.twist(0.033))
    assert history.twist(0.5) == pytest.approx(history.twist(0.033))
    assert history.twist(0.6)[0] < history.twist(0.5)[0]


def test_old_commands_are_forgotten_and_the_rest_is_kept() -> None:
    history, all_of_it = CommandHistory(ROBOT), []
    for k in range(300):
        history.tell(PERIOD_S * k, command(k), PERIOD_S)
        all_of_it.append(history.twist(PERIOD_S * k))
    now = PERIOD_S * 299
    assert history._times[0] <= now - MEMORY_S < history._times[1]
    for k in range(150, 300):
        assert history.twist(PERIOD_S * k) == pytest.approx(all_of_it[k], abs=1e-12)


# The pose -------------------------------------------------------------------


@pytest.mark.parametrize("hidden", [None, 0, 3])
def test_the_pose_is_the_least_squares_solution(hidden: int | None) -> None:
    labels, q = layout(), np.array([0.31, -0.22, 2.9, 1.3])
    noise = 2e-4 * np.random.default_rng(1).standard_normal((4, 2))
    points = labels.centres_m(q)[:, :2] + noise
    if hidden is not None:
        points[hidden] = np.nan
    found = np.isfinite(points[:, 0])

    def residual(unknown: FloatArray) -> FloatArray:
        return (labels.centres_m(unknown)[found, :2] - points[found]).ravel()

    best = least_squares(residual, q, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    pose = solve_pose(points, labels)
    assert pose is not None
    assert pose.q == pytest.approx(best.x, abs=1e-7)
    assert pose.residual_m == pytest.approx(np.sqrt(2 * best.cost / found.sum()), rel=1e-6)
