"""Wheel torques as input: Eq. 11-23 forward and back, as a plant, and against contact physics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.kinematics import q_rate, wheels_from_twist
from ttwmr_mj.dynamics.kinetics import forward_acceleration, kinetic_energy
from ttwmr_mj.dynamics.torques import (
    acceleration,
    hitch_torque,
    inverse_dynamics,
    spun_mass_matrix,
    wheel_jacobian,
)
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.kinetic import KineticPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import Casters, Hitch, RobotParameters, Servo
from ttwmr_mj.state import RobotState

RNG = np.random.default_rng(7)
Q, XI = RNG.uniform(-3, 3, (20, 4)), RNG.uniform(-2, 2, (20, 3))
TORQUE = RNG.uniform(-0.2, 0.2, (20, 2))
FREE = RobotParameters()
HITCHED = RobotParameters(
    hitch=Hitch(stiffness_n_m_rad=0.02, damping_n_m_s_rad=1e-3, coulomb_friction_n_m=1e-3)
)
WEIGHTLESS = RobotParameters(  # wheels and rotors without inertia: Table I alone, as Eq. 23 has it
    servo=Servo(reflected_inertia_kg_m2=0.0),
    tractor=FREE.tractor.model_copy(update={"wheel_mass_kg": 1e-12}),
)
SLOPE = Ground(slope_rad=0.1, downhill_rad=2.0)
PERIOD = 0.033


def spin(robot: RobotParameters) -> float:
    return wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2


def energy(q: np.ndarray, rate: np.ndarray, xi: np.ndarray, robot: RobotParameters) -> np.ndarray:
    """Kinetic energy (...) of the robot, its wheels and its rotors [J]."""
    wheels = wheels_from_twist(xi[..., :2], robot)
    return kinetic_energy(q, rate, robot) + 0.5 * spin(robot) * (wheels**2).sum(axis=-1)


UNEQUAL = RobotParameters(
    tractor=FREE.tractor.model_copy(update={"wheel_radius_difference_m": 0.001})
)
RESISTED = RobotParameters(casters=Casters(rolling_resistance_m=1e-4, socket_friction_n_m=1e-4))


def test_the_wheels_of_one_radius_give_f_and_tau() -> None:
    """f = (τ_r + τ_l)/r and τ = b·(τ_r − τ_l)/r, weightless and at rest: SᵀMS·ξ̈ = (f, τ, 0)."""
    change = acceleration(Q, np.zeros((20, 3)), TORQUE, FREE)
    force = np.einsum("kij,kj->ki", spun_mass_matrix(Q, FREE), change)
    radius, (right, left) = FREE.tractor.wheel_radius_m, TORQUE.T
    expected = [(right + left) / radius, FREE.half_track_m * (right - left) / radius, 0 * right]
    np.testing.assert_allclose(force.T, expected, rtol=0, atol=1e-12)


def test_without_spinning_parts_it_is_the_article_s_model() -> None:
    given = acceleration(Q, XI, TORQUE, WEIGHTLESS)
    force = TORQUE @ wheel_jacobian(WEIGHTLESS)
    expected = forward_acceleration(Q, XI, force, 0.0, WEIGHTLESS)
    np.testing.assert_allclose(given, expected, rtol=1e-9)


@pytest.mark.parametrize("robot", [FREE, HITCHED, UNEQUAL, RESISTED])
@pytest.mark.parametrize("ground", [LEVEL, SLOPE], ids=["level", "slope"])
def test_backward_is_the_inverse_of_forward(robot: RobotParameters, ground: Ground) -> None:
    change = acceleration(Q, XI, TORQUE, robot, ground)
    torque = inverse_dynamics(Q, XI, change[:, :2], robot, ground)
    np.testing.assert_allclose(torque, TORQUE, rtol=0, atol=1e-13)


@pytest.mark.parametrize("robot", [HITCHED, UNEQUAL, RESISTED])
def test_the_power_of_all_forces_is_the_change_of_energy(robot: RobotParameters) -> None:
    """Wheels, hitch, balls and gravity: dE/dt by a central difference along the motion."""
    change = acceleration(Q, XI, TORQUE, robot, SLOPE)
    step = 1e-5

    def after(sign: float) -> np.ndarray:
        q = Q + sign * step * q_rate(Q + 0.5 * sign * step * q_rate(Q, XI), XI)
        xi = XI + sign * step * change
        return energy(q, q_rate(q, xi), xi, robot)

    growth = (after(1.0) - after(-1.0)) / (2 * step)
    wheels = (TORQUE * wheels_from_twist(XI[:, :2], robot)).sum(axis=1)
    hitch = hitch_torque(Q, XI, robot)[:, 0] * (XI[:, 2] - XI[:, 1])
    velocity = q_rate(Q, XI)
    masses = robot.tractor.mass_kg, robot.trailer.mass_kg
    weight = np.zeros(len(Q))
    for mass, offset, i in zip(
        masses, (robot.tractor.com_offset_m, -robot.trailer.com_offset_m), (2, 3), strict=True
    ):
        aside = np.stack([-np.sin(Q[:, i]), np.cos(Q[:, i])], axis=-1)
        com_velocity = velocity[:, :2] + offset * velocity[:, i : i + 1] * aside
        weight += mass * com_velocity @ SLOPE.gravity_m_s2
    balls = -power_of_balls(velocity, robot)
    # what is left are the difference's second-order terms
    np.testing.assert_allclose(growth, wheels + hitch + weight + balls, rtol=0, atol=1e-6)


def power_of_balls(velocity: np.ndarray, robot: RobotParameters) -> np.ndarray:
    """(n,) what balls burn: force times speed, of three balls at their places.

    The force is N·δ/ρ + τ/ρ, with the nose's load m1·g·a1/d and half the trailer's weight.
    """
    casters, burnt = robot.casters, np.zeros(len(velocity))
    g = 9.81 * np.cos(SLOPE.slope_rad)
    nose = robot.tractor.mass_kg * g * robot.tractor.com_offset_m / casters.tractor_position_m
    tail, spacing = 0.5 * robot.trailer.mass_kg * g, casters.trailer_half_spacing_m
    behind = -robot.trailer.com_offset_m
    for load, i, ahead, left in (
        (nose, 2, casters.tractor_position_m, 0.0),
        (tail, 3, behind, spacing),
        (tail, 3, behind, -spacing),
    ):
        cos, sin = np.cos(Q[:, i]), np.sin(Q[:, i])
        arm = np.stack([cos * ahead - sin * left, sin * ahead + cos * left], axis=-1)
        speed = velocity[:, :2] + velocity[:, i : i + 1] * arm[:, ::-1] * [-1.0, 1.0]
        force = (
            load * casters.rolling_resistance_m + casters.socket_friction_n_m
        ) / casters.radius_m
        burnt += force * np.hypot(*speed.T)
    return burnt


def test_hitch_friction_opposes_and_the_spring_pulls_back() -> None:
    q, xi = np.array([0.0, 0.0, 0.1, 0.4]), np.array([0.0, 0.2, 0.7])
    expected = -0.02 * 0.3 - 1e-3 * 0.5 - 1e-3
    assert float(hitch_torque(q, xi, HITCHED)[0]) == pytest.approx(expected, rel=1e-12)


# --- as a plant ------------------------------------------------------------------------------


def kinetic(robot: RobotParameters, nsim: int = 1, longest_s: float = 0.011) -> KineticPlant:
    plant = KineticPlant(robot, nsim, PERIOD, longest_s)
    plant.reset(RobotState.at_rest(0.1, -0.2, 0.3, 0.5, nsim))
    return plant


def test_straight_ahead_it_accelerates_as_newton_says() -> None:
    plant = KineticPlant(FREE, 1, PERIOD, 0.011)
    plant.advance(np.full((1, 2), 0.01), 10)
    radius = FREE.tractor.wheel_radius_m
    mass = FREE.tractor.mass_kg + FREE.trailer.mass_kg + 2 * spin(FREE) / radius**2
    speed = 2 * 0.01 / radius / mass * 10 * PERIOD
    state = plant.state()
    np.testing.assert_allclose(state.q_rate[0], [speed, 0, 0, 0], rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(state.q[0, 0], 0.5 * speed * 10 * PERIOD, rtol=1e-12)
    np.testing.assert_allclose(plant.wheel_speed_rad_s()[0], speed / radius, rtol=1e-12)


def test_torques_beyond_stall_count_as_stall() -> None:
    plants = [kinetic(FREE), kinetic(FREE)]
    for plant, torque in zip(plants, (99.0, FREE.servo.stall_torque_n_m), strict=True):
        plant.advance(np.array([[torque, -torque]]), 1)
    assert np.array_equal(plants[0].state().q, plants[1].state().q)


@pytest.mark.slow
def test_the_error_of_a_step_is_of_fourth_order() -> None:
    ends = []
    for divisor in (1, 2, 4, 32):
        plant = kinetic(FREE, longest_s=PERIOD / divisor)
        for k in range(30):
            plant.advance(np.array([[0.02 * np.cos(k), 0.02 * np.sin(k)]]), 1)
        ends.append(plant.state().q)
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert np.log2(errors[0] / errors[1]) > 3.5
    assert np.log2(errors[1] / errors[2]) > 3.5


def test_a_stiff_hitch_is_integrated_stably() -> None:
    """At 33 ms the damper's own rate times the step is 30: a step of that length would explode."""
    stiff = RobotParameters(hitch=Hitch(stiffness_n_m_rad=5.0, damping_n_m_s_rad=3.0))
    plant = kinetic(stiff, longest_s=PERIOD)
    for _ in range(60):
        plant.advance(np.array([[0.01, 0.012]]), 1)
    state = plant.state()
    assert abs(state.hitch_angle_rad[0]) < 0.01


@pytest.mark.parametrize(
    "changes",
    [
        {"hitch": Hitch(coulomb_friction_n_m=1000.0)},
        {"casters": Casters(rolling_resistance_m=0.1)},
        {"hitch": Hitch(damping_n_m_s_rad=1e4)},
    ],
)
def test_steps_too_short_to_be_taken_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"need steps of .* s .*allowed: at least 5e-05 s"):
        kinetic(RobotParameters(**changes))


def test_rows_of_a_batch_and_mirrored_torques() -> None:
    mirror, command = [1, -1, -1, -1], np.array([[0.03, -0.01], [-0.01, 0.03]])
    plant = KineticPlant(HITCHED, 2, PERIOD, 0.011)
    alone = KineticPlant(HITCHED, 1, PERIOD, 0.011)
    for _ in range(20):
        plant.advance(command, 1)
        alone.advance(command[1:], 1)
    q = plant.state().q
    assert abs(q[0, 2]) > 0.1
    assert np.array_equal(q[0], q[1] * mirror)
    assert np.array_equal(alone.state().q[0], q[1])


def test_contact_physics_obeys_the_kinetic_model() -> None:
    """Under one history of torques, over 2 s and 0.6 m, with balls too light to matter."""
    robot = RobotParameters(hitch=Hitch(damping_n_m_s_rad=1e-3), casters=Casters(mass_kg=1e-5))
    start = RobotState.at_rest(0.1, -0.2, 0.3, 0.5)
    contact = ContactPlant(robot, ContactOptions(), torque_input=True)
    model = KineticPlant(robot, 1, PERIOD, 0.011)
    contact.reset(start)
    model.reset(start)
    for k in range(60):
        torque = np.array([[0.012 * np.cos(0.03 * k), 0.01 * np.cos(0.035 * k)]])
        contact.advance(torque, 66)
        model.advance(torque, 1)
    off = contact.state().q[0] - model.state().q[0]
    moved = model.state().q[0] - start.q[0]
    assert np.hypot(*moved[:2]) > 0.3
    assert abs(moved[2]) > 0.3
    # measured 0.04 mm and 0.2 mrad; contact compliance creeps, explicit steps lead by half a step
    assert np.hypot(*off[:2]) < 2e-4
    assert np.abs(off[2:]).max() < 1e-3


def test_a_driven_wheel_of_contact_physics_is_cut_at_stall() -> None:
    plant = ContactPlant(FREE, ContactOptions(), torque_input=True)
    limits = plant.model.actuator_forcerange
    assert np.array_equal(limits, np.tile([-1.62, 1.62], (2, 1)))
    assert not plant.model.actuator_biasprm[:, :3].any()


def test_the_spun_mass_matrix_is_the_kinetic_energy() -> None:
    form = 0.5 * np.einsum("ki,kij,kj->k", XI, spun_mass_matrix(Q, FREE), XI)
    np.testing.assert_allclose(form, energy(Q, q_rate(Q, XI), XI, FREE), rtol=1e-12)
