"""The observer: its gains, what it learns, and symmetries that hold to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from ttwmr_mj.controllers.shared.estimation.observer import (
    MAX_DELAY,
    Observed,
    Observer,
    rolling_turn_rate,
)
from ttwmr_mj.controllers.shared.estimation.steady_kalman import (
    ObserverOptions,
    chain_gains,
    slip_std,
)
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

ROBOT = RobotParameters(servo=Servo(preset="fast"))
PERIOD = 0.033
MODEL = SampledModel(ROBOT, PERIOD)
OPTIONS = ObserverOptions()
MIRROR = np.array([1.0, -1.0, -1.0, -1.0])  # of q and its rates, in the x axis


def observer() -> Observer:
    return Observer(ROBOT, MODEL, OPTIONS)


def estimate(
    q: np.ndarray, rate: np.ndarray, age_s: object = 0.0, valid: object = True
) -> Estimate:
    n = len(q)
    age, ok = np.broadcast_to(np.float64(age_s), n), np.broadcast_to(np.bool_(valid), n)
    return Estimate(RobotState(q, rate), age, ok, np.full(n, np.nan))


def samples(nsim: int, count: int = 6) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Measured q and rates that jump about, and commands."""
    rng = np.random.default_rng(4)
    q0 = np.array([0.3, -0.2, 0.7, 1.9])
    return [
        (
            q0 + 0.01 * rng.normal(size=(nsim, 4)),
            np.array([0.3, 0.2, 0.4, 0.5]) + 0.1 * rng.normal(size=(nsim, 4)),
            15.0 + rng.normal(size=(nsim, 2)),
        )
        for _ in range(count)
    ]


def last(seen: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Observed:
    watcher = observer()
    for q, rate, command in seen:
        watcher.update(estimate(q, rate))
        found = watcher.commanded(command)
    return found


def test_gains_are_the_limit_of_the_kalman_filter() -> None:
    """Chains of integrators from their generator, and the recursion run until it settles."""
    T, o = PERIOD, OPTIONS
    walks = np.sqrt(T) * np.array([o.creep_walk_m_s, o.turn_creep_walk_rad_s, o.swing_walk_rad_s2])
    place, angle = (o.position_std_m, o.velocity_std_m_s), (o.angle_std_rad, o.rate_std_rad_s)
    gain = chain_gains(o, T)
    for column, process, noise in (
        (0, (2e-5, walks[0]), place),
        (1, (2e-5, walks[0]), place),
        (2, (1e-4, walks[1]), angle),
        (3, (1e-4, 3e-3, walks[2]), angle),
    ):
        n = len(process)
        A, C = expm(T * np.eye(n, k=1)), np.eye(2, n)
        Q, R, P = np.diag(np.square(process)), np.diag(np.square(noise)), np.eye(n)
        for _ in range(3000):
            K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
            P = A @ (P - K @ C @ P) @ A.T + Q
        assert gain[:n, :, column] == pytest.approx(K, rel=1e-6)
        if column < 2:  # right after a measurement
            assert slip_std(o, T) ** 2 == pytest.approx((P - P @ C.T @ K.T)[1, 1], rel=1e-6)
        assert not gain[n:, :, column].any()


def test_it_finds_slip_and_an_unexplained_acceleration() -> None:
    slip, extra = np.array([[0.004, -0.006, 0.01]]), np.array([0.08])
    body, wheels, watcher = np.array([[0.1, 0.2, 0.3, 1.5, 0.0]]), np.zeros((1, 2)), observer()
    for k in range(600):
        turn = rolling_turn_rate(wheels, ROBOT) + slip[:, 2]
        rate = np.column_stack([MODEL.velocity(body, wheels, slip), turn, body[:, 4]])
        seen = watcher.update(estimate(body[:, :4], rate))
        command = np.array([[8.0 + np.sin(0.1 * k), 7.0]])
        body, wheels = MODEL.advance(body, wheels, command, slip=slip, unexplained=extra)
        watcher.commanded(command)
    # noise-free: what is left has decayed with the slowest pole, 20 s in
    assert seen.slip == pytest.approx(slip, rel=1e-2)
    assert seen.unexplained == pytest.approx(extra, rel=1e-2)


def test_a_turned_world_turns_what_is_seen() -> None:
    seen, angle = samples(2), 1.1
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])

    def turned(values: np.ndarray, by: float) -> np.ndarray:
        return np.concatenate([values[:, :2] @ turn.T, values[:, 2:4] + by, values[:, 4:]], axis=1)

    here = last(seen)
    there = last([(turned(q, angle), turned(rate, 0.0), command) for q, rate, command in seen])
    assert there.body == pytest.approx(turned(here.body, angle), abs=1e-12)
    assert there.slip == pytest.approx(here.slip, abs=1e-12)
    assert there.unexplained == pytest.approx(here.unexplained, abs=1e-12)


def test_a_mirrored_world_mirrors_what_is_seen() -> None:
    seen = samples(2)
    here, there = last(seen), last([(q * MIRROR, r * MIRROR, c[:, ::-1]) for q, r, c in seen])
    assert there.body == pytest.approx(here.body * [*MIRROR, -1.0], abs=1e-12)
    assert there.wheels == pytest.approx(here.wheels[:, ::-1], abs=1e-12)
    assert there.slip == pytest.approx(here.slip * [1.0, -1.0, -1.0], abs=1e-12)
    assert there.unexplained == pytest.approx(-here.unexplained, abs=1e-12)


def test_a_whole_turn_more_changes_nothing() -> None:
    seen, one = samples(2), 2.0 * np.pi
    wound = [(q + (i > 0) * np.array([0, 0, one, -one]), r, c) for i, (q, r, c) in enumerate(seen)]
    assert last(wound).body == pytest.approx(last(seen).body, abs=1e-12)
    assert last(wound).unexplained == pytest.approx(last(seen).unexplained, abs=1e-10)


def test_each_simulation_is_corrected_at_its_own_time_only() -> None:
    """A batch of different ages and of blind ones is its single simulations, to the bit."""
    ages, valid = PERIOD * np.array([0.0, 2.0, 1.0, 0.0]), np.array([True, True, True, False])
    together, alone = observer(), [observer() for _ in range(4)]
    for k, (q, rate, command) in enumerate(samples(4)):
        age, ok = np.minimum(ages, k * PERIOD), valid | (k == 0)
        seen = together.update(estimate(q, rate, age, ok))
        together.commanded(command)
        for i, one in enumerate(alone):
            row = slice(i, i + 1)
            single = one.update(estimate(q[row], rate[row], age[row], ok[row]))
            one.commanded(command[row])
            for field in ("body", "wheels", "slip", "unexplained"):
                assert np.array_equal(getattr(seen, field)[row], getattr(single, field))


def test_a_push_counts_for_a_lasting_torque_only_so_far() -> None:
    def learnt(angle: float, rate: float) -> float:
        watcher, q = observer(), np.array([[0.0, 0.0, 0.0, 0.5]])
        watcher.update(estimate(q, np.zeros((1, 4))))
        watcher.commanded(np.zeros((1, 2)))
        surprise = estimate(q + [0, 0, 0, angle], np.array([[0, 0, 0, rate]]))
        return float(watcher.update(surprise).unexplained[0])

    limit, limit_rate = 1.5 * (1e-3 + PERIOD * 0.05), 1.5 * 0.05
    for angle, rate in ((limit, 0.0), (0.0, limit_rate)):
        assert learnt(5 * angle, 5 * rate) == pytest.approx(learnt(angle, rate), rel=1e-9)
        assert learnt(-5 * angle, -5 * rate) == pytest.approx(-learnt(angle, rate), rel=1e-9)
        assert learnt(0.5 * angle, 0.5 * rate) == pytest.approx(0.5 * learnt(angle, rate), rel=1e-9)
        assert learnt(angle, rate) > 0.0


def test_what_is_too_old_is_not_used() -> None:
    for late, used in ((MAX_DELAY, True), (MAX_DELAY + 1, False)):
        watcher, q = observer(), np.zeros((1, 4))
        watcher.update(estimate(q, q))
        for _ in range(MAX_DELAY + 5):
            expected = watcher.commanded(np.zeros((1, 2)))
        seen = watcher.update(estimate(q + 1.0, q, late * PERIOD))
        assert np.array_equal(seen.body, expected.body) is not used
