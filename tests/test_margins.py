"""Poles of a loop from its responses, and the margin found between them."""

from __future__ import annotations

import math

import margins
import numpy as np
import pytest
from turning_loop import BLOCKS, NO_RAMPS, moduli, needed_s, realised

from ttwmr_mj.controllers.flatness import BANDWIDTH, FlatnessOptions
from ttwmr_mj.scenario.file import load_scenario

PERIOD_S = 0.033


def test_a_realisation_has_the_poles_of_the_system() -> None:
    rng = np.random.default_rng(1)
    poles = np.array([0.99, 0.95 * np.exp(0.3j), 0.95 * np.exp(-0.3j), -0.6, 0.2])
    basis = rng.standard_normal((5, 5))
    A = np.diag([0.99, 0.0, 0.0, -0.6, 0.2])
    A[1:3, 1:3] = 0.95 * np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    A = np.linalg.solve(basis, A @ basis)
    B, C = rng.standard_normal((5, 7)), rng.standard_normal((8, 5))
    y = np.array([C @ np.linalg.matrix_power(A, k) @ B for k in range(2 * BLOCKS)])
    found = np.linalg.eigvals(realised(y))
    for pole in poles:
        assert np.abs(found - pole).min() < 1e-4  # what is left out has 1e-5 of the response
    assert len(found) == len(poles)


def slowest(name: str, law: str, command_ms: float = 0.0, *, trailer: bool = True) -> float:
    overrides = [
        f"controller={law}",
        "plant.kind=analytic",
        'initial={kind="on_reference"}',
        f"duration_s={needed_s(20.0, PERIOD_S):.1f}",
        f"control.command_latency_s={command_ms / 1e3}",
        "belief.command_latency_s=0",
        NO_RAMPS,
    ]
    return float(moduli(load_scenario(name, overrides), 20.0, trailer=trailer)[0])


def test_law_32_has_the_pole_of_its_equation() -> None:
    """e'' + α2·e' + (α1/α2)·e = 0; that it is sampled moves the slow pole by a per mille of it."""
    rate = 5.0 - math.sqrt(25.0 - 2.5)
    found = slowest("lab_circle", '{kind="lyapunov"}', trailer=False)
    assert math.log(found) / -PERIOD_S == pytest.approx(rate, rel=0.01)


@pytest.mark.slow
def test_flatness_has_the_slowest_pole_of_its_equation() -> None:
    """(D + λ)⁴(D − iω) + κλ(λ + iω)⁴ = 0; sampling and observer move it by 3 %."""
    rate, turn = BANDWIDTH, 1.0
    share = FlatnessOptions().integral_share
    equation = np.polymul(np.poly([-rate] * 4), [1.0, -1j * turn]).astype(complex)
    equation[-1] += share * rate * (rate + 1j * turn) ** 4
    root = np.roots(equation).real.max()
    found = slowest("inverted_trailer", '{kind="flatness"}')
    assert math.log(found) / PERIOD_S == pytest.approx(root, rel=0.05)


def test_the_margin_is_where_the_pole_passes_one() -> None:
    """Law (32), of P alone: e'' = −(α2·e' + (α1/α2)·e) of half a period and the latency before."""
    crossing = math.sqrt(0.5 * (100.0 + math.sqrt(1e4 + 4 * 6.25)))  # |α2·iω + α1/α2| = ω²
    latency_ms = 1e3 * (math.atan2(10.0 * crossing, 2.5) / crossing - 0.5 * PERIOD_S)
    for share, stable in ((0.97, True), (1.03, False)):
        ms = 0.5 * round(2.0 * share * latency_ms)
        found = slowest("lab_circle", '{kind="lyapunov"}', ms, trailer=False)
        assert (found < 1.0) == stable, found


@pytest.mark.parametrize(("limit", "found"), [(-1.0, -1.0), (0.2, 0.0), (22.6, 22.5), (99.0, 64.0)])
def test_largest_is_the_last_multiple_that_is_borne(limit: float, found: float) -> None:
    asked = []

    def borne(ms: float) -> bool:
        asked.append(ms)
        return ms <= limit

    assert margins.largest(borne, step=0.5, march=16.0, highest=64.0) == found
    assert len(asked) <= 8
