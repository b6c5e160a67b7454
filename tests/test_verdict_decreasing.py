"""What the verdict says of errors that were still decreasing, and of those that were not."""

from __future__ import annotations

import numpy as np
import pytest
from test_verdict import TIME_S, WIDE, still, verdict

import ttwmr_mj as tt
from ttwmr_mj.state import FloatArray


def off(error_m: FloatArray) -> str:
    """The verdict on a run whose P is that far (n,) from its reference."""
    rows = still()
    rows.q[:, 0, 0] = error_m
    return str(verdict(rows, transient_tractor_m=9.0))


def test_a_run_that_was_too_short_is_said_to_have_been_decreasing() -> None:
    assert off(np.linspace(0.3, 0.1, 101)) == (
        "lost: P 140 mm off and still decreasing in the last fifth of the run (limit 50 mm)"
    )


@pytest.mark.parametrize(
    ("error_m", "said"),
    [
        (0.1 * np.exp(-0.02 * TIME_S), False),  # by 4 % from fifth to fifth
        (0.1 * np.exp(-0.03 * TIME_S), True),  # by 6 %
        (9.0 * np.exp(-0.5 * TIME_S), True),
        (0.06 + 0.5 * np.exp(-1.0 * TIME_S), False),  # which has come to rest at 60 mm
        (0.3 * np.abs(np.cos(5.0 * TIME_S)) * np.exp(-0.15 * TIME_S), True),  # a swing dies away
        (0.1 * np.exp(0.02 * TIME_S), False),
        (np.where(TIME_S < 2.0, 0.2, 0.5 - 0.04 * TIME_S), True),  # since a push at 2 s
        (np.where(TIME_S < 8.0, 0.1, 0.26 - 0.02 * TIME_S), False),  # for a fifth alone
    ],
)
def test_decreasing_is_what_falls_from_fifth_to_fifth(error_m: FloatArray, said: bool) -> None:
    assert ("and still decreasing" in off(error_m)) == said


@pytest.mark.parametrize("period_s", [0.5, 1.3, 2.0, 3.1, 4.0, 5.0, 7.0, 10.0])
def test_an_oscillation_that_does_not_decay_is_not_decreasing_at_any_phase(period_s: float) -> None:
    for phase in np.linspace(0.0, 2.0 * np.pi, 25):
        wave = np.cos(2.0 * np.pi / period_s * TIME_S + phase)
        assert "decreasing" not in off(0.1 + 0.03 * wave)
        assert "decreasing" not in off(0.1 * np.abs(wave))


def test_noise_on_a_constant_error_is_not_decreasing() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        assert "decreasing" not in off(0.1 + 0.005 * rng.standard_normal(TIME_S.size))


def test_an_error_that_is_not_defined_throughout_is_not_decreasing() -> None:
    rows = still()
    rows.q[:, 0, 3] = np.linspace(1.4, 0.5, 101)
    assert "decreasing" in str(verdict(rows, **WIDE))
    rows.ref_q[30, 0, 3] = np.nan
    assert "decreasing" not in str(verdict(rows, **WIDE))


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
def test_a_run_of_a_few_samples_has_no_trend(samples: int) -> None:
    rows = tt.Trajectory.empty(TIME_S[:samples], nsim=1)
    rows.q[:], rows.ref_q[:], rows.est_q[:] = 0.0, 0.0, 0.0
    rows.q[:, 0, 0] = np.linspace(0.3, 0.1, samples)
    assert "decreasing" not in str(verdict(rows))
