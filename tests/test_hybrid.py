import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ttwmr_mj.dynamics import flatness, hitch, hybrid, kinematics, kinetics
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import RobotState

ROBOT = RobotParameters()
SPRUNG = RobotParameters(hitch=Hitch(stiffness_n_m_rad=0.2, damping_n_m_s_rad=0.01))
RNG = np.random.default_rng(3)
N = 20


def random_z_and_v() -> tuple[np.ndarray, np.ndarray]:
    return RNG.uniform(-2, 2, (N, 6)), RNG.uniform(-2, 2, (N, 2))


@pytest.mark.parametrize("robot", [ROBOT, SPRUNG])
def test_trailer_obeys_the_kinetic_model_when_the_tractor_moves_alike(
    robot: RobotParameters,
) -> None:
    q, xi_rate = RNG.uniform(-3, 3, (N, 4)), RNG.uniform(-2, 2, (N, 3))
    torque = hitch.spring_damper_torque(
        q[:, 3] - q[:, 2], xi_rate[:, 2] - xi_rate[:, 1], robot.hitch
    )
    full = kinetics.forward_acceleration(q, xi_rate, RNG.normal(size=(N, 2)), torque, robot)
    v = hybrid.acceleration_from_twist(q[:, 2], xi_rate[:, :2], full[:, 0])
    ours = hybrid.trailer_acceleration(q[:, 3], v, robot, torque)
    np.testing.assert_allclose(ours, full[:, 2], rtol=1e-12, atol=1e-12)


def test_acceleration_from_twist_is_the_derivative_of_the_velocity() -> None:
    theta1, twist, surge = RNG.normal(size=N), RNG.normal(size=(N, 2)), RNG.normal(size=N)
    step = 1e-6

    def velocity(time_s: float) -> np.ndarray:
        angle, speed = theta1 + time_s * twist[:, 1], twist[:, 0] + time_s * surge
        return np.stack([speed * np.cos(angle), speed * np.sin(angle)], axis=-1)

    expected = (velocity(step) - velocity(-step)) / (2 * step)
    ours = hybrid.acceleration_from_twist(theta1, twist, surge)
    np.testing.assert_allclose(ours, expected, atol=1e-9)


def test_z_keeps_the_motion_of_the_point_and_the_trailer() -> None:
    q, rate = RNG.uniform(-9, 9, (N, 4)), RNG.uniform(-2, 2, (N, 3))
    q_rate = kinematics.q_rate(q, rate)
    z = hybrid.z_from_q(q, q_rate)
    np.testing.assert_array_equal(z[:, [0, 2, 4]], q[:, [0, 1, 3]])
    np.testing.assert_array_equal(z[:, [1, 3, 5]], q_rate[:, [0, 1, 3]])


def test_flat_output_velocity_and_acceleration_against_finite_differences() -> None:
    z, v = random_z_and_v()
    step, k = 1e-5, ROBOT.swing_length_m

    def output(time_s: float) -> np.ndarray:
        acceleration = hybrid.trailer_acceleration(z[:, 4], v, ROBOT)
        theta2 = z[:, 4] + time_s * z[:, 5] + 0.5 * time_s**2 * acceleration
        place = z[:, [0, 2]] + time_s * z[:, [1, 3]] + 0.5 * time_s**2 * v
        q = np.column_stack([place, np.zeros(N), theta2])
        return flatness.point_behind(q, k)

    q = np.column_stack([z[:, 0], z[:, 2], np.zeros(N), z[:, 4]])
    q_rate = np.column_stack([z[:, 1], z[:, 3], np.zeros(N), z[:, 5]])
    velocity = flatness.velocity_behind(q_rate[:, :2], q[:, 3], q_rate[:, 3], k)
    np.testing.assert_allclose(velocity, (output(step) - output(-step)) / (2 * step), atol=1e-8)
    # Second differences with this step lose eight digits more.
    second = (output(step) - 2 * output(0.0) + output(-step)) / step**2
    acceleration = flatness.flat_output_acceleration(z[:, 4], z[:, 5], v, ROBOT)
    np.testing.assert_allclose(acceleration, second, atol=3e-5)


def test_published_spring_is_stronger_by_the_missing_factor() -> None:
    angle, rate = RNG.normal(size=N), RNG.normal(size=N)
    ratio = hitch.spring_damper_acceleration(angle, rate, SPRUNG) / (
        hitch.published_spring_acceleration(angle, rate, SPRUNG)
    )
    m2_l = ROBOT.trailer.mass_kg * ROBOT.trailer.com_offset_m
    np.testing.assert_allclose(ratio, 1 / m2_l, rtol=1e-12)
    assert 200 * m2_l == pytest.approx(9.306)  # what "k_t = 200" acts like [N·m/rad]


def test_spring_pulls_the_trailer_towards_the_tractor_and_the_damper_brakes() -> None:
    ahead, still = np.array([0.1]), np.array([0.0])
    assert hitch.spring_damper_torque(ahead, still, SPRUNG.hitch) == pytest.approx(-0.02)
    assert hitch.spring_damper_torque(still, ahead, SPRUNG.hitch) == pytest.approx(-0.001)


def test_friction_slows_the_hitch_and_stops_it_but_never_turns_it_round() -> None:
    rate = np.array([0.5, -0.5, 0.1, -0.1, 0.0])
    np.testing.assert_array_equal(hitch.rub(rate, 0.25), [0.25, -0.25, 0.0, 0.0, 0.0])


def test_smoothed_friction_slows_the_sampled_hitch_as_it_says() -> None:
    """At rest, with friction of a share s/√(s² + ε²) of its size: ṡ = −f·s/√(s² + ε²)."""
    robot = RobotParameters(hitch=Hitch(coulomb_friction_n_m=2e-3))
    size, width = 2e-3 / robot.swing_inertia_kg_m2, 0.05
    model = SampledModel(robot, 0.033, substep_s=1e-4, smoothing_rad_s=width)
    body, wheels = np.array([[0.0, 0.0, 0.0, 0.3, 0.1]]), np.zeros((1, 2))
    for _ in range(10):
        body, wheels = model.advance(body, wheels, np.zeros((1, 2)))

    def slowing(_: float, s: np.ndarray) -> np.ndarray:
        return -size * s / np.hypot(s, width)

    exact = solve_ivp(slowing, (0.0, 0.33), [0.1], rtol=1e-10, atol=1e-12).y[0, -1]
    # linearly implicit, of first order: f/ε·step = 5e-4 of what is left
    assert exact < 0.05
    assert body[0, 4] == pytest.approx(exact, rel=2e-3)


def test_a_spring_and_a_damper_swing_the_sampled_hitch_as_an_oscillator_does() -> None:
    """Beside a tractor at rest θ̈2 = −(k_t·φ + c_t·φ̇)/J with φ = θ2 (Eq. 17, 38-41)."""
    robot = RobotParameters(hitch=Hitch(stiffness_n_m_rad=0.05, damping_n_m_s_rad=5e-3))
    model = SampledModel(robot, 0.033, substep_s=1e-4)
    body, wheels = np.array([[0.0, 0.0, 0.0, 0.3, 0.0]]), np.zeros((1, 2))
    for _ in range(10):
        body, wheels = model.advance(body, wheels, np.zeros((1, 2)))
    stiffness, damping = (g / robot.swing_inertia_kg_m2 for g in (0.05, 5e-3))

    def pulled(_: float, s: np.ndarray) -> list[float]:
        return [s[1], -stiffness * s[0] - damping * s[1]]

    exact = solve_ivp(pulled, (0.0, 0.33), [0.3, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    # the implicit damper is of first order: c/J·step = 7e-5
    assert body[0, 3:] == pytest.approx(exact, rel=1e-3)


def swing_energy(
    angle: np.ndarray, rate: np.ndarray, twist: np.ndarray, robot: RobotParameters
) -> np.ndarray:
    """[J] of the free trailer's swing while the tractor keeps its twist (u1, u2).

    The hitch angle φ then obeys φ̈ = u1·u2·cos φ / k: a pendulum in the centrifugal field, whose
    ½φ̇² − (u1·u2/k)·sin φ is constant.
    """
    field = twist[..., 0] * twist[..., 1] / robot.swing_length_m
    return robot.swing_inertia_kg_m2 * (0.5 * rate**2 - field * np.sin(angle))


@pytest.mark.parametrize("turn_rate", [0.5, -0.5])
def test_free_trailer_keeps_its_swing_energy_at_constant_tractor_velocity(turn_rate: float) -> None:
    robot = RobotParameters(servo=Servo(preset="fast"))
    twist = np.array([[0.5, turn_rate]])
    outward = np.copysign(np.pi / 2, turn_rate)
    swings = outward + np.array([0.1, 1.0, 2.5])  # up to near the unstable inward direction
    twist = np.repeat(twist, swings.size, axis=0)
    q = np.column_stack([np.zeros((swings.size, 3)), swings])
    q_rate = kinematics.q_rate(q, np.column_stack([twist, twist[:, 1]]))
    plant = AnalyticPlant(robot, swings.size, 0.033, 0.011)
    plant.reset(RobotState(q=q, q_rate=q_rate))
    command = kinematics.wheels_from_twist(twist, robot)

    def energy_now() -> np.ndarray:
        state = plant.state()
        hitch_rate = state.q_rate[:, 3] - state.q_rate[:, 2]
        return swing_energy(state.hitch_angle_rad, hitch_rate, twist, robot)

    initial, visited = energy_now(), []
    for _ in range(600):
        plant.advance(command, 1)
        visited.append(np.stack([energy_now(), plant.state().hitch_angle_rad]))
    energy, angle = np.moveaxis(np.array(visited), 1, 0)
    # RK4 drifts by (rate·step)^5 per step, (1.3·0.011)^5 = 6e-10; over 1800 steps of a 0.012 J
    # swing that is 1e-8 J. The swing itself is far from still.
    assert np.abs(energy - initial).max() < 1e-8
    assert np.all(np.ptp(angle, axis=0) > 0.19)
