"""The flatness-based law at one sample, and ways back, against their equations."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.controllers.flatness import Flatness, FlatnessOptions
from ttwmr_mj.controllers.shared.transition import WaysBack
from ttwmr_mj.dynamics.flatness import motion_from_flat, trailer_axes
from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

PERIOD = 0.033
HITCH = Hitch(stiffness_n_m_rad=0.004, damping_n_m_s_rad=0.003, coulomb_friction_n_m=1e-3)
ROBOT = RobotParameters(servo=Servo(preset="fast"), hitch=HITCH)
K, J = ROBOT.swing_length_m, ROBOT.swing_inertia_kg_m2
LAMBDA, KAPPA = 2.3, 0.2  # unlike 2: 2² is 2·2


def path(side: str = "outside", rate: float = 0.8, samples: int = 200) -> ReferencePath:
    circle = FlatCircle(radius_m=0.6, angular_rate_rad_s=rate, side=side)  # type: ignore[arg-type]
    return circle.sample(PERIOD * np.arange(samples), ROBOT)


def asked(law: Flatness, q: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The acceleration of P (2,) that the law hands to the wheel map at the first sample."""
    found, to_wheels = [], law._wheels.command

    def spy(acceleration: np.ndarray, state: RobotState) -> Command:
        found.append(acceleration[0])
        return to_wheels(acceleration, state)

    law._wheels.command = spy  # type: ignore[method-assign]
    state, still = RobotState(q, rate), np.zeros(1)
    law.command(0, Estimate(state, still, np.ones(1, bool), still))
    return found[0]


@pytest.mark.parametrize("side", ["outside", "inside"])
def test_one_sample_is_the_choice_of_the_docstring(side: str) -> None:
    """F'''' = s for the hitch that is believed in, and P'' is its mean over the period."""
    reference = path(side)
    law = Flatness(FlatnessOptions(bandwidth_per_s=LAMBDA, integral_share=KAPPA, recovery="own"))
    law.start(Task(ROBOT, reference, PERIOD, 1, np.random.default_rng(0)))
    a = float(law._along[0])
    assert abs(a) == pytest.approx(0.6 * 0.8**2, rel=1e-9)  # centripetal
    assert law._along_rate[0] == pytest.approx(0.0, abs=1e-12)
    q = reference.q[0] + [[0.004, -0.003, 0.02, -0.03]]
    rate = reference.q_rate[0] + [[0.0, 0.0, 0.02, 0.05]]
    heading = np.array([np.cos(q[0, 2]), np.sin(q[0, 2])])
    rate[0, :2] = velocity = 0.35 * heading  # the wheels roll: nothing for the observer to correct
    a_rate = 0.1
    law._along_rate[:] = a_rate
    acceleration = asked(law, q, rate)

    theta2, swing = q[0, 3], rate[0, 3]
    slide = swing - rate[0, 2]
    torque = -0.004 * (theta2 - q[0, 2]) - 0.003 * slide - 1e-3 * slide / np.hypot(slide, 0.05)
    d = torque / J
    t, n = (axis[0] for axis in trailer_axes(q[:, 3]))
    F = np.array(
        [
            q[0, :2] - K * t,
            velocity - K * swing * n,
            a * t - K * d * n,
            (a_rate + K * d * swing) * t + a * swing * n,
        ]
    )
    flat = reference.flat_derivatives
    assert flat is not None
    e = F - flat[0, 0, :4]
    chain = np.poly([-LAMBDA] * 4)  # 1, 4λ, 6λ², 4λ³, λ⁴
    s = flat[0, 0, 4] - chain[1] * e[3] - chain[2] * e[2] - chain[3] * e[1] - chain[4] * e[0]
    t0, n0 = t, n
    acceleration2 = (s @ n - 2 * a_rate * swing - K * d * swing**2) / a
    bend = s @ t + a * swing**2 - K * d * acceleration2
    mean = np.polynomial.Polynomial([a, a_rate, 0.5 * bend]).integ()(PERIOD) / PERIOD
    t, n = (axis[0] for axis in trailer_axes(q[:, 3] + 0.5 * PERIOD * swing))
    expected = (mean - K * swing**2) * t + K * (acceleration2 - d) * n
    assert acceleration == pytest.approx(expected, abs=1e-9)
    chain = (law._along[0], law._along_rate[0])
    error = e[0] @ t0 + 1j * (e[0] @ n0)
    if side == "outside":
        moved = (a + PERIOD * a_rate + 0.5 * PERIOD**2 * bend, a_rate + PERIOD * bend)
        assert chain == pytest.approx(moved, abs=1e-9)
        assert law._integral[0] == pytest.approx(PERIOD * KAPPA * LAMBDA * error, abs=1e-12)
    else:  # a wheel was cut: what P really does counts, and nothing winds up
        after = law._observer._past[-1]
        change = law._velocity(after)[0] - velocity
        middle = trailer_axes(0.5 * (q[:, 3] + after.body[:, 3]))[0][0]
        possible = change @ middle / PERIOD + K * after.body[0, 4] ** 2
        assert chain == pytest.approx((possible, 0.0), abs=1e-9)
        assert law._integral[0] == 0.0


@pytest.mark.slow
def test_the_integral_acts_in_the_trailers_frame() -> None:
    """(λ + iω)⁴·ξ·τ, beside what the same sample asks for without."""
    reference = path()
    found = []
    for integral in (0.0, 1e-3 - 2e-3j):
        law = Flatness(FlatnessOptions(bandwidth_per_s=LAMBDA))
        law.start(Task(ROBOT, reference, PERIOD, 1, np.random.default_rng(0)))
        law._integral[:] = integral
        found.append(asked(law, reference.q[0], reference.q_rate[0]))
    theta2, a = reference.theta2_rad[0, 0], 0.6 * 0.8**2
    s = -((LAMBDA + 0.8j) ** 4) * (1e-3 - 2e-3j)  # in the trailer's frame
    mean = PERIOD**2 / 6.0 * (s.real - K * 0.0) + 1j * K * s.imag / a
    turned = mean * np.exp(1j * (theta2 + 0.5 * PERIOD * 0.8))
    friction = PERIOD**2 / 6.0 * K * 10.0 * abs(s.imag) / a  # d, which bends a'' a little
    change = found[1] - found[0]
    assert complex(*change) == pytest.approx(turned, abs=friction)


def test_a_new_way_sets_the_chain_and_none_leaves_it(monkeypatch: pytest.MonkeyPatch) -> None:
    reference = path()
    law = Flatness(FlatnessOptions())
    law.start(Task(ROBOT, reference, PERIOD, 1, np.random.default_rng(0)))
    monkeypatch.setattr(law._ways, "wanted", lambda *_: np.ones(1, bool))
    state = RobotState(reference.q[0], reference.q_rate[0])
    now = law._observer.update(Estimate(state, np.zeros(1), np.ones(1, bool), np.zeros(1)))
    for start in (None, (np.array([0.7]), np.array([0.2]))):
        before = (law._along[0], law._along_rate[0])
        monkeypatch.setattr(law._ways, "choose", lambda *_, start=start: start)
        law._change_way(0, now)
        after = (law._along[0], law._along_rate[0])
        assert after == (before if start is None else (0.7, 0.2))


def ways(rate: float, samples: int = 400) -> tuple[WaysBack, ReferencePath]:
    reference = path(rate=rate, samples=samples)
    flat = reference.flat_derivatives
    assert flat is not None
    least = np.full((samples, 1), 0.3 * 0.6 * rate**2)
    return WaysBack(flat, least, 1.0, abs(rate), ROBOT, PERIOD, 1), reference


def chosen(
    found: WaysBack, reference: ReferencePath, offset: list[float], wheels: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray] | None]:
    body = np.column_stack([reference.q[0], reference.q_rate[0, :, 3:]]) + [offset]
    one = np.ones(1, dtype=np.bool_)
    return body, found.choose(0, one, body, reference.velocity_m_s[0], wheels, np.zeros((1, 2)))


@pytest.mark.parametrize("rate", [0.8, -0.7])
def test_a_way_starts_where_the_robot_is_and_keeps_the_limits(rate: float) -> None:
    """Start near enough that there is a way: at every sample of it the servos can follow."""
    found, reference = ways(rate)
    wheels = wheels_from_twist(np.array([[(0.6 - K) * abs(rate), rate]]), ROBOT)
    body, start = chosen(found, reference, [0.05, -0.03, 0.02, 0.1, 0.05], wheels)
    assert start is not None
    a, a_rate = (float(value[0]) for value in start)
    t, n = (axis[0] for axis in trailer_axes(body[:, 3]))
    swing, velocity = body[0, 4], reference.velocity_m_s[0, 0]
    begun = found.reference(0)[0]
    assert begun[0] == pytest.approx(body[0, :2] - K * t, abs=1e-12)
    assert begun[1] == pytest.approx(velocity - K * swing * n, abs=1e-12)
    assert begun[2] == pytest.approx(a * t, abs=1e-12)
    assert begun[3] == pytest.approx(a_rate * t + a * swing * n, abs=1e-12)

    steps = round(float(found._duration[0]) / PERIOD)
    way = np.stack([found.reference(k)[0] for k in range(steps + 3)])
    assert np.array_equal(way[steps:], found._flat[steps : steps + 3, 0])
    motion = motion_from_flat(way, 1.0, ROBOT)
    speeds = wheels_from_twist(motion.twist, ROBOT)
    servo = ROBOT.servo
    assert np.abs(speeds).max() <= 0.95 * servo.speed_limit_rad_s
    change = np.abs(np.diff(speeds, axis=0)).max() / PERIOD
    # some ways are examined at every second sample only: a little more in between
    assert change <= 1.05 * 0.95 * servo.acceleration_limit_rad_s2
    assert motion.along.min() >= 0.3 * 0.6 * rate**2 * 0.99


def test_strain_is_what_the_reference_itself_takes() -> None:
    """Without error the way is the circle, and all is known by hand."""
    rate = 0.8
    found, _ = ways(rate)
    outer = ((0.6 - K) * rate + ROBOT.half_track_m * rate) / ROBOT.tractor.wheel_radius_m
    inner = ((0.6 - K) * rate - ROBOT.half_track_m * rate) / ROBOT.tractor.wheel_radius_m
    still, duration = np.zeros((1, 1, 4, 2)), np.array([1.0])

    def strain(wheels: list[float]) -> float:
        value, away = found._strain(0, still, duration, np.array([wheels]), np.zeros((1, 2)))
        assert away[0, 0] == 0.0
        return float(value[0, 0])

    assert strain([outer, inner]) == pytest.approx(max(outer / (0.95 * 40.0), 0.3), rel=1e-9)
    # a jump of the setpoints has two periods
    jump = 9.0
    expected = jump / (2 * PERIOD) / (0.95 * 100.0)
    assert strain([outer - jump, inner]) == pytest.approx(expected, rel=1e-9)
    aside = np.zeros((1, 1, 4, 2))
    aside[0, 0, 0] = [0.03, -0.04]
    _, away = found._strain(0, aside, duration, np.array([[outer, inner]]), np.zeros((1, 2)))
    assert away[0, 0] == pytest.approx(0.05, rel=1e-12)  # it only comes nearer


def test_near_the_end_of_the_reference_there_is_no_way() -> None:
    found, reference = ways(0.8, samples=20)
    _, start = chosen(found, reference, [0.05, 0.0, 0.0, 0.0, 0.0], np.zeros((1, 2)))
    assert start is None


def test_slow_and_crossing_references_are_refused() -> None:
    options, circle = FlatnessOptions(), FlatCircle(radius_m=0.6, angular_rate_rad_s=0.05)
    slow = {rate: FlatCircle(radius_m=0.6, angular_rate_rad_s=rate) for rate in (0.042, 0.04)}
    paths = {rate: circle.sample(np.arange(9.0), ROBOT) for rate, circle in slow.items()}
    assert options.faults(circle, paths[0.042]) == []  # 1.06e-3 m/s²
    (fault,) = options.faults(circle, paths[0.04])  # 0.96e-3 m/s²
    assert "(0.001 m/s²); controller.kind = 'flatness' needs at least 0.001" in str(fault)
    crossing = path()
    flat = crossing.flat_derivatives
    assert flat is not None
    flat[50:, :, 2] *= -1.0
    (fault,) = options.faults(circle, crossing)
    assert "hardly accelerates" in str(fault)
