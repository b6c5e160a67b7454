"""Derivatives of a package's path that are not those of its motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.references.shared.path import ReferencePath, require_motion
from ttwmr_mj.references.shared.reference import sampled
from ttwmr_mj.scenario.file import shipped_scenarios
from ttwmr_mj.state import FloatArray

SHIPPED = [name for name in shipped_scenarios() if tt.load_scenario(name).reference.kind != "none"]
PERIOD_S = 0.033


def path_of(scenario: tt.Scenario, step_s: float = PERIOD_S) -> ReferencePath:
    time_s = np.arange(0.0, 1.2 * min(scenario.duration_s, 50.0), step_s)
    path = sampled(scenario.reference, time_s, scenario.robot)
    assert path is not None
    return path


def looked_at(path: ReferencePath) -> None:
    require_motion(path, path.time_s, path.theta.shape[-1] - 1)


def along_x(time_s: FloatArray, *orders: FloatArray) -> ReferencePath:
    """P on the x axis; derivatives that are left out are zero."""
    derivatives = np.zeros((len(time_s), 1, 5, 2))
    derivatives[:, 0, : len(orders), 0] = np.stack(orders, axis=1)
    still = np.zeros((len(time_s), 1, 2))
    return ReferencePath(time_s, derivatives, still, still, still)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_references_are_their_own_derivatives(name: str) -> None:
    scenario = tt.load_scenario(name)
    for step_s in (0.001, 0.01, PERIOD_S, 0.1, 0.5):
        looked_at(path_of(scenario, step_s))


@pytest.mark.parametrize("factor", [0.8, 1.2])
@pytest.mark.parametrize("name", SHIPPED)
def test_a_velocity_or_acceleration_of_another_motion_is_refused(name: str, factor: float) -> None:
    path = path_of(tt.load_scenario(name))
    moves = {key: np.ptp(getattr(path, key), axis=0).max() > 0 for key in ("theta", "derivatives")}
    for order in (1, 2):
        wrong = path.derivatives.copy()
        wrong[:, :, order] *= factor
        if order == 1 or np.abs(wrong[:, :, 2]).max() > 1e-6:
            told = (
                rf"derivatives\[:, :, {order}\] is not the rate of derivatives\[:, :, {order - 1}\]"
            )
            with pytest.raises(ValueError, match=told):
                looked_at(replace(path, derivatives=wrong))
    if moves["theta"]:
        with pytest.raises(ValueError, match="theta_rate is not the rate of theta, which from t ="):
            looked_at(replace(path, theta_rate=factor * path.theta_rate))


@pytest.mark.parametrize("order", [3, 4])
def test_higher_derivatives_are_looked_at_where_they_vary_slowly(order: int) -> None:
    path = path_of(tt.load_scenario("outer_circle"))
    for name in ("derivatives", "flat_derivatives"):
        wrong = getattr(path, name).copy()
        wrong[:, :, order] *= 1.2
        with pytest.raises(ValueError, match="is not the rate of"):
            looked_at(replace(path, **{name: wrong}))


def test_no_velocity_is_no_rate_of_what_moves() -> None:
    time_s = np.arange(0.0, 3.0, PERIOD_S)
    with pytest.raises(ValueError, match=r"from t = .* changes by 0.0033, and by its rate would"):
        looked_at(along_x(time_s, 0.1 * time_s))


def test_kinks_jumps_and_few_digits_are_no_fault() -> None:
    time_s = np.arange(0.0, 6.0, PERIOD_S)
    ramp_s, pace = 1.01, 0.1  # between samples: the acceleration jumps, and its rate is zero
    speed = pace * np.minimum(time_s / ramp_s, 1.0)
    way = np.where(time_s < ramp_s, speed * time_s / 2, pace * (time_s - ramp_s / 2))
    acceleration = np.where(time_s < ramp_s, pace / ramp_s, 0.0)
    looked_at(along_x(time_s, way, speed, acceleration))
    back = np.abs(time_s - 2.02)  # there and back, at once
    looked_at(along_x(time_s, pace * back, pace * np.sign(time_s - 2.02)))
    looked_at(along_x(time_s, np.round(pace * time_s, 4), np.full_like(time_s, pace)))
    single = (100.0 + pace * time_s).astype(np.float32).astype(np.float64)
    looked_at(along_x(time_s, single, np.full_like(time_s, pace)))
    looked_at(along_x(time_s[:1], way[:1], speed[:1]))
