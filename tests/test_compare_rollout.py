"""Rollouts at full precision against an adaptive integrator and the analytic plant."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.rollout import WheelHistory, roll_out, servo_history
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import FloatArray, RobotState

ROBOT = RobotParameters(servo=Servo(preset="fast"))


def by_adaptive_steps(
    robot: RobotParameters, start: FloatArray, history: WheelHistory
) -> FloatArray:
    """(4,) q of the first simulation at the end, by DOP853 from knot to knot."""
    k, inertia = robot.swing_length_m, robot.swing_inertia_kg_m2
    radius, track = robot.tractor.wheel_radius_m, robot.tractor.track_width_m
    z = start
    times, wheels = history.time_s[:, 0], history.wheel_speed_rad_s[:, 0]
    for begin, end, first, last in zip(times, times[1:], wheels, wheels[1:], strict=False):
        if end <= begin:
            continue
        slope = (last - first) / (end - begin)

        def rate(
            t: float, z: FloatArray, w: FloatArray = first, s: FloatArray = slope, t0: float = begin
        ) -> list[float]:
            right, left = w + s * (t - t0)
            u1, u2 = 0.5 * radius * (right + left), radius / track * (right - left)
            surge = 0.5 * radius * (s[0] + s[1])
            phi = z[3] - z[2]
            torque = -robot.hitch.stiffness_n_m_rad * phi
            torque -= robot.hitch.damping_n_m_s_rad * (z[4] - u2)
            swing = (u1 * u2 * math.cos(phi) - surge * math.sin(phi)) / k + torque / inertia
            return [u1 * math.cos(z[2]), u1 * math.sin(z[2]), u2, z[4], swing]

        z = solve_ivp(rate, (begin, end), z, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return z[:4]


@pytest.mark.parametrize(
    "hitch",
    [Hitch(), Hitch(damping_n_m_s_rad=0.01, stiffness_n_m_rad=0.05)],
    ids=["free", "sprung"],
)
@pytest.mark.parametrize("nsim", [1, 5])
def test_a_rollout_is_what_adaptive_steps_find(hitch: Hitch, nsim: int) -> None:
    robot = ROBOT.model_copy(update={"hitch": hitch})
    command = np.tile(np.array([[9.0, 11.0], [12.0, 7.0], [-4.0, 6.0]])[:, None], (nsim, 1))
    history = servo_history(np.zeros((nsim, 2)), command, np.array([2.0, 1.5, 1.0]), robot.servo)
    q, q_rate = roll_out(robot, RobotState.at_rest(0.1, 0.2, 0.3, -0.4, nsim), history)
    expected = by_adaptive_steps(robot, np.array([0.1, 0.2, 0.3, -0.4, 0.0]), history)
    np.testing.assert_allclose(q[-1], np.tile(expected, (nsim, 1)), rtol=0, atol=1e-9)
    assert q.shape == q_rate.shape == (10, nsim, 4)


def test_a_rollout_is_what_the_analytic_plant_does() -> None:
    rng = np.random.default_rng(1)
    command = rng.uniform(5.0, 15.0, (40, 3, 2))
    plant = AnalyticPlant(ROBOT, 3, 1e-3, 1e-3)
    for wheels in command:
        plant.advance(wheels, 33)
    history = servo_history(np.zeros((3, 2)), command, np.full(40, 0.033), ROBOT.servo)
    q, q_rate = roll_out(ROBOT, RobotState.at_rest(0.0, 0.0, 0.0, 0.0, 3), history)
    np.testing.assert_allclose(q[-1], plant.state().q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(q_rate[-1], plant.state().q_rate, rtol=0, atol=1e-8)


@pytest.mark.parametrize("nsim", [1, 2])
def test_a_spinning_trailer_is_followed(nsim: int) -> None:
    rate = np.tile([[0.26, 0.0, 0.0, 20.0]], (nsim, 1))
    start = RobotState(q=np.tile([[0.0, 0.0, 0.0, 0.3]], (nsim, 1)), q_rate=rate)
    ends = []
    for knots in (2, 3001):
        time_s = np.linspace(0.0, 3.0, knots)[:, None]
        history = WheelHistory(time_s, np.tile([10.0, 11.0], (knots, nsim, 1)))
        ends.append(roll_out(ROBOT, start, history)[0][-1])
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-8)


def test_finer_knots_on_the_same_lines_change_nothing() -> None:
    coarse = WheelHistory(np.array([[0.0], [2.0]]), np.array([[[4.0, 5.0]], [[6.0, 4.0]]]))
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    fine = WheelHistory(
        2.0 * share,
        (1.0 - share[:, :, None]) * coarse.wheel_speed_rad_s[0]
        + share[:, :, None] * coarse.wheel_speed_rad_s[1],
    )
    start = RobotState.at_rest(0.0, 0.0, 0.0, 0.5)
    one, other = (roll_out(ROBOT, start, history)[0][-1] for history in (coarse, fine))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def test_states_can_be_thinned() -> None:
    rng = np.random.default_rng(2)
    for nsim in (1, 700):  # one block of knots, and several
        command = rng.uniform(5.0, 15.0, (20, nsim, 2))
        history = servo_history(np.zeros((nsim, 2)), command, np.full(20, 0.033), ROBOT.servo)
        start = RobotState.at_rest(0.0, 0.0, 0.0, 0.0, nsim)
        (q, q_rate), (few, few_rate) = (roll_out(ROBOT, start, history, n) for n in (1, 3))
        # blocks end elsewhere, so polynomials do
        np.testing.assert_allclose(few, q[::3], rtol=0, atol=1e-9)
        np.testing.assert_allclose(few_rate, q_rate[::3], rtol=0, atol=1e-8)


def test_dry_friction_is_refused() -> None:
    robot = ROBOT.model_copy(update={"hitch": Hitch(coulomb_friction_n_m=1e-3)})
    history = servo_history(np.zeros((1, 2)), np.ones((1, 1, 2)), np.ones(1), robot.servo)
    with pytest.raises(InputError, match=r"robot\.hitch\.coulomb_friction_n_m"):
        roll_out(robot, RobotState.at_rest(0.0, 0.0, 0.0, 0.0), history)
