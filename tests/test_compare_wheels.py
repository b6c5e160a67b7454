"""The analytic model on the wheels' real speeds: against an adaptive solver on the same speeds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from comparisons import TURN, open_loop
from scipy.integrate import solve_ivp

from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.motion import ContactRun, follow_wheels, run_contact
from ttwmr_mj.studies.compare.shooting import shoot

SHORT = ((0.2, 5.0, 5.0), (0.3, 5.6, 3.2))


def shaken(scenario: Scenario) -> ContactRun:
    """A contact run whose wheels are then said to have done something else, wildly."""
    run = run_contact(scenario)
    noise = np.random.default_rng(3).normal(0.0, 0.3, run.physics.wheel_speed_rad_s.shape)
    noise[0] = 0.0  # the run starts as it did
    wheels = run.physics.wheel_speed_rad_s + noise
    return replace(run, physics=replace(run.physics, wheel_speed_rad_s=wheels))


def knots(run: ContactRun) -> tuple[FloatArray, FloatArray]:
    """Times and wheel speeds: each step's end speed in its middle, means at the periods' ends."""
    wheels, step = run.physics.wheel_speed_rad_s, run.scenario.plant.contact.timestep_s
    every = run.scenario.steps_per_period
    times, speeds = [0.0], [wheels[0]]
    for k in range(1, len(wheels)):
        times.append((k - 0.5) * step)
        speeds.append(wheels[k])
        last = k == len(wheels) - 1
        if k % every == 0:
            times.append(k * step)
            speeds.append(wheels[k] if last else 0.5 * (wheels[k] + wheels[k + 1]))
    return np.array(times), np.array(speeds)


def by_adaptive_steps(run: ContactRun) -> FloatArray:
    """(4,) q at the end, by DOP853 from knot to knot, written out anew."""
    robot, z = run.robot, np.append(run.start.q[0], run.start.q_rate[0, 3])
    k, inertia = robot.swing_length_m, robot.swing_inertia_kg_m2
    radius, track = robot.tractor.wheel_radius_m, robot.tractor.track_width_m
    times, wheels = knots(run)
    for begin, end, first, last in zip(times, times[1:], wheels, wheels[1:], strict=False):
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

        z = solve_ivp(rate, (begin, end), z, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    return np.asarray(z[:4])


@pytest.mark.parametrize(
    "hitch", [{}, {"damping_n_m_s_rad": 0.01, "stiffness_n_m_rad": 0.05}], ids=["free", "sprung"]
)
def test_following_is_what_adaptive_steps_find(hitch: dict[str, float]) -> None:
    run = shaken(open_loop(*SHORT, hitch=hitch))
    rows = follow_wheels(run)
    # fourth-order steps of 0.5 ms
    np.testing.assert_allclose(rows.q[-1, 0], by_adaptive_steps(run), rtol=0, atol=1e-10)
    every = run.scenario.steps_per_period
    np.testing.assert_array_equal(
        rows.wheel_speed_rad_s[:, 0], run.physics.wheel_speed_rad_s[::every]
    )
    np.testing.assert_array_equal(rows.wheel_command_rad_s, run.trajectory.wheel_command_rad_s)


def test_a_hitch_with_much_dry_friction_follows_rigidly() -> None:
    rows = follow_wheels(shaken(open_loop(*SHORT, hitch={"coulomb_friction_n_m": 100.0})))
    assert np.ptp(rows.q[:, 0, 2]) > 0.05
    np.testing.assert_allclose(rows.q[..., 3], rows.q[..., 2], rtol=0, atol=1e-15)


def test_the_wheels_turn_as_far_as_in_contact_physics() -> None:
    """MuJoCo turns a wheel by its speed at a step's end times the step."""
    run = run_contact(open_loop(*TURN))
    rows, robot, step = follow_wheels(run), run.robot, run.scenario.plant.contact.timestep_s
    angle = step * run.physics.wheel_speed_rad_s[1:].sum(axis=0)
    turned = robot.tractor.wheel_radius_m / robot.tractor.track_width_m * (angle[0] - angle[1])
    # linear from middle to middle: what differs is the speed's change over half a step at each end
    assert rows.q[-1, 0, 2] - rows.q[0, 0, 2] == pytest.approx(turned, abs=1e-4)


def test_a_smooth_motion_is_shot_without_marching() -> None:
    """A pendulum of 200 stretches whose guess is at rest; one parameter is its strength."""
    asked: list[slice] = []
    variants = 4  # as it is, and each of θ1, θ2, θ̇2 a little different
    strength = np.array([0.1] * variants + [0.1 + 1e-4])[:, None]

    def ends(states: FloatArray, which: slice) -> FloatArray:
        asked.append(which)
        x, y, theta1, theta2, rate = np.moveaxis(states, -1, 0)
        rate = rate - strength * np.sin(theta2)
        x, y = x + 0.1 * np.cos(theta1), y + 0.1 * rate
        return np.stack([x, y, theta1 + 0.1 * rate, theta2 + 0.1 * rate, rate], axis=-1)

    guess = np.zeros((201, 5))
    guess[0] = start = np.array([1.0, 2.0, 0.3, 0.8, 0.0])
    states, slope = shoot(ends, guess, 1)
    assert asked == [slice(None)] * len(asked)
    marched = [np.tile(start, (variants + 1, 1, 1))]
    for _ in range(200):
        marched.append(ends(marched[-1], slice(0)))
    exact = np.array(marched)[:, :, 0]
    np.testing.assert_allclose(states, exact[:, 0], rtol=0, atol=1e-12)
    # in a small step of strength, of 1e-3, differences are curved by as much of themselves
    differences = exact[:, -1] - exact[:, 0]
    np.testing.assert_allclose(slope[..., 0], differences, rtol=0, atol=2e-2 * np.ptp(differences))
