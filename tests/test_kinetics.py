"""Sympy derives Eq. 14-23 from the energy of Eq. 13 and the code has to agree."""

from collections.abc import Callable
from functools import cache

import numpy as np
import sympy as sp

from ttwmr_mj.dynamics import kinematics, kinetics
from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()
RNG = np.random.default_rng(2)
POINTS = 20
# Both sides evaluate the same closed forms, of order one, in different order.
ROUNDOFF = 1e-12

T = sp.Symbol("t")
Q = [sp.Function(name)(T) for name in ("x", "y", "theta1", "theta2")]
RATES = [q.diff(T) for q in Q]
XI_RATE = list(sp.symbols("s_rate theta1_rate theta2_rate"))


def table_one() -> dict[str, float]:
    tractor, trailer = ROBOT.tractor, ROBOT.trailer
    return {
        "m1": tractor.mass_kg,
        "m2": trailer.mass_kg,
        "J1": tractor.yaw_inertia_kg_m2,
        "J2": trailer.yaw_inertia_kg_m2,
        "a1": tractor.com_offset_m,
        "l": trailer.com_offset_m,
    }


@cache
def energy() -> sp.Expr:
    m1, m2, J1, J2, a1, length = sp.symbols("m1 m2 J1 J2 a1 l")
    x, y, theta1, theta2 = Q
    tractor = sp.Matrix([x + a1 * sp.cos(theta1), y + a1 * sp.sin(theta1)]).diff(T)
    trailer = sp.Matrix([x - length * sp.cos(theta2), y - length * sp.sin(theta2)]).diff(T)
    linear = m1 * tractor.dot(tractor) + m2 * trailer.dot(trailer)
    return (linear + J1 * theta1.diff(T) ** 2 + J2 * theta2.diff(T) ** 2) / 2


@cache
def equations_of_motion() -> tuple[sp.Matrix, sp.Matrix]:
    """M(q) and V(q, q̇): d/dt ∂T/∂q̇ − ∂T/∂q = M·q̈ + V."""
    pairs = zip(Q, RATES, strict=True)
    left = sp.Matrix([energy().diff(rate).diff(T) - energy().diff(q) for q, rate in pairs])
    accelerations = [r.diff(T) for r in RATES]
    M = left.jacobian(accelerations)
    V = sp.simplify(left - M * sp.Matrix(accelerations))
    return M, V


@cache
def reduced_equations() -> tuple[sp.Matrix, sp.Matrix]:
    """SᵀMS and Sᵀ(MṠξ̇ + V) with q̇ = Sξ̇ put in (Eq. 19-22)."""
    M, V = equations_of_motion()
    theta1 = Q[2]
    S = sp.Matrix([[sp.cos(theta1), 0, 0], [sp.sin(theta1), 0, 0], [0, 1, 0], [0, 0, 1]])
    xi_rate = sp.Matrix(XI_RATE)
    motion = dict(zip(RATES, S * xi_rate, strict=True))
    bias = S.T * (M * S.diff(T) * xi_rate + V)
    return sp.simplify(S.T * M * S), sp.simplify(bias.subs(motion))


def numeric(expression: sp.Matrix, motion: list[sp.Expr]) -> Callable[..., np.ndarray]:
    """A function of (q, motion), each a vector."""
    names = sp.symbols("q0:4 r0:4")
    q_names, motion_names = names[:4], names[4 : 4 + len(motion)]
    replaced = expression.subs(dict(zip(motion, motion_names, strict=True)))
    replaced = replaced.subs(dict(zip(Q, q_names, strict=True))).subs(table_one())
    function = sp.lambdify([*q_names, *motion_names], replaced, "numpy")
    return lambda q, rate: np.array(function(*q, *rate), dtype=float)


def random_motion() -> tuple[np.ndarray, np.ndarray]:
    """q (n, 4) and ξ̇ (n, 3), at speeds that are not one."""
    return RNG.uniform(-3, 3, (POINTS, 4)), RNG.uniform(-2, 2, (POINTS, 3))


def test_printed_energy_is_the_energy_of_two_bodies() -> None:
    m1, m2, J1, J2, a1, length = sp.symbols("m1 m2 J1 J2 a1 l")
    _, _, theta1, theta2 = Q
    dx, dy, d1, d2 = RATES
    printed = (
        m1 * ((dx - a1 * d1 * sp.sin(theta1)) ** 2 + (dy + a1 * d1 * sp.cos(theta1)) ** 2)
        + m2 * ((dx + length * d2 * sp.sin(theta2)) ** 2 + (dy - length * d2 * sp.cos(theta2)) ** 2)
        + J1 * d1**2
        + J2 * d2**2
    ) / 2
    assert sp.simplify(printed - energy()) == 0


def test_full_equations_match_the_derivation() -> None:
    M, V = equations_of_motion()
    q, xi_rate = random_motion()
    q_rate = kinematics.q_rate(q, xi_rate)
    expected_m, expected_v = numeric(M, RATES), numeric(V, RATES)
    mass, bias = kinetics.mass_matrix(q, ROBOT), kinetics.bias(q, q_rate, ROBOT)
    for n in range(POINTS):
        np.testing.assert_allclose(mass[n], expected_m(q[n], q_rate[n]), atol=ROUNDOFF)
        np.testing.assert_allclose(bias[n], expected_v(q[n], q_rate[n])[:, 0], atol=ROUNDOFF)


def test_kinetic_energy_matches_eq_13() -> None:
    expected = numeric(sp.Matrix([energy()]), RATES)
    q, q_rate = RNG.normal(size=(POINTS, 4)), RNG.normal(size=(POINTS, 4))
    ours = kinetics.kinetic_energy(q, q_rate, ROBOT)
    for n in range(POINTS):
        np.testing.assert_allclose(ours[n], expected(q[n], q_rate[n])[0, 0], atol=ROUNDOFF)


def test_reduced_equations_match_the_derivation() -> None:
    mass, bias = reduced_equations()
    q, xi_rate = random_motion()
    expected_m, expected_b = numeric(mass, XI_RATE), numeric(bias, XI_RATE)
    ours_m = kinetics.reduced_mass_matrix(q, ROBOT)
    ours_b = kinetics.reduced_bias(q, xi_rate, ROBOT)
    for n in range(POINTS):
        np.testing.assert_allclose(ours_m[n], expected_m(q[n], xi_rate[n]), atol=ROUNDOFF)
        np.testing.assert_allclose(ours_b[n], expected_b(q[n], xi_rate[n])[:, 0], atol=ROUNDOFF)


def test_published_bias_misses_the_speed_in_two_terms() -> None:
    q, xi_rate = random_motion()
    error = kinetics.published_bias(q, xi_rate, ROBOT) - kinetics.reduced_bias(q, xi_rate, ROBOT)
    speed, turn = xi_rate[:, 0], xi_rate[:, 1]
    nose = ROBOT.tractor.mass_kg * ROBOT.tractor.com_offset_m
    tail = ROBOT.trailer.mass_kg * ROBOT.trailer.com_offset_m * np.cos(q[:, 3] - q[:, 2])
    np.testing.assert_array_equal(error[:, 0], 0.0)
    np.testing.assert_allclose(error[:, 1], nose * (1 - speed) * turn, atol=ROUNDOFF)
    np.testing.assert_allclose(error[:, 2], -tail * (1 - speed) * turn, atol=ROUNDOFF)
    assert np.abs(error[:, 1:]).max() > 0.01  # N·m, where 3e-4 N·m moves the trailer in the lab


def test_published_bias_at_lab_speed_is_wrong_by_the_inverse_of_the_speed() -> None:
    q, lab = np.array([0.0, 0.0, 0.3, 0.8]), np.array([0.43 / 8, 1 / 8, 1 / 8])
    ratio = kinetics.published_bias(q, lab, ROBOT) / kinetics.reduced_bias(q, lab, ROBOT)
    np.testing.assert_allclose(ratio, [1.0, 8 / 0.43, 8 / 0.43], rtol=ROUNDOFF)  # 18.6 times


def test_forward_acceleration_and_lateral_force_solve_the_full_equations() -> None:
    q, xi_rate = random_motion()
    force, torque = RNG.normal(size=(POINTS, 2)), RNG.normal(size=POINTS)
    xi_acceleration = kinetics.forward_acceleration(q, xi_rate, force, torque, ROBOT)
    lateral = kinetics.lateral_force(q, xi_rate, xi_acceleration, ROBOT)

    q_rate = kinematics.q_rate(q, xi_rate)
    q_acceleration = np.einsum("nij,nj->ni", kinematics.null_space(q), xi_acceleration)
    q_acceleration += np.einsum("nij,nj->ni", kinematics.null_space_rate(q, q_rate), xi_rate)
    left = np.einsum("nij,nj->ni", kinetics.mass_matrix(q, ROBOT), q_acceleration)
    left += kinetics.bias(q, q_rate, ROBOT)
    right = np.einsum("nij,nj->ni", kinetics.input_matrix(q), force)
    right += kinematics.constraint_matrix(q)[:, 0] * lateral[:, None]
    right += torque[:, None] * np.array([0.0, 0.0, -1.0, 1.0])
    # Accelerations reach 1e3 rad/s² here, so 1e-12 is relative to them.
    np.testing.assert_allclose(left, right, atol=1e-11)


def test_power_of_the_forces_is_the_rate_of_the_energy() -> None:
    q, xi_rate = random_motion()
    force, torque = RNG.normal(size=(POINTS, 2)), RNG.normal(size=POINTS)
    xi_acceleration = kinetics.forward_acceleration(q, xi_rate, force, torque, ROBOT)
    q_rate = kinematics.q_rate(q, xi_rate)
    step = 1e-5

    def energy_after(time_s: float) -> np.ndarray:
        rate = xi_rate + time_s * xi_acceleration
        moved = q + time_s * q_rate
        return kinetics.kinetic_energy(moved, kinematics.q_rate(moved, rate), ROBOT)

    power = (energy_after(step) - energy_after(-step)) / (2 * step)
    expected = (force * xi_rate[:, :2]).sum(axis=1) + torque * (xi_rate[:, 2] - xi_rate[:, 1])
    # Central differences: step²·E''' with accelerations up to 1e3.
    np.testing.assert_allclose(power, expected, rtol=1e-5, atol=1e-5)


def test_steady_circle_is_held_by_a_force_towards_its_centre() -> None:
    """Trailer outside, lab circle: λ alone supplies the centripetal force of both bodies."""
    robot, R, turn = ROBOT, 0.43, 1 / 8
    q = np.array([0.0, 0.0, 0.0, np.pi / 2])
    xi_rate = np.array([R * turn, turn, turn])
    # Constant speed needs f = −m1·a1·ω² and τ = m1·a1·ṡ·ω; the trailer needs nothing.
    nose = robot.tractor.mass_kg * robot.tractor.com_offset_m
    force = np.array([-nose * turn**2, nose * R * turn**2])
    xi_acceleration = kinetics.forward_acceleration(q, xi_rate, force, 0.0, robot)
    np.testing.assert_allclose(xi_acceleration, 0.0, atol=ROUNDOFF)
    expected = robot.tractor.mass_kg * R + robot.trailer.mass_kg * (R + robot.trailer.com_offset_m)
    lateral = kinetics.lateral_force(q, xi_rate, xi_acceleration, robot)
    np.testing.assert_allclose(lateral, -expected * turn**2, rtol=ROUNDOFF)  # to the left
