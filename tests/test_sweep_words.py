"""Numbers of a sweep's report in words."""

from __future__ import annotations

import pytest

from ttwmr_mj.studies.sweep.answers.words import numbers


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
