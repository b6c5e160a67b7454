"""Intervals and comparisons of runs of several seeds, against what is known of them exactly."""

from __future__ import annotations

import math

import pytest

from ttwmr_mj.studies.bench.evidence import Outcome, Statistic, better


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
    assert better(one | {6: Outcome(True, 1.0)}, shifted)  # six
    # paired: one is ahead in every world though the worlds differ more than the laws
    worlds = [10.0**i for i in range(10)]
    assert better(runs(*worlds), runs(*[1.1 * error for error in worlds]))
