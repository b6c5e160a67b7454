"""Law (32) and the map of Eq. 27-28: exact where theory is exact, safe where it is singular."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.lyapunov import (
    Lyapunov,
    LyapunovOptions,
    law,
    lyapunov_function,
    singular_term,
)
from ttwmr_mj.controllers.open_loop import OpenLoop, OpenLoopOptions, WheelSegment
from ttwmr_mj.controllers.shared.wheels import AccelerationToWheels
from ttwmr_mj.dynamics.hybrid import acceleration_from_twist
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.nothing import Nothing
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

ROBOT = RobotParameters(servo=Servo(preset="fast"))
# a servo whose acceleration limit a period of 0.1 ms does not meet
QUICK = RobotParameters(servo=Servo(speed_limit_rad_s=100.0, acceleration_limit_rad_s2=1e5))
PERIOD = 0.033


TURNING = np.array([[0.0, 0.0, 1.0, 0.0]])


def estimate(q: np.ndarray, rate: np.ndarray) -> Estimate:
    nsim = len(q)
    return Estimate(RobotState(q, rate), np.zeros(nsim), np.ones(nsim, bool), np.full(nsim, np.nan))


def rolling(theta1: float, speed: float) -> RobotState:
    rate = np.array([[speed * np.cos(theta1), speed * np.sin(theta1), 0.0, 0.0]])
    return RobotState(np.array([[0.0, 0.0, theta1, 0.0]]), rate)


def test_the_map_is_eq_27_28_as_the_period_goes_to_zero() -> None:
    theta1, speed = 0.7, 0.3
    acceleration = np.array([[0.4, -0.25]])
    residuals = []
    for period in (1e-2, 1e-3, 1e-4):
        wheels = AccelerationToWheels(QUICK, period, 1)
        command = wheels.command(acceleration, rolling(theta1, speed))
        assert not command.saturated[0]
        u1, u2 = twist_from_wheels(command.wheel_speed_rad_s, ROBOT)[0]
        surge = np.array([(u1 - speed) / period])
        got = acceleration_from_twist(np.array([theta1]), np.array([[speed, u2]]), surge)
        residuals.append(np.abs(got - acceleration).max())
    # first order in T: each tenth of the period a tenth of the error
    assert residuals[1] / residuals[0] == pytest.approx(0.1, rel=0.1)
    assert residuals[2] < 1e-4


@pytest.mark.parametrize("direction", [0.0, 1.0, 3.0, -2.5])
def test_from_standstill_it_turns_towards_the_acceleration(direction: float) -> None:
    wheels = AccelerationToWheels(ROBOT, PERIOD, 1)
    push = 0.5 * np.array([[np.cos(direction), np.sin(direction)]])
    state, command = rolling(0.0, 0.0), None
    for _ in range(200):  # an ideal robot: it turns exactly as commanded, and stays where it is
        command = wheels.command(push, state)
        _, turn = twist_from_wheels(command.wheel_speed_rad_s, ROBOT)[0]
        state = RobotState(state.q + turn * PERIOD * TURNING, state.q_rate)
        assert np.isfinite(command.wheel_speed_rad_s).all()
    assert np.angle(np.exp(1j * (state.q[0, 2] - direction))) == pytest.approx(0.0, abs=1e-3)
    u1, _ = twist_from_wheels(command.wheel_speed_rad_s, ROBOT)[0]
    assert u1 > 0.3


@pytest.mark.parametrize("direction", [3.0, -2.8])
def test_on_the_spot_it_turns_no_faster_than_it_can_brake(direction: float) -> None:
    """Δ = α·t²/2 and rate = α·t at constant braking: rate² = 2α·Δ."""
    wheels = AccelerationToWheels(ROBOT, PERIOD, 1)
    push = 0.5 * np.array([[np.cos(direction), np.sin(direction)]])
    for _ in range(20):  # the servos get up to speed; the robot is held where it is
        command = wheels.command(push, rolling(0.0, 0.0))
    u1, u2 = twist_from_wheels(command.wheel_speed_rad_s, ROBOT)[0]
    braking = 100.0 * 0.026 / 0.0595
    assert u2 == pytest.approx(np.copysign(np.sqrt(2 * braking * abs(direction)), direction))
    assert u1 == pytest.approx(0.0, abs=1e-12)


def test_nothing_asked_at_rest_gives_nothing() -> None:
    command = AccelerationToWheels(ROBOT, PERIOD, 2).command(
        np.zeros((2, 2)), RobotState.at_rest(1.0, 2.0, 0.3, 0.1, nsim=2)
    )
    assert np.array_equal(command.wheel_speed_rad_s, np.zeros((2, 2)))
    assert command.near_singular.all()
    assert not command.saturated.any()


def test_saturation_is_cut_flagged_and_does_not_wind_up() -> None:
    wheels = AccelerationToWheels(ROBOT, PERIOD, 1)
    state = rolling(0.0, 0.0)
    for _ in range(300):
        command = wheels.command(np.array([[50.0, 0.0]]), state)
        assert command.saturated[0]
        assert np.abs(command.wheel_speed_rad_s).max() <= ROBOT.servo.speed_limit_rad_s
    # one second of braking at 1 m/s² must show at once, not after the excess is worked off
    before = command.wheel_speed_rad_s.copy()
    after = wheels.command(np.array([[-1.0, 0.0]]), state).wheel_speed_rad_s
    assert (before - after) * ROBOT.tractor.wheel_radius_m == pytest.approx(PERIOD, rel=1e-9)


def test_mirrored_wishes_give_mirrored_wheels() -> None:
    rng = np.random.default_rng(3)
    left, right = (AccelerationToWheels(ROBOT, PERIOD, 1) for _ in range(2))
    for _ in range(50):
        push, heading = rng.uniform(-5, 5, (1, 2)), rng.uniform(-3, 3)
        a = left.command(push, rolling(heading, 0.1)).wheel_speed_rad_s
        b = right.command(push * [1, -1], rolling(-heading, 0.1)).wheel_speed_rad_s
        assert np.array_equal(a, b[:, ::-1])


def test_zero_error_is_an_exact_equilibrium_of_the_sampled_loop() -> None:
    """On the circle, wheel speeds of constant difference keep P on the circle: no sampling bias."""
    circle = Circle(radius_m=1.0, angular_rate_rad_s=0.5, theta2="none")
    reference = circle.sample(PERIOD * np.arange(200))
    controller = Lyapunov(LyapunovOptions(kind="lyapunov"))
    controller.start(Task(ROBOT, reference, PERIOD, 1, np.random.default_rng(0)))
    for k in range(150):
        q = np.concatenate([reference.position_m[k], reference.theta1_rad[k][:, None], [[0]]], 1)
        rate = np.concatenate([reference.velocity_m_s[k], [[0.5, 0.0]]], 1)
        command = controller.command(k, estimate(q, rate))
    u1, u2 = twist_from_wheels(command.wheel_speed_rad_s, ROBOT)[0]
    # rounding only: the commanded speed is an integral over 150 samples
    assert u1 == pytest.approx(0.5, abs=1e-9)
    assert u2 == pytest.approx(0.5, abs=1e-9)


def lyapunov_rate(e: np.ndarray, rate: np.ndarray, options: LyapunovOptions) -> np.ndarray:
    """V' of Eq. 34 for one axis."""
    v = law(np.stack([e, e], -1), np.stack([rate, rate], -1), np.zeros((*e.shape, 2)), options)
    return options.alpha1 * e * rate + options.alpha2 * rate * v[..., 0]


def test_v_decreases_as_the_docstring_claims() -> None:
    rng = np.random.default_rng(0)
    e, rate = rng.uniform(-1, 1, (2, 1000))
    omitted = LyapunovOptions(kind="lyapunov")
    bound = -((omitted.alpha2 * rate) ** 2)
    assert lyapunov_rate(e, rate, omitted) == pytest.approx(bound, abs=1e-10)
    regularized = LyapunovOptions(kind="lyapunov", singular_terms="regularized")
    assert (lyapunov_rate(e, rate, regularized) <= bound + 1e-10).all()
    published = LyapunovOptions(kind="lyapunov", singular_terms="published")
    printed = bound - published.alpha1 * e**2  # Eq. 36, which the printed term is there for
    assert lyapunov_rate(e, rate, published) == pytest.approx(printed, rel=1e-9)


def test_v_and_its_claimed_rate_by_hand() -> None:
    options = LyapunovOptions(alpha1=2.0, alpha2=3.0, alpha3=5.0, alpha4=7.0)
    v, claimed = lyapunov_function(np.array([[0.2, -0.1]]), np.array([[0.5, 0.4]]), options)
    assert v == pytest.approx(0.5 * (2 * 0.04 + 3 * 0.25 + 5 * 0.01 + 7 * 0.16))
    assert claimed == pytest.approx(-(2 * 0.04 + 2.25 + 5 * 0.01 + 2.8**2))


def test_a_law_logs_v_and_its_slope() -> None:
    circle = Circle(radius_m=1.0, angular_rate_rad_s=0.5).sample(PERIOD * np.arange(9))
    controller, options = Lyapunov(LyapunovOptions()), LyapunovOptions()
    controller.start(Task(ROBOT, circle, PERIOD, 1, np.random.default_rng(0)))
    values = []
    for k in range(3):
        q, rate = np.full((1, 4), 0.1 * k), np.full((1, 4), 0.2)
        signals = controller.command(k, estimate(q, rate)).signals
        e, e_rate = q[:, :2] - circle.position_m[k], rate[:, :2] - circle.velocity_m_s[k]
        v, claimed = lyapunov_function(e, e_rate, options)
        assert signals["lyapunov_v"] == pytest.approx(v)
        assert signals["lyapunov_v_rate_eq36_1_s"] == pytest.approx(claimed)
        values.append(float(v[0]))
        slope = (values[-1] - values[-2]) / PERIOD if k else np.nan
        assert signals["lyapunov_v_rate_1_s"][0] == pytest.approx(slope, nan_ok=True)


def test_the_published_term_is_singular_and_the_others_are_not() -> None:
    e, rate = np.array([0.1, 0.1, 0.1]), np.array([1e-12, -1e-12, 0.0])
    published = LyapunovOptions(kind="lyapunov", singular_terms="published")
    assert np.abs(singular_term(e, rate, published)[:2]).min() > 1e9
    assert singular_term(e, rate, published)[2] == 0.0
    regularized = LyapunovOptions(kind="lyapunov", singular_terms="regularized")
    assert np.abs(singular_term(e, rate, regularized)).max() < 1e-6
    omitted = LyapunovOptions(kind="lyapunov")
    assert np.array_equal(singular_term(e, rate, omitted), np.zeros(3))


def test_law_32_by_hand() -> None:
    options = LyapunovOptions(kind="lyapunov", singular_terms="published")
    v = law(np.array([0.2, -0.1]), np.array([0.5, 0.4]), np.array([1.0, 2.0]), options)
    # v = v_d − 10·e2 − 2.5·(e1 + e1²/e2)
    assert v == pytest.approx(
        [1 - 5 - 2.5 * (0.2 + 0.04 / 0.5), 2 - 4 - 2.5 * (-0.1 + 0.01 / 0.4)], abs=1e-12
    )


def test_lyapunov_without_reference_is_refused() -> None:
    (fault,) = LyapunovOptions().faults(Nothing(), None)
    assert (
        str(fault) == "reference.kind: got 'none'; controller.kind = 'lyapunov' needs a reference"
    )


def test_open_loop_segments_follow_one_another() -> None:
    segments = (
        WheelSegment(duration_s=3 * PERIOD, wheel_right_rad_s=1.0, wheel_left_rad_s=2.0),
        WheelSegment(duration_s=0.05, wheel_right_rad_s=50.0, wheel_left_rad_s=4.0),
    )
    controller = OpenLoop(OpenLoopOptions(kind="open_loop", segments=segments))
    controller.start(Task(ROBOT, None, PERIOD, 2, np.random.default_rng(0)))
    seen = estimate(np.zeros((2, 4)), np.zeros((2, 4)))
    commands = [controller.command(k, seen) for k in range(8)]
    assert [c.wheel_speed_rad_s[1].tolist() for c in commands] == (
        [[1.0, 2.0]] * 3 + [[50.0, 4.0]] * 2 + [[0.0, 0.0]] * 3
    )
    assert [bool(c.saturated.all()) for c in commands] == [False] * 3 + [True] * 2 + [False] * 3
