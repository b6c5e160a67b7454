"""A floor that slopes: every model swings as a pendulum does, and all of them agree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from ttwmr_mj.dynamics import hybrid, kinematics, kinetics
from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2, Ground
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import Casters, Hitch, RobotParameters
from ttwmr_mj.state import FloatArray, RobotState

PERIOD = 0.033
ROBOT = RobotParameters()
SLOPE = Ground(slope_rad=0.1, downhill_rad=0.7)
RNG = np.random.default_rng(11)
# The trailer hangs downhill behind P: θ2 points uphill.
UPHILL = SLOPE.downhill_rad - np.pi


def test_gravity_leans_downhill_and_keeps_its_size() -> None:
    east = Ground(slope_rad=0.1, downhill_rad=0.0)
    np.testing.assert_allclose(east.gravity_m_s2, [GRAVITY_M_S2 * np.sin(0.1), 0.0])
    size = np.hypot(*SLOPE.gravity_m_s2)
    assert np.hypot(size, SLOPE.normal_gravity_m_s2) == pytest.approx(GRAVITY_M_S2, rel=1e-15)
    # ahead of a heading that looks downhill, to the left of one a quarter turn to its right
    ahead, left = SLOPE.pull(np.array([0.7, 0.7 - 0.5 * np.pi]))
    np.testing.assert_allclose(ahead, [size, 0.0], atol=1e-15)
    np.testing.assert_allclose(left, [0.0, size], atol=1e-15)


def frequency(swing_rad: float) -> float:
    """[rad/s] of a pendulum of length k in the field g·sin(slope), for a swing of any size."""
    small = np.sqrt(np.hypot(*SLOPE.gravity_m_s2) / ROBOT.swing_length_m)
    return float(small * 0.5 * np.pi / ellipk(np.sin(0.5 * swing_rad) ** 2))


@pytest.mark.parametrize("swing_rad", [0.01, 1.2])
def test_beside_a_standing_tractor_the_trailer_is_a_pendulum(swing_rad: float) -> None:
    plant = AnalyticPlant(ROBOT, 1, PERIOD, 0.011, ground=SLOPE)
    plant.reset(RobotState.at_rest(0.1, 0.2, 0.3, UPHILL + swing_rad))
    half_s = np.pi / frequency(swing_rad)
    fine = AnalyticPlant(ROBOT, 1, half_s / 400, 0.011, ground=SLOPE)
    fine.reset(plant.state())
    fine.advance(np.zeros((1, 2)), 400)
    # half a period later it stands on the other side; RK4 errs by (ω·11 ms)^5 a step: 1e-8
    np.testing.assert_allclose(fine.state().q[0], [0.1, 0.2, 0.3, UPHILL - swing_rad], atol=1e-7)
    energy = []
    for _ in range(60):
        plant.advance(np.zeros((1, 2)), 1)
        now = plant.state()
        kinetic = kinetics.kinetic_energy(now.q, now.q_rate, ROBOT)
        com = now.q[:, :2] - ROBOT.trailer.com_offset_m * heading(now.q[:, 3])
        energy.append(kinetic - ROBOT.trailer.mass_kg * com @ SLOPE.gravity_m_s2)
    assert np.ptp(energy) < 1e-8


def heading(angle: FloatArray) -> FloatArray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turning(period: int) -> FloatArray:
    return np.array([[3.0 + np.sin(0.9 * period), 1.0 - np.cos(1.7 * period)]])


@pytest.mark.slow
@pytest.mark.parametrize("hitch", [Hitch(), Hitch(coulomb_friction_n_m=2e-3)])
def test_a_moving_tractor_feels_no_more_than_its_acceleration_less_gravity(hitch: Hitch) -> None:
    """The fine plant against the equation of motion, at the plant's own wheels' speeds."""
    robot = RobotParameters(hitch=hitch)
    fine = AnalyticPlant(robot, 1, PERIOD, PERIOD / 512, ground=SLOPE)
    coarse = AnalyticPlant(robot, 1, PERIOD, 0.011, ground=SLOPE)
    sampled = SampledModel(robot, PERIOD, substep_s=1e-3, ground=SLOPE)
    start = RobotState.at_rest(0.0, 0.0, 0.3, 1.2)
    fine.reset(start)
    coarse.reset(start)
    body, wheels = np.array([[0.0, 0.0, 0.3, 1.2, 0.0]]), np.zeros((1, 2))
    for period in range(40):
        fine.advance(turning(period), 1)
        coarse.advance(turning(period), 1)
        body, wheels = sampled.advance(body, wheels, turning(period))
    exact = fine.state().q[0]
    # fourth order without friction; an error of second order at every stop with it (step² · 8/s²)
    bound = 1e-7 if hitch == Hitch() else 1e-3
    np.testing.assert_allclose(coarse.state().q[0], exact, atol=bound)
    # second order in 1 ms: 1e-6 of angles near 1; sticking is found to one substep
    np.testing.assert_allclose(body[0, :4], exact, atol=1e-5 if hitch == Hitch() else 1e-3)


def test_the_plant_solves_eq_17_with_gravity_taken_off_the_acceleration() -> None:
    plant = AnalyticPlant(ROBOT, 1, 0.5, 1e-3, ground=SLOPE)
    q = np.array([[0.1, 0.2, 0.7, -0.4]])
    twist, swing_rate = np.array([0.1, 1.0]), -0.5  # within the servo's speed
    plant.reset(RobotState(q, kinematics.q_rate(q, np.array([[*twist, swing_rate]]))))
    plant.advance(kinematics.wheels_from_twist(twist[None], ROBOT), 1)

    def slope(time_s: float, y: FloatArray) -> FloatArray:
        theta1 = np.array(0.7 + twist[1] * time_s)
        v = hybrid.acceleration_from_twist(theta1, twist, np.array(0.0)) - SLOPE.gravity_m_s2
        return np.array([y[1], hybrid.trailer_acceleration(y[0], v, ROBOT)])

    exact = solve_ivp(slope, (0.0, 0.5), [-0.4, swing_rate], rtol=1e-11, atol=1e-12).y[:, -1]
    now = plant.state()
    np.testing.assert_allclose([now.q[0, 3], now.q_rate[0, 3]], exact, atol=1e-9)


def test_g_of_q_is_the_gradient_of_the_potential() -> None:
    q = RNG.uniform(-3.0, 3.0, (10, 4))
    tractor, trailer = ROBOT.tractor, ROBOT.trailer

    def potential(at: FloatArray) -> FloatArray:
        nose = at[:, :2] + tractor.com_offset_m * heading(at[:, 2])
        tail = at[:, :2] - trailer.com_offset_m * heading(at[:, 3])
        return -(tractor.mass_kg * nose + trailer.mass_kg * tail) @ SLOPE.gravity_m_s2

    step = 1e-6
    columns = [(potential(q + step * e) - potential(q - step * e)) / (2 * step) for e in np.eye(4)]
    ours = kinetics.gravity(q, SLOPE.gravity_m_s2, ROBOT)
    np.testing.assert_allclose(ours, np.stack(columns, axis=-1), atol=1e-9)


def test_forces_and_lateral_force_balance_with_gravity() -> None:
    q, xi_rate = RNG.uniform(-3, 3, (10, 4)), RNG.uniform(-2, 2, (10, 3))
    force, pull = RNG.normal(size=(10, 2)), SLOPE.gravity_m_s2
    xi = kinetics.forward_acceleration(q, xi_rate, force, 0.0, ROBOT, pull)
    v = hybrid.acceleration_from_twist(q[:, 2], xi_rate[:, :2], xi[:, 0]) - pull
    np.testing.assert_allclose(xi[:, 2], hybrid.trailer_acceleration(q[:, 3], v, ROBOT), rtol=1e-9)
    # a frame that falls with g_p sees a level floor: what the floor must give is less by its share
    level = kinetics.lateral_force(q, xi_rate, xi, ROBOT)
    weight = kinetics.gravity(q, pull, ROBOT)
    expected = level + (kinematics.constraint_matrix(q)[:, 0] * weight).sum(axis=1)
    sloping = kinetics.lateral_force(q, xi_rate, xi, ROBOT, pull)
    np.testing.assert_allclose(sloping, expected, rtol=1e-12)


def contact_and_model(ground: Ground, start: RobotState, periods: int) -> tuple[FloatArray, ...]:
    """q (periods, 4) on contact physics, in the plain model and in the extended one."""
    robot = RobotParameters(casters=Casters(mass_kg=1e-5))
    options = ContactOptions(timestep_s=0.00025, contact_time_constant_s=0.0005)
    expected = ExtendedParameters.expected(robot).model_copy(
        update={"slip_time_s": 0.5 * (0.0005 + 0.00025), "physics_step_s": 0.00025}
    )
    plants = (
        ContactPlant(robot, options, ground=ground),
        AnalyticPlant(robot, 1, 0.00025, 0.011, ground=ground),
        ExtendedPlant(ExtendedModel.of(robot, expected, ground), 1, 0.00025, 0.011),
    )
    paths = []
    for plant in plants:
        plant.reset(start)
        path = []
        for _ in range(periods):
            plant.advance(np.array([[2.0, 1.0]]), 132)
            path.append(plant.state().q[0])
        paths.append(np.array(path))
    return tuple(paths)


@pytest.mark.slow
def test_contact_physics_agrees_with_the_models_on_a_slope() -> None:
    start = RobotState.at_rest(0.0, 0.0, 0.2, 1.0)
    contact, plain, extended = contact_and_model(SLOPE, start, 60)
    level, _, _ = contact_and_model(Ground(), start, 60)
    assert np.abs(contact - level).max(axis=0)[3] > 5.0  # rad, what the slope does
    # the servo's droop downhill is 30 µm/s, 70 µm in 2 s, and turns the robot by 1e-4 rad
    np.testing.assert_allclose(plain[:, :3], contact[:, :3], atol=2e-4)
    np.testing.assert_allclose(plain[:, 3], contact[:, 3], atol=1e-3)
    # which the extended model knows: a hundredth is left
    np.testing.assert_allclose(extended[:, :3], contact[:, :3], atol=2e-6)
    # MuJoCo moves by the speed at a step's end: half a step of 5 rad/s ahead, 6e-4 rad
    np.testing.assert_allclose(extended[:, 3], contact[:, 3], atol=1e-3)
