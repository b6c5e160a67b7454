"""Trains of trailers: sympy derives their equations from the Lagrangian, and these conserve."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from trains import motley, train

from ttwmr_mj.dynamics import kinematics, kinetics
from ttwmr_mj.dynamics.floor.balls import Forces, resisting_torque, train_drag
from ttwmr_mj.dynamics.hybrid import trailer_acceleration
from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.train import hitch_torques, jacobians, on_trailers, trailer_accelerations
from ttwmr_mj.robot import RobotParameters, Trailer
from ttwmr_mj.state import FloatArray, hitch_angles

RNG = np.random.default_rng(13)
POINTS = 6
ROUNDOFF = 1e-12  # both sides evaluate the same closed forms, of order one, in different order
PULL = np.array([0.4, -0.7])  # along the floor [m/s²]


def cut(count: int) -> RobotParameters:
    """The first trailers of `motley`."""
    robot = motley()
    return RobotParameters(trailers=robot.trailers[:count], hitches=robot.hitches[:count])


@cache
def lagrange(count: int):
    """A function of (q, q̇) for M(q) and all else, with d/dt ∂L/∂q̇ − ∂L/∂q = M·q̈ + rest."""
    robot = cut(count)
    width = 3 + count
    q, rate = sp.symbols(f"q:{width}"), sp.symbols(f"r:{width}")
    m, J = robot.tractor.mass_kg, robot.tractor.yaw_inertia_kg_m2
    bodies = [(m, J, q[2], robot.tractor.com_offset_m, 0.0, (q[0], q[1]))]
    hinge = (q[0], q[1])
    for i, trailer in enumerate(robot.trailers):
        angle, back, side = q[3 + i], -trailer.com_offset_m, trailer.com_lateral_m
        bodies.append((trailer.mass_kg, trailer.yaw_inertia_kg_m2, angle, back, side, hinge))
        reach = trailer.next_hitch_offset_m or 0.0
        hinge = (hinge[0] - reach * sp.cos(angle), hinge[1] - reach * sp.sin(angle))
    L = sp.Integer(0)
    for mass, inertia, angle, ahead, left, (x, y) in bodies:
        com = sp.Matrix([
            x + ahead * sp.cos(angle) - left * sp.sin(angle),
            y + ahead * sp.sin(angle) + left * sp.cos(angle),
        ])  # fmt: skip
        velocity = com.jacobian(q) * sp.Matrix(rate)
        spin = (sp.Matrix([angle]).jacobian(q) * sp.Matrix(rate))[0]
        L += mass * velocity.dot(velocity) / 2 + inertia * spin**2 / 2
        L += mass * (PULL[0] * com[0] + PULL[1] * com[1])
    damping = sp.zeros(width, 1)
    for hitch, (i, j) in zip(robot.hitches, pairwise(range(2, width)), strict=True):
        L -= hitch.stiffness_n_m_rad * (q[j] - q[i]) ** 2 / 2
        torque = hitch.damping_n_m_s_rad * (rate[j] - rate[i])
        damping[j] += torque
        damping[i] -= torque
    momentum = sp.Matrix([L]).jacobian(rate).T
    M = momentum.jacobian(rate)
    rest = momentum.jacobian(q) * sp.Matrix(rate) - sp.Matrix([L]).jacobian(q).T + damping
    function = sp.lambdify([q, rate], [M, rest], "numpy", cse=True)
    return robot, lambda q, rate: [np.array(a, dtype=float) for a in function(q, rate)]


def some(count: int, size: int = POINTS) -> tuple[FloatArray, FloatArray]:
    """Random q (size, 3 + n) and ξ̇ (size, 2 + n)."""
    return RNG.uniform(-3, 3, (size, 3 + count)), RNG.uniform(-2, 2, (size, 2 + count))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_equations_of_motion_follow_from_the_lagrangian(count: int) -> None:
    robot, expected = lagrange(count)
    q, xi = some(count)
    rate = kinematics.q_rate(q, xi)
    M, V = kinetics.mass_matrix(q, robot), kinetics.bias(q, rate, robot)
    G = kinetics.gravity(q, PULL, robot)
    torque = hitch_torques(hitch_angles(q), np.diff(xi[:, 1:], axis=1), robot)
    rest = V + G
    rest[:, 2] += torque[:, 0]
    rest[:, 3:] -= on_trailers(torque)
    for n in range(POINTS):
        mass, others = expected(q[n], rate[n])
        np.testing.assert_allclose(M[n], mass, atol=ROUNDOFF)
        np.testing.assert_allclose(rest[n], others[:, 0], atol=ROUNDOFF)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_forward_and_prescribed_motion_solve_the_same_equations(count: int) -> None:
    robot, expected = lagrange(count)
    q, xi = some(count)
    rate, force = kinematics.q_rate(q, xi), RNG.normal(size=(POINTS, 2))
    torque = hitch_torques(hitch_angles(q), np.diff(xi[:, 1:], axis=1), robot)
    change = kinetics.forward_acceleration(q, xi, force, torque, robot, PULL)
    lateral = kinetics.lateral_force(q, xi, change, robot, PULL)
    S = kinematics.null_space(q)
    second = np.einsum("nij,nj->ni", S, change)
    second += np.einsum("nij,nj->ni", kinematics.null_space_rate(q, rate), xi)
    right = np.einsum("nij,nj->ni", kinetics.input_matrix(q), force)
    right += kinematics.constraint_matrix(q)[:, 0] * lateral[:, None]
    theta, turn = q[:, 3:], xi[:, 2:]
    v = second[:, :2] - PULL
    prescribed = trailer_accelerations(theta, turn, v, robot, on_trailers(torque))
    # accelerations reach 1e3 rad/s², so roundoff is relative to them
    np.testing.assert_allclose(prescribed, change[:, 2:], rtol=1e-9, atol=1e-9)
    for n in range(POINTS):
        mass, others = expected(q[n], rate[n])
        np.testing.assert_allclose(mass @ second[n] + others[:, 0], right[n], atol=1e-10)


def test_one_trailer_is_eq_17_23_24_to_the_bit() -> None:
    robot, (q, xi) = RobotParameters(), some(1)
    v, torque = RNG.normal(size=(POINTS, 2)), RNG.normal(size=(POINTS, 1))
    ours = trailer_accelerations(q[:, 3:], xi[:, 2:], v, robot, torque)
    old = trailer_acceleration(q[:, 3], v, robot, torque[:, 0])
    np.testing.assert_array_equal(ours[:, 0], old)
    tail = robot.trailer.mass_kg * robot.trailer.com_offset_m
    reduced = kinetics.reduced_mass_matrix(q, robot)
    np.testing.assert_array_equal(reduced[:, 0, 2], tail * np.sin(q[:, 3] - q[:, 2]))
    np.testing.assert_array_equal(reduced[:, 2, 2], robot.swing_inertia_kg_m2)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_jacobians_are_the_differences(count: int) -> None:
    robot = cut(count)
    theta, rate = RNG.uniform(-3, 3, (POINTS, count)), RNG.uniform(-2, 2, (POINTS, count))
    v, hitch = RNG.normal(size=(POINTS, 2)), 0.01 * RNG.normal(size=(POINTS, count))
    exact = jacobians(theta, rate, v, robot, on_trailers(hitch))
    step = 1e-6

    def swing(at: list[FloatArray]) -> FloatArray:
        return trailer_accelerations(*at[:3], robot, on_trailers(at[3]))

    for which, slope in enumerate(exact):
        for column in range(slope.shape[-1]):
            ends = []
            for sign in (1.0, -1.0):
                at = [theta.copy(), rate.copy(), v.copy(), hitch.copy()]
                at[which][:, column] += sign * step
                ends.append(swing(at))
            differences = (ends[0] - ends[1]) / (2.0 * step)
            # central differences: step²·θ⃛ with θ̈ up to 1e2
            np.testing.assert_allclose(slope[..., column], differences, rtol=1e-6, atol=1e-6)


def test_free_trains_keep_energy_and_momentum() -> None:
    """Without forces the bodies conserve both; a heavy pivot that moves freely stands for P."""
    robot = train(3)
    q, rate = RNG.uniform(-3, 3, (4, 6)), RNG.uniform(-1, 1, (4, 6))

    def slope(_: float, state: FloatArray) -> FloatArray:
        q, rate = state[:, :6], state[:, 6:]
        load = -kinetics.bias(q, rate, robot)[..., None]
        second = np.linalg.solve(kinetics.mass_matrix(q, robot), load)[..., 0]
        return np.concatenate([rate, second], axis=1)

    def conserved(state: FloatArray) -> FloatArray:
        """Energy, linear momentum, and angular momentum about the origin."""
        q, rate = state[:, :6], state[:, 6:]
        p = np.einsum("nij,nj->ni", kinetics.mass_matrix(q, robot), rate)
        spin = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0] + p[:, 2:].sum(axis=1)
        return np.column_stack([kinetics.kinetic_energy(q, rate, robot), p[:, :2], spin])

    state = np.concatenate([q, rate], axis=1)
    before = conserved(state)
    for _ in range(400):
        state = runge_kutta(slope, state, 0.0025)
    # fourth order: 400 steps of (10 rad/s · 2.5 ms)^5/120 each
    np.testing.assert_allclose(conserved(state), before, rtol=0, atol=1e-7)


def test_work_of_the_pivot_is_the_energy_of_the_trailers() -> None:
    """P on a given path: what its force does, and the hitches take, changes the energy."""
    robot = cut(3)
    q, xi = some(3)
    force, torque = RNG.normal(size=(POINTS, 2)), 0.1 * RNG.normal(size=(POINTS, 3))
    change = kinetics.forward_acceleration(q, xi, force, torque, robot)
    rate, step = kinematics.q_rate(q, xi), 1e-5

    def energy_after(time_s: float) -> FloatArray:
        moved, speeds = q + time_s * rate, xi + time_s * change
        return kinetics.kinetic_energy(moved, kinematics.q_rate(moved, speeds), robot)

    power = (energy_after(step) - energy_after(-step)) / (2 * step)
    hitches = (torque * np.diff(xi[:, 1:], axis=1)).sum(axis=1)
    expected = (force * xi[:, :2]).sum(axis=1) + hitches
    # central differences, step²·E''' with accelerations up to 1e3
    np.testing.assert_allclose(power, expected, rtol=1e-5, atol=1e-5)


def test_a_reach_of_zero_hides_the_trailer_behind_from_the_one_before() -> None:
    """Hinged at the same point both are pendulums of P, each by itself."""
    short = Trailer(next_hitch_offset_m=1e-12)
    other = Trailer(mass_kg=0.2, com_offset_m=0.1)
    robot = RobotParameters(trailers=(short, other), hitches=train(2).hitches)
    theta, rate = RNG.uniform(-3, 3, (POINTS, 2)), RNG.uniform(-2, 2, (POINTS, 2))
    v = RNG.normal(size=(POINTS, 2))
    both = trailer_accelerations(theta, rate, v, robot)
    for i, trailer in enumerate(robot.trailers):
        alone = trailer_acceleration(theta[:, i], v, RobotParameters(trailer=trailer))
        np.testing.assert_allclose(both[:, i], alone, rtol=1e-9)


def test_balls_drag_by_virtual_work() -> None:
    """The generalized forces are those of forces at the balls' places, one trailer as ever."""
    robot, (q, xi) = cut(3), some(3)
    forces = [Forces(0.0, 0.1 + i, 0.2 + i) for i in range(3)]
    theta = q[:, 3:] - q[:, 2:3]
    pull, torque = train_drag(theta, xi[:, 2:], xi[:, 0], robot, forces)
    power = pull * xi[:, 0] + (torque * xi[:, 2:]).sum(axis=1)
    expected = np.zeros(POINTS)
    rate = kinematics.q_rate(q, xi)
    for i, trailer in enumerate(robot.trailers):
        for side, force in ((-0.05, forces[i].right), (0.05, forces[i].left)):
            point = _point(q, rate, robot, i, trailer.com_offset_m, side)
            expected -= force * np.hypot(*point.T)
    # exact but for the fading of 0.1 mm/s below speeds of 1 m/s
    np.testing.assert_allclose(power, expected, rtol=1e-4)
    one = RobotParameters()
    _, alone = train_drag(theta[:, :1], xi[:, 2:3], xi[:, 0], one, forces[:1])
    as_ever = resisting_torque(theta[:, 0], (xi[:, 0], 0.0), xi[:, 2], one, forces[0])
    np.testing.assert_array_equal(alone[:, 0], as_ever)


def _point(
    q: FloatArray, rate: FloatArray, robot: RobotParameters, i: int, back: float, side: float
) -> FloatArray:
    """Velocity (size, 2) of a trailer's point."""
    velocity = rate[:, :2].copy()
    for k, trailer in enumerate(robot.trailers[: i + 1]):
        along = back if k == i else trailer.next_hitch_offset_m
        cos, sin, turn = np.cos(q[:, 3 + k]), np.sin(q[:, 3 + k]), rate[:, 3 + k]
        velocity += (-along * turn)[:, None] * np.stack([-sin, cos], axis=1)
        if k == i:
            velocity += (side * turn)[:, None] * np.stack([-cos, -sin], axis=1)
    return velocity
