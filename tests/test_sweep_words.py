"""Numbers of a sweep's report in words."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.results.statistics import Interval, Paired, paired
from ttwmr_mj.studies.sweep.answers.words import Shown, compared, interval_cell, numbers
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
    return paired(difference, 0.0 * difference, (none, none))


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


def test_pairs_without_a_number_are_not_among_those_compared() -> None:
    ours = np.repeat([-1e-3, np.inf], [8, 20])
    theirs, none = np.repeat([0.0, np.inf], [8, 20]), np.zeros(28, bool)
    told = compared("a", "b", paired(ours, theirs, (none, none)), Shown("error", 1e3, "mm"))
    assert told.startswith("a has a smaller error than b, by 1 mm [1, 1] in the median of 8 pairs")


@pytest.mark.parametrize("theirs", [np.nan, np.inf])
def test_where_no_pair_can_be_compared_that_is_told(theirs: float) -> None:
    """What their plant does not have, or none of either got."""
    none = np.zeros(3, bool)
    ours = np.full(3, 2e-3 if np.isnan(theirs) else np.inf)
    told = compared("a", "b", paired(ours, np.full(3, theirs), (none, none)), Shown("e", 1e3, "mm"))
    assert told == "No pair of a and b has a e to compare."


@pytest.mark.parametrize(
    ("found", "cell"),
    [
        (Interval(2.0, -np.inf, np.inf), ("2", 2.0, "")),
        (Interval(np.inf, -np.inf, np.inf), ("∞", np.inf, "")),
        (Interval(np.inf, 3.0, np.inf), ("∞", np.inf, "[3, ∞]")),
        (Interval(2.0, -np.inf, 3.0), ("2", 2.0, "[−∞, 3]")),
        (Interval(np.nan, np.nan, np.nan), ("–", np.inf, "")),
    ],
)
def test_ends_that_are_open_are_no_interval(found: Interval, cell: tuple[str, float, str]) -> None:
    assert interval_cell(found) == cell
