"""Servo ramps, their stretches, and the integrator: against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.servo import arrival_s, cut, ramp, ramp_and_angle
from ttwmr_mj.robot import Servo
from ttwmr_mj.state import FloatArray

SERVO = Servo(preset="lab")  # 6.5 rad/s, 50 rad/s²
START = np.array([[1.0, -2.0], [0.0, 3.0]])
COMMAND = np.array([[2.0, -2.5], [9.0, 3.0]])  # beyond the limit, and nothing to do
PERIOD = 0.033


def test_a_ramp_arrives_when_it_should_and_never_beyond_the_limit() -> None:
    arrival = arrival_s(np.array([[1.0, -0.5], [6.5, 0.0]]), SERVO)
    np.testing.assert_allclose(arrival, [[0.02, 0.01], [0.13, 0.0]], rtol=1e-15)
    speeds = ramp(START, COMMAND, SERVO, np.array([0.005, 0.02, 1.0]))
    np.testing.assert_allclose(speeds[0], [[1.25, -2.25], [2.0, -2.5], [2.0, -2.5]], rtol=1e-15)
    np.testing.assert_allclose(speeds[1], [[0.25, 3.0], [1.0, 3.0], [6.5, 3.0]], rtol=1e-15)


@pytest.mark.parametrize("change", [0.8, -0.8, 0.0])
@pytest.mark.parametrize("time_s", [0.01, 0.03])  # before and after it arrives
def test_the_angle_is_the_integral_of_the_ramp(change: float, time_s: float) -> None:
    def moved(t: float) -> float:
        return float(ramp_and_angle(np.array(change), SERVO, t)[0])

    start, goal = np.zeros((1, 2)), np.array([[change, 0.0]])
    by_ramp = ramp(start, goal, SERVO, np.array([time_s]))[0, 0, 0]
    assert moved(time_s) == pytest.approx(by_ramp, abs=1e-15)
    area = quad(moved, 0.0, time_s, points=[min(0.016, time_s)])[0]
    angle = ramp_and_angle(np.array(change), SERVO, time_s)[1]
    assert float(angle) == pytest.approx(area, abs=1e-12)


def test_stretches_follow_the_ramp_without_a_gap() -> None:
    stretches = cut(START, COMMAND, SERVO, PERIOD, 0.011)
    ends = np.cumsum(stretches.duration_s, axis=0)
    np.testing.assert_allclose(ends[-1], PERIOD, rtol=1e-15)
    assert stretches.duration_s.max() <= 0.011 * (1 + 1e-12)
    for i in range(2):
        begins = ends[:, i] - stretches.duration_s[:, i]
        expected = ramp(START[[i]], COMMAND[[i]], SERVO, begins)[0]
        np.testing.assert_allclose(stretches.speed_rad_s[:, i], expected, rtol=0, atol=1e-14)
        after = expected + stretches.duration_s[:, [i]] * stretches.rate_rad_s2[:, i]
        expected = ramp(START[[i]], COMMAND[[i]], SERVO, ends[:, i])[0]
        np.testing.assert_allclose(after, expected, rtol=0, atol=1e-14)
    assert set(np.unique(stretches.rate_rad_s2)) == {-50.0, 0.0, 50.0}
    np.testing.assert_array_equal(stretches.lead_s, 0.0)


def test_a_stretch_of_no_length_is_left_out_if_it_has_none_in_any_simulation() -> None:
    still = cut(START, START, SERVO, PERIOD, 0.011)
    assert len(still.duration_s) == 5  # both wheels have arrived at once
    np.testing.assert_allclose(still.lasting.duration_s, 0.011, rtol=1e-12)
    assert len(still.lasting.duration_s) == 3


def test_steps_of_physics_lead_a_ramp_by_half_of_what_they_still_have() -> None:
    # 0.8 rad/s take 16 ms: three steps of 5 ms, and 1 ms of the fourth
    goal = np.array([[0.8, 0.0]])
    stretches = cut(np.zeros((1, 2)), goal, SERVO, PERIOD, 1.0, physics_step_s=0.005).lasting
    begins = np.cumsum(stretches.duration_s[:, 0]) - stretches.duration_s[:, 0]
    np.testing.assert_allclose(begins, [0.0, 0.015, 0.016], rtol=1e-12)
    np.testing.assert_allclose(stretches.lead_s[:2, 0, 0], [0.0025, 0.0005], rtol=1e-9)
    # MuJoCo moves each step at the speed of its end: the angles of both are the same
    ends = np.array([0.005, 0.01, 0.015, 0.02])
    stepped = 0.005 * ramp(np.zeros((1, 2)), goal, SERVO, ends)[0, :, 0].sum()
    led = stretches.speed_rad_s + stretches.lead_s * stretches.rate_rad_s2
    led += 0.5 * stretches.duration_s[..., None] * stretches.rate_rad_s2
    smooth = (stretches.duration_s[:2, 0] * led[:2, 0, 0]).sum() + 0.8 * (0.02 - 0.016)
    assert smooth == pytest.approx(stepped, rel=1e-9)


def test_runge_kutta_is_exact_for_cubic_rates_and_of_fourth_order() -> None:
    def cubic(share: float, state: FloatArray) -> FloatArray:
        return np.full_like(state, 4.0 * share**3)

    np.testing.assert_allclose(runge_kutta(cubic, np.zeros((1, 2)), 1.0), 1.0, rtol=1e-15)

    def oscillator(_: float, state: FloatArray) -> FloatArray:
        return np.stack([state[1], -state[0]])

    errors = []
    for count in (10, 20):
        state, step = np.array([[1.0, 1.0], [0.0, 0.0]]), np.array([1.0 / count, 0.0])
        for _ in range(count):
            state = runge_kutta(oscillator, state, step)
        errors.append(abs(float(state[0, 0]) - np.cos(1.0)))
        np.testing.assert_array_equal(state[:, 1], [1.0, 0.0])  # no time, no change
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
