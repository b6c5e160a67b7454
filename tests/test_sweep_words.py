"""Numbers of a sweep's report in words."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.results.statistics import Paired, paired
from ttwmr_mj.studies.sweep.answers.words import Shown, compared, numbers
from ttwmr_mj.studies.sweep.words import duration


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([0.591, 0.5914, 0.6], ["0.591", "0.5914", "0.6"]),
        ([-0.04, -1.4e-17, 0.04], ["−0.04", "0", "0.04"]),
        ([0.5, 0.5, 1234.4, 1e-7], ["0.5", "0.5", "1234", "1e−07"]),
        ([], []),
    ],
)
def test_numbers_of_a_scale_can_be_told_apart(values: list[float], told: list[str]) -> None:
    assert numbers(values) == told


@pytest.mark.parametrize(
    ("seconds", "told"),
    [
        (0.034, "0.034 seconds"),
        (9.96, "10 seconds"),
        (42.4, "42 seconds"),
        (99.6, "100 seconds"),
        (119.4, "119 seconds"),
        (120.0, "2 minutes"),
        (9_000.0, "2.5 hours"),
        (1e9, "11574 days"),
    ],
)
def test_a_time_has_no_power_of_ten(seconds: float, told: str) -> None:
    assert duration(seconds) == told


def found(better: int, worse: int, equal: int) -> Paired:
    """Of so many pairs."""
    difference = np.repeat([-1e-3, 1e-3, 0.0], [better, worse, equal])
    none = np.zeros(len(difference), bool)
    return paired(difference, 0.0 * difference, (none, none), np.random.default_rng(1))


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        ((40, 0, 10), "one has a smaller error than two, by 1 mm [1, 1] in the median of 50 pairs"),
        ((0, 40, 10), "two has a smaller error than one, by 1 mm [1, 1] in the median of 50 pairs"),
        ((30, 2, 60), "one and two have the same error in 60 of 92 pairs on the same draws and"),
        ((30, 2, 60), "of the other pairs one has the smaller one in 93.8 % [79.2, 99.2]."),
        ((2, 30, 60), "of the other pairs one has the smaller one in 6.25 % [0.766, 20.8]."),
        ((20, 19, 60), "one and two do not differ measurably in error: 0 mm [0, 0] in the median"),
    ],
)
def test_of_two_variants_it_is_told_what_differs(counts: tuple[int, int, int], told: str) -> None:
    assert told in compared("one", "two", found(*counts), Shown("error", 1e3, "mm"))
