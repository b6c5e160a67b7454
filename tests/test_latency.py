"""Latency that nobody told of, found from how the robot answers to commands."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.dynamics.latency import CANDIDATES, LatencyFinder
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.state import FloatArray

PERIOD = 0.033
ROBOT = RobotParameters(servo=Servo(preset="fast"))
STD = 2e-4, 1e-3


def drive(
    late: list[float],
    told: int = 0,
    periods: int = 300,
    wander: float = 1.0,
    noise: float = 1.0,
    slip: float = 0.0,
    seed: int = 0,
) -> tuple[LatencyFinder, FloatArray]:
    """The finder, and what it has found (periods, nsim) in periods.

    Args:
        late: of each robot, how many periods its measurements come later than the told ones.
        told: how many periods old they say they are.
        periods: of the drive.
        wander: size of the steps that commands take [rad/s].
        noise: of measurements, in STD.
        slip: share of the speed that is lost.
        seed: of both.
    """
    nsim = len(late)
    rngs = [np.random.default_rng([seed, i]) for i in range(nsim)]
    model, finder = SampledModel(ROBOT, PERIOD), LatencyFinder(ROBOT, PERIOD, nsim, STD)
    body, wheels = np.tile([0.0, 0.0, 1.2, 0.0, 0.0], (nsim, 1)), np.full((nsim, 2), 12.0)
    finder.roll(wheels)
    past, found, std = [body], [], noise * np.array([STD[0], STD[0], STD[1]])
    for k in range(periods):
        ages = np.minimum(told + np.array(late), k)
        shaken = np.stack([rng.normal(size=3) * std for rng in rngs])
        q = np.stack([at(past, k - age)[i, :3] for i, age in enumerate(ages)]) + shaken
        stamp = np.full(nsim, (k - min(told, k)) * PERIOD)
        finder.measured(stamp, q, np.ones(nsim, dtype=np.bool_))
        found.append(finder.extra_s / PERIOD)
        command = 12.0 + wander * np.stack([rng.normal(size=2) for rng in rngs])
        finder.commanded(command)
        lost = np.zeros((nsim, 3))
        lost[:, 0] = -slip * 12.0 * ROBOT.tractor.wheel_radius_m
        body, wheels = model.advance(body, wheels, command, slip=lost)
        past.append(body)
    return finder, np.array(found)


def at(past: list[FloatArray], period: float) -> FloatArray:
    """Bodies between two samples."""
    share = period - int(period)
    return np.asarray((1.0 - share) * past[int(period)] + share * past[int(np.ceil(period))])


@pytest.mark.parametrize("late", [0.3, 0.75, 1.25])
def test_between_periods_the_parabola_says_where(late: float) -> None:
    _, found = drive([late])
    # costs are parabolas between candidates only nearly: a fifth of their step
    assert found[-1, 0] == pytest.approx(late, abs=0.1)


@pytest.mark.parametrize("late", [-1, 0, 1, 2])
def test_whole_periods_are_found(late: int) -> None:
    finder, found = drive([late], told=max(-late, 0))
    # noise moves the vertex of the parabola, by far less than rounding to periods does
    assert found[-1, 0] == pytest.approx(late, abs=0.15)
    assert (np.rint(found[150:, 0]) == late).all()
    assert finder.periods == 300


def test_it_is_found_despite_slip_and_without_noise_exactly() -> None:
    for seed in range(3):
        _, found = drive([1], slip=0.6, wander=0.3, seed=seed)
        assert found[-1, 0] == pytest.approx(1.0, abs=0.15)
    _, found = drive([2], noise=0.0)
    # the parabola is exact where costs are symmetric about the truth: nearly
    assert found[-1, 0] == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("late", [0, 2])
def test_constant_commands_tell_nothing(late: int) -> None:
    _, found = drive([late], wander=0.0)
    np.testing.assert_array_equal(found, 0.0)


def test_what_is_right_is_not_touched_by_noise() -> None:
    """No commands to speak of: what is believed is only left on evidence."""
    for seed in range(3):
        _, found = drive([0], wander=0.01, seed=seed)
        assert np.abs(found).max() <= 0.5


def test_what_is_found_lies_among_the_candidates() -> None:
    step = CANDIDATES[1] - CANDIDATES[0]
    for late in (5, -3):
        _, found = drive([late], told=max(-late, 0), noise=0.0)
        assert CANDIDATES[0] - step <= found.min()
        assert found.max() <= CANDIDATES[-1] + step
    # and moves a little only, once it is found
    _, found = drive([1])
    jumps = np.abs(np.diff(found[:, 0]))
    assert (jumps > step).sum() <= 1


def test_each_row_is_found_as_if_alone() -> None:
    late = [0, 2, 1]
    _, together = drive(late)
    assert list(np.rint(together[-1])) == late
    for i in range(len(late)):  # the random numbers are each row's own
        _, fewer = drive(late[: i + 1])
        np.testing.assert_array_equal(together[:, i], fewer[:, i])


def test_who_is_not_measured_learns_nothing_and_forgets_nothing() -> None:
    finder, _ = drive([1])
    before = finder.extra_s.copy()
    q = np.full((1, 3), np.nan)
    for k in range(30):
        finder.measured(np.array([(400 + k) * PERIOD]), q, np.zeros(1, dtype=np.bool_))
        finder.commanded(np.full((1, 2), 12.0))
    np.testing.assert_array_equal(finder.extra_s, before)
    # an old stamp, or a measurement that is not finite, is no news either
    finder.measured(np.array([0.0]), np.zeros((1, 3)), np.ones(1, dtype=np.bool_))
    finder.measured(np.array([330 * PERIOD]), q, np.ones(1, dtype=np.bool_))
    np.testing.assert_array_equal(finder.extra_s, before)


def test_the_first_measurement_stands_in_for_others_and_its_stamp_says_nothing() -> None:
    """It arrives at once, stamped as if it had travelled: the true times of a pair are unknown."""
    finder = LatencyFinder(ROBOT, PERIOD, 1, STD)
    wheels, due = np.full((1, 2), 12.0), np.ones(1, dtype=np.bool_)
    finder.roll(wheels)
    step = PERIOD * 12.0 * ROBOT.tractor.wheel_radius_m
    for k in range(20):
        # straight on at constant speed, but for the stamp of the first, three periods wrong
        finder.measured(
            np.array([(k - 3.0 * (k == 0)) * PERIOD]), np.array([[k * step, 0, 0]]), due
        )
        finder.commanded(wheels)
    assert finder.extra_s == 0.0
    np.testing.assert_allclose(finder._score, 0.0, atol=1e-9)
