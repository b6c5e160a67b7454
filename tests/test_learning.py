"""What the observer finds out about slope, resisting balls and the hitch, and how sure it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest
from scipy.linalg import expm

from ttwmr_mj.controllers.shared.estimation.friction import FrictionOptions
from ttwmr_mj.controllers.shared.estimation.learning import (
    KNOWN,
    MOTOR_MISSES,
    PLACES,
    PRIOR_STD,
    UNEXPLAINED_TIME_S,
    Learnable,
    Learner,
)
from ttwmr_mj.controllers.shared.estimation.observer import Observed, Observer
from ttwmr_mj.controllers.shared.estimation.steady_kalman import ObserverOptions, process_std
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.influence import DRAG, DRY, INFLUENCES, VISCOUS, influence_of
from ttwmr_mj.dynamics.kinematics import twist_from_wheels, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.latency import LatencyFinder
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.robot import Casters, Hitch, RobotParameters, Servo
from ttwmr_mj.robot.motor import Motor
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, RobotState

PERIOD = 0.033
FAST = Servo(preset="fast")
BELIEVED = RobotParameters(servo=FAST)
RUBBING = RobotParameters(
    servo=FAST,
    casters=Casters(rolling_resistance_m=1e-4),
    hitch=Hitch(coulomb_friction_n_m=1e-3, damping_n_m_s_rad=1e-3),
)
SLOPE = Ground(slope_rad=0.01, downhill_rad=0.7)
OPTIONS = ObserverOptions()
EVERYTHING = get_args(Learnable)
NOISE = OPTIONS.angle_std_rad, OPTIONS.rate_std_rad_s
BENT = RobotState.at_rest(0.0, 0.0, 0.3, 0.3)
MIRROR = np.array([1.0, -1.0, -1.0, -1.0])  # of q and its rates, in the x axis
MIRROR_INFLUENCE = np.array([1.0, -1.0, 1.0, 1.0, 1.0])


def learner(
    learn: tuple[Learnable, ...] = EVERYTHING,
    nsim: int = 1,
    smoothing_rad_s: float = FrictionOptions().smoothing_rad_s,
) -> Learner:
    process = process_std(OPTIONS, PERIOD)
    return Learner(learn, BELIEVED, PERIOD, nsim, process, NOISE, smoothing_rad_s)


def watcher(learn: tuple[Learnable, ...] = EVERYTHING, nsim: int = 1) -> Observer:
    model = SampledModel(BELIEVED, PERIOD)
    return Observer(BELIEVED, model, OPTIONS, learner(learn, nsim))


def wandering(k: int) -> FloatArray:
    """Wheel speeds that swing the trailer to both sides."""
    turn = 3.0 * np.sin(0.05 * k) + 1.5 * np.sin(0.017 * k)
    return np.array([[12.0 + turn, 12.0 - turn]])


def on_a_circle() -> tuple[RobotState, FloatArray]:
    """Start and wheel speeds of a circle on which the trailer stays where it is."""
    circle = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0, side="outside")
    path = circle.sample(PERIOD * np.arange(2.0), BELIEVED)
    start = RobotState(path.q[0], path.q_rate[0])
    return start, wheels_from_twist(workspace_rate(start.q, start.q_rate)[:, :2], BELIEVED)


def seen_of(q: FloatArray, rate: FloatArray, noise: FloatArray) -> Estimate:
    """The estimate of a state with noise (nsim, 8) in standard deviations."""
    o, nsim = OPTIONS, len(noise)
    std = np.repeat([o.position_std_m, o.angle_std_rad, o.velocity_std_m_s, o.rate_std_rad_s], 2)
    q, rate = q + noise[:, :4] * std[:4], rate + noise[:, 4:] * std[4:]
    still = np.zeros(nsim)
    return Estimate(RobotState(q, rate), still, np.ones(nsim, dtype=np.bool_), still)


def watched(
    observer: Observer,
    commands: Callable[[int], FloatArray],
    periods: int,
    robot: RobotParameters,
    ground: Ground,
    noise: float = 1.0,
    start: RobotState = BENT,
) -> Observed:
    """What is seen of the analytic plant after some time of measurements, noise in OPTIONS."""
    rng = np.random.default_rng(8)
    plant = AnalyticPlant(robot, 1, PERIOD, 0.011, ground=ground)
    plant.reset(start)
    for k in range(periods):
        now = plant.state()
        seen = observer.update(seen_of(now.q, now.q_rate, noise * rng.normal(size=(1, 8))))
        plant.advance(commands(k), 1)
        observer.commanded(commands(k))
    return seen


@pytest.mark.parametrize("smoothing_rad_s", [0.05, 0.5])
def test_factors_are_the_derivatives_of_the_sampled_model(smoothing_rad_s: float) -> None:
    """θ̇2 after a very short period, by each influence."""
    T, rng = 1e-5, np.random.default_rng(2)
    model = SampledModel(BELIEVED, T, smoothing_rad_s=smoothing_rad_s)
    body, wheels = rng.normal(size=(20, 5)), rng.uniform(5.0, 15.0, (20, 2))
    slip = 0.02 * rng.normal(size=(20, 3))
    given, found = rng.uniform(0.05, 0.2, (20, INFLUENCES)), np.empty((20, INFLUENCES))
    for i, step in enumerate(1e-2 * np.eye(INFLUENCES)):
        more, less = (
            model.advance(body, wheels, wheels, slip=slip, influence=given + sign * step)[0][:, 4]
            for sign in (1.0, -1.0)
        )
        found[:, i] = (more - less) / (2e-2 * T)
    observer = Observer(BELIEVED, model, OPTIONS)
    now = Observed(body, wheels, slip, np.zeros(20), given)
    velocity = model.velocity(body, wheels, slip)
    factors = learner(smoothing_rad_s=smoothing_rad_s)._factors(
        body, velocity, observer.hitch_rate(now)
    )
    # first order in 10 µs, on which directions turn by up to 1e-4
    np.testing.assert_allclose(factors, found, atol=1e-3)


@pytest.mark.parametrize("name", PLACES)
def test_only_what_is_asked_for_is_learned(name: Learnable) -> None:
    observer = watcher((name,))
    seen = watched(observer, wandering, 60, RUBBING, SLOPE)
    asked = np.zeros(INFLUENCES, dtype=bool)
    asked[PLACES[name]] = True
    filt = observer.learner
    assert filt is not None
    np.testing.assert_array_equal(filt.places, asked)
    np.testing.assert_array_equal(seen.influence[0] != 0.0, asked)
    np.testing.assert_array_equal(filt.std()[0] > 0.0, asked)
    nothing = watched(watcher(("latency", "wheel_radius")), wandering, 20, RUBBING, SLOPE)
    np.testing.assert_array_equal(nothing.influence, 0.0)


@pytest.mark.slow
def test_everything_is_found_on_a_drive_that_excites_it() -> None:
    observer = watcher()
    seen = watched(observer, wandering, 1000, RUBBING, SLOPE)
    assert observer.learner is not None
    std, truth = observer.learner.std()[0], influence_of(RUBBING, SLOPE)
    assert (np.abs(seen.influence[0] - truth) < 3.0 * std).all(), (seen.influence, truth, std)
    assert (std < 0.3 * PRIOR_STD).all(), std / PRIOR_STD


def test_what_is_not_excited_stays_as_unsure_as_it_was() -> None:
    """On a level circle the hitch does not turn: nothing is learned of its friction."""
    observer, (start, wheels) = watcher(), on_a_circle()
    seen = watched(observer, lambda _: wheels, 300, BELIEVED, Ground(), 0.0, start)
    assert observer.learner is not None
    share = observer.learner.std()[0] / PRIOR_STD
    assert (share[DRY:] > 0.99).all()
    assert (share[:DRAG] < 0.2).all()  # gravity turns once a round, of which there were 1.6
    assert np.abs(seen.influence[0, :DRAG]).max() < 0.02  # level


def test_the_covariance_stays_symmetric_positive_and_below_the_prior() -> None:
    rng, filt = np.random.default_rng(1), learner(nsim=3)
    for k in range(300):
        body, velocity = rng.normal(size=(3, 5)), rng.normal(size=(3, 2))
        filt.predict(body, velocity, rng.normal(size=3), np.ones(3))
        P = filt._covariance
        np.testing.assert_allclose(P, np.swapaxes(P, 1, 2), rtol=1e-9, atol=1e-15)
        assert np.linalg.eigvalsh(P).min() > 0.0
        assert (filt.std() <= PRIOR_STD * (1.0 + 1e-12)).all()
        before = filt.std()
        filt.gain(np.array([True, k % 2 == 0, False]))
        assert (filt.std()[0] < before[0]).all()
        np.testing.assert_array_equal(filt.std()[2], before[2])
    # unseen, all is forgotten: back to the prior
    assert filt.std()[2] == pytest.approx(PRIOR_STD)


def test_the_covariance_moves_as_the_linear_system_does() -> None:
    rng, filt = np.random.default_rng(7), learner()
    seen = rng.normal(size=(1, 5)), rng.normal(size=(1, 2)), rng.normal(size=1), np.ones(1)
    root = 0.1 * rng.normal(size=(KNOWN + INFLUENCES, KNOWN + INFLUENCES))
    P = 1e-3 * root @ root.T  # below the prior
    filt._covariance[0], G = P, np.zeros_like(P)
    G[0, 1] = G[1, 2] = 1.0
    G[1, KNOWN:] = filt._factors(*seen[:3])[0]
    A = expm(PERIOD * G)  # w is held for a period, and then forgotten in part
    A[2, 2] = np.exp(-PERIOD / UNEXPLAINED_TIME_S)
    filt.predict(*seen)
    np.testing.assert_allclose(filt._covariance[0], A @ P @ A.T + filt._process, atol=1e-12)


def test_what_a_motor_misses_makes_the_rate_less_sure() -> None:
    robot = BELIEVED.model_copy(update={"servo": Servo(preset="fast", motor=Motor(preset="fast"))})
    process = process_std(OPTIONS, PERIOD)
    seen = np.zeros((1, 5)), np.zeros((1, 2)), np.zeros(1)
    ideal, driven, still = (
        Learner(EVERYTHING, one, PERIOD, 1, process, NOISE, 0.05)
        for one in (BELIEVED, robot, robot)
    )
    change = np.array([2.0])  # rad/s
    ideal.predict(*seen, change)
    driven.predict(*seen, change)
    still.predict(*seen, np.zeros(1))
    missed = MOTOR_MISSES * 2.0 * robot.tractor.wheel_radius_m / robot.swing_length_m
    more = driven._covariance - ideal._covariance
    assert more[0, 1, 1] == pytest.approx(missed**2)
    assert np.count_nonzero(more) == 1
    np.testing.assert_array_equal(still._covariance, ideal._covariance)


@pytest.mark.parametrize(("learn", "expected"), [(EVERYTHING, np.exp(-3.0)), (("slope",), 1.0)])
def test_what_is_unexplained_is_forgotten_where_resistance_is_learned(
    learn: tuple[Learnable, ...], expected: float
) -> None:
    observer = watcher(learn)
    start, wheels = on_a_circle()
    observer.update(seen_of(start.q, start.q_rate, np.zeros((1, 8))))
    observer._past[-1] = observer._past[-1]._replace(unexplained=np.ones(1))
    for _ in range(round(observer._patience + 3.0 * UNEXPLAINED_TIME_S / PERIOD)):
        left = observer.commanded(wheels).unexplained
    assert left[0] == pytest.approx(expected, rel=0.06)  # to the nearest period


def test_forgetting_brings_the_prior_back_at_its_rate() -> None:
    filt = learner(("viscous_friction",))
    filt._covariance[:, KNOWN + VISCOUS, KNOWN + VISCOUS] = 0.0
    still = np.zeros((1, 5)), np.zeros((1, 2)), np.zeros(1), np.zeros(1)
    for _ in range(round(10.0 / PERIOD)):
        filt.predict(*still)
    # 1 % of the variance in a second
    assert filt.std()[0, VISCOUS] == pytest.approx(PRIOR_STD[VISCOUS] * np.sqrt(0.1), rel=2e-3)


def test_gain_is_that_of_the_textbook() -> None:
    filt, rng = learner(), np.random.default_rng(5)
    for _ in range(5):
        filt.predict(
            rng.normal(size=(1, 5)), rng.normal(size=(1, 2)), rng.normal(size=1), np.ones(1)
        )
    P, C, R = filt._covariance[0].copy(), np.eye(2, KNOWN + INFLUENCES), np.diag(np.square(NOISE))
    K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    np.testing.assert_allclose(filt.gain(np.ones(1, bool))[0], K, rtol=1e-9)
    joseph = np.eye(len(P)) - K @ C
    after = joseph @ P @ joseph.T + K @ R @ K.T
    np.testing.assert_allclose(filt._covariance[0], after, rtol=1e-9, atol=1e-12)


def drives(nsim: int) -> list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Measurements of robots each of which drives its own way: q, its rate, noise, command."""
    rng, samples = np.random.default_rng(6), []
    model = SampledModel(RUBBING, PERIOD, ground=SLOPE)
    body = np.array([0.0, 0.0, 0.3, 0.3, 0.0]) + 0.1 * rng.normal(size=(nsim, 5))
    wheels = np.full((nsim, 2), 12.0)
    for k in range(60):
        velocity = model.velocity(body, wheels, np.zeros((nsim, 3)))
        rate = np.column_stack([velocity, twist_from_wheels(wheels, RUBBING)[:, 1], body[:, 4]])
        command = 12.0 + 3.0 * np.sin(0.2 * k + np.arange(2 * nsim)).reshape(nsim, 2)
        samples.append((body[:, :4], rate, rng.normal(size=(nsim, 8)), command))
        body, wheels = model.advance(body, wheels, command)
    return samples


def test_a_row_of_a_batch_is_the_row_alone() -> None:
    together, alone = watcher(nsim=3), [watcher() for _ in range(3)]
    for q, rate, noise, command in drives(3):
        seen = together.update(seen_of(q, rate, noise))
        together.commanded(command)
        for i, one in enumerate(alone):
            row = slice(i, i + 1)
            single = one.update(seen_of(q[row], rate[row], noise[row]))
            one.commanded(command[row])
            np.testing.assert_array_equal(seen.influence[row], single.influence)
            np.testing.assert_array_equal(seen.body[row], single.body)
            assert together.learner is not None
            assert one.learner is not None
            np.testing.assert_array_equal(together.learner.std()[row], one.learner.std())


def test_a_mirrored_world_is_learned_mirrored() -> None:
    here, there = watcher(), watcher()
    for q, rate, noise, command in drives(1):
        flip = np.concatenate([MIRROR, MIRROR])
        ours = here.update(seen_of(q, rate, noise))
        mirrored = there.update(seen_of(q * MIRROR, rate * MIRROR, noise * flip))
        here.commanded(command)
        there.commanded(command[:, ::-1])
    np.testing.assert_allclose(mirrored.influence, ours.influence * MIRROR_INFLUENCE, atol=1e-12)
    assert np.abs(ours.influence[0, :2]).min() > 1e-3


def test_nothing_that_is_learned_drives_the_trailer() -> None:
    """Resistance and friction that would come out negative are taken for none."""
    pushed = RobotParameters(servo=FAST)
    observer, rng = watcher(), np.random.default_rng(0)
    plant = AnalyticPlant(pushed, 1, PERIOD, 0.011)
    plant.reset(BENT)
    least = []
    for k in range(120):
        now = plant.state()
        seen = observer.update(seen_of(now.q, now.q_rate, rng.normal(size=(1, 8))))
        least.append(seen.influence[0, DRAG:])
        plant.advance(wandering(k), 1)
        observer.commanded(wandering(k))
    assert np.min(least) == 0.0  # noise about zero, cut


def test_another_latency_is_a_new_beginning() -> None:
    """What seemed to act while measurements were put at wrong times is unlearned."""
    late = LatencyFinder(BELIEVED, PERIOD, 1, (OPTIONS.position_std_m, OPTIONS.angle_std_rad))
    observer = Observer(BELIEVED, SampledModel(BELIEVED, PERIOD), OPTIONS, learner(), 0, late)
    seen = watched(observer, wandering, 90, RUBBING, SLOPE)
    assert observer.learner is not None
    assert np.abs(seen.influence).max() > 0.01
    assert (observer.learner.std() < 0.99 * PRIOR_STD).any()
    observer._start_again(np.array([False]))
    assert np.abs(observer._past[-1].influence).max() > 0.01
    observer._start_again(np.array([True]))
    for was in observer._past:
        np.testing.assert_array_equal(was.influence, 0.0)
        np.testing.assert_array_equal(was.unexplained, 0.0)
    np.testing.assert_allclose(observer.learner.std()[0], PRIOR_STD, rtol=1e-12)


def test_the_wheel_that_changes_more_decides_what_a_motor_may_miss() -> None:
    robot = BELIEVED.model_copy(update={"servo": Servo(preset="fast", motor=Motor(preset="fast"))})
    start, wheels = on_a_circle()
    rates = []
    for change in ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)):
        filt = Learner(EVERYTHING, robot, PERIOD, 1, process_std(OPTIONS, PERIOD), NOISE, 0.05)
        observer = Observer(robot, SampledModel(robot, PERIOD), OPTIONS, filt)
        observer.update(seen_of(start.q, start.q_rate, np.zeros((1, 8))))
        observer._patience = 0
        observer.commanded(wheels + np.array([change]))
        rates.append(filt._covariance[0, 1, 1])
    steady, one, both = rates
    assert one > steady
    assert both == one
