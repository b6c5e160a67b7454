"""Intervals and comparisons of runs of several seeds, against what is known of them exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ttwmr_mj.studies.bench.evidence import (
    Outcome,
    Statistic,
    better,
    median_interval,
    share_interval,
)


def test_the_share_has_the_exact_binomial_interval() -> None:
    assert share_interval(10, 10) == pytest.approx((0.025**0.1, 1.0))
    assert share_interval(0, 10) == pytest.approx((0.0, 1.0 - 0.025**0.1))
    low, high = share_interval(3, 8)

    def at_most(k: int, p: float) -> float:
        return sum(math.comb(8, i) * p**i * (1 - p) ** (8 - i) for i in range(k + 1))

    # at its ends, what was found and what is beyond is just as rare as 2.5 %
    assert 1.0 - at_most(2, low) == pytest.approx(0.025)
    assert at_most(3, high) == pytest.approx(0.025)


@pytest.mark.parametrize(
    ("runs", "place"), [(6, 1), (8, 1), (9, 2), (10, 2), (11, 2), (12, 3), (20, 6), (100, 40)]
)
def test_the_median_lies_between_two_of_the_values(runs: int, place: int) -> None:
    values = np.random.default_rng(0).permutation(np.arange(1.0, runs + 1)).tolist()
    assert median_interval(values) == (place, runs + 1 - place)

    def outside(k: int) -> float:
        return 2.0 * sum(math.comb(runs, i) for i in range(k)) / 2.0**runs

    assert outside(place) <= 0.05 < outside(place + 1)  # the narrowest that will do


@pytest.mark.parametrize("runs", [1, 2, 5])
def test_few_runs_have_no_interval(runs: int) -> None:
    assert median_interval([1.0] * runs) is None


def test_a_number_of_several_runs() -> None:
    assert Statistic.of([0.004], 1e3) == (4.0, None, None, None)
    assert Statistic.of([3.0, 1.0]) == (2.0, None, None, 3.0)
    of_seven = Statistic.of([7.0, 1.0, 2.0, math.inf, 3.0, 5.0, 6.0], 10.0)
    assert of_seven == (50.0, 10.0, math.inf, math.inf)


def runs(*errors: float | None) -> dict[int, Outcome]:
    """Seed → outcome; None did not follow."""
    found = {e: Outcome(e is not None, e if e is not None else 9.0) for e in errors}
    return {seed: found[error] for seed, error in enumerate(errors)}


@pytest.mark.parametrize(
    ("wins", "losses", "ties", "significant"),
    [
        (9, 1, 0, True),  # p = 22/1024
        (8, 2, 0, False),  # p = 112/1024
        (6, 0, 4, True),  # p = 2/64
        (5, 0, 5, False),  # p = 2/32
        (8, 1, 1, True),  # p = 20/512
        (1, 9, 0, False),
        (0, 10, 0, False),
        (0, 0, 10, False),
        (1, 0, 0, False),
    ],
)
def test_better_is_decided_by_an_exact_sign_test(
    wins: int, losses: int, ties: int, significant: bool
) -> None:
    one = runs(*[1.0] * wins, *[3.0] * losses, *[2.0] * ties)
    other = runs(*[2.0] * (wins + losses + ties))
    assert better(one, other) is significant


def test_following_beats_not_following_whatever_the_error() -> None:
    poor, none = runs(*[20.0] * 6), runs(*[None] * 6)
    assert better(poor, none)
    assert not better(none, poor)
    lost = {seed: Outcome(False, float(seed)) for seed in range(10)}
    worse = {seed: Outcome(False, 50.0) for seed in range(10)}
    assert not better(lost, worse)  # two that did not follow are a tie
    unknown = {seed: Outcome(True, math.inf) for seed in range(10)}
    assert not better(unknown, unknown)


def test_only_equal_seeds_are_compared() -> None:
    one = runs(*[1.0] * 6)
    shifted = {seed + 1: outcome for seed, outcome in runs(*[2.0] * 6).items()}
    assert not better(one, shifted)  # five pairs
    # paired: one is ahead in every world though the worlds differ more than the laws
    worlds = [10.0**i for i in range(10)]
    assert better(runs(*worlds), runs(*[1.1 * error for error in worlds]))
