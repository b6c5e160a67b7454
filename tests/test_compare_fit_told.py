"""Fitted numbers in words."""

from __future__ import annotations

import pytest

from ttwmr_mj.studies.compare.report import _fitted
from ttwmr_mj.studies.compare.text import told_with_ends


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ((0.026, 0.0259997, 0.0260002), ["0.026", "0.0259997", "0.0260002"]),
        ((1.5, 1.5 - 1e-9, 1.5 + 1e-9), ["1.5", "1.499999999", "1.500000001"]),
        ((0.00234938, 0.0, 0.410192), ["0.002349", "0", "0.4102"]),
        ((-3.0, -4.123456, -2.0), ["-3", "-4.123", "-2"]),
        ((0.1, 0.1, 0.1), ["0.1", "0.1", "0.1"]),
    ],
)
def test_an_interval_has_the_digits_that_it_needs(
    numbers: tuple[float, float, float], told: list[str]
) -> None:
    assert told_with_ends(*numbers) == told


def test_the_report_has_them_too() -> None:
    radius = {"value": 0.026, "confidence_95": [0.0259997, 0.0260002], "expected": 0.026}
    fit = {"parameters": {"wheel_radius_m": radius | {"pinned": False, "identified": True}}}
    assert _fitted(fit)[0][1] == ("0.026", 0.026, "[0.0259997, 0.0260002]")
