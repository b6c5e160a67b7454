"""Kinetic model (Eq. 11-23), with Eq. 23 as it follows from Eq. 14-17.

Printed Eq. 23 differs from its own derivation in three places: its first acceleration is s̈ and
not ẍ, and the second and third bias terms miss the factor ṡ. `reduced_bias` is the derived one,
`published_bias` the printed one.

Generalized forces: f pushes P along the heading, τ turns the tractor, λ acts along Aᵀ (Eq. 18,
positive to the tractor's right; Eq. 11 has the opposite sign of λ). A hitch torque T turns the
trailer by +T and the tractor by −T. On a floor that slopes, gravity adds G(q) to the left side of
Eq. 18.

All functions work over any leading axes, SI units. Everywhere, q and q_rate (..., 4) are the
generalized coordinates and their rates, workspace_rate (..., 3) is ξ̇ = (ṡ, θ̇1, θ̇2), and robot
gives masses, inertias and offsets of Table I.
"""

import numpy as np

from ttwmr_mj.dynamics.kinematics import constraint_matrix, null_space, null_space_rate, to_body
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray


def first_moments(robot: RobotParameters) -> tuple[float, float]:
    """m1·a1 of the tractor and m2·l of the trailer about P [kg·m].

    The trailer's acts at θ2 − β, the direction of its COM (`robot.lean_rad`).
    """
    tractor, trailer = robot.tractor, robot.trailer
    return tractor.mass_kg * tractor.com_offset_m, trailer.mass_kg * trailer.com_distance_m


def kinetic_energy(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Eq. 13 as ½·q̇ᵀM(q)q̇ (Eq. 12), (...) [J]."""
    return np.asarray(0.5 * np.einsum("...i,...ij,...j", q_rate, mass_matrix(q, robot), q_rate))


def mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """M(q) of Eq. 18, (..., 4, 4) [kg, kg·m, kg·m²], symmetric positive definite."""
    nose, tail = first_moments(robot)
    theta1, theta2 = q[..., THETA1], q[..., THETA2] - robot.lean_rad
    M = np.zeros((*q.shape[:-1], 4, 4))
    M[..., 0, 0] = M[..., 1, 1] = robot.tractor.mass_kg + robot.trailer.mass_kg
    M[..., 0, 2] = M[..., 2, 0] = -nose * np.sin(theta1)
    M[..., 1, 2] = M[..., 2, 1] = nose * np.cos(theta1)
    M[..., 0, 3] = M[..., 3, 0] = tail * np.sin(theta2)
    M[..., 1, 3] = M[..., 3, 1] = -tail * np.cos(theta2)
    M[..., 2, 2] = _yaw_inertia(robot)
    M[..., 3, 3] = robot.swing_inertia_kg_m2
    return M


def bias(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """V(q, q̇) of Eq. 18, (..., 4) [N, N, N·m, N·m]: centripetal terms of Eq. 14-15, no torques."""
    nose, tail = first_moments(robot)
    forward, backward = nose * q_rate[..., THETA1] ** 2, tail * q_rate[..., THETA2] ** 2
    theta1, theta2 = q[..., THETA1], q[..., THETA2] - robot.lean_rad
    V = np.zeros_like(q)
    V[..., 0] = backward * np.cos(theta2) - forward * np.cos(theta1)
    V[..., 1] = backward * np.sin(theta2) - forward * np.sin(theta1)
    return V


def gravity(q: FloatArray, gravity_m_s2: FloatArray, robot: RobotParameters) -> FloatArray:
    """G(q) of the nomenclature, (..., 4) [N, N, N·m, N·m]: the gradient of −Σ m·g_p·r, r the COMs.

    The pull g_p along the floor is (..., 2), world frame. Beside Eq. 18's V it stands on the left:
    M·q̈ + V + G.
    """
    nose, tail = first_moments(robot)
    x, y = np.moveaxis(np.asarray(gravity_m_s2), -1, 0)
    G = np.zeros_like(q)
    mass = robot.tractor.mass_kg + robot.trailer.mass_kg
    G[..., 0], G[..., 1] = -mass * x, -mass * y
    G[..., 2] = -nose * to_body(q[..., THETA1], x, y)[1]
    G[..., 3] = tail * to_body(q[..., THETA2] - robot.lean_rad, x, y)[1]
    return G


def input_matrix(q: FloatArray) -> FloatArray:
    """E(q) of Eq. 18, (..., 4, 2): generalized forces of f [N] and τ [N·m]."""
    return null_space(q)[..., :2]


def reduced_mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """SᵀMS of Eq. 23, (..., 3, 3), over the accelerations (s̈, θ̈1, θ̈2)."""
    _, tail = first_moments(robot)
    mass = np.zeros((*q.shape[:-1], 3, 3))
    mass[..., 0, 0] = robot.tractor.mass_kg + robot.trailer.mass_kg
    mass[..., 0, 2] = mass[..., 2, 0] = tail * np.sin(_load_angle(q, robot))
    mass[..., 1, 1] = _yaw_inertia(robot)
    mass[..., 2, 2] = robot.swing_inertia_kg_m2
    return mass


def reduced_bias(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Sᵀ(M·Ṡ·ξ̇ + V), the bias that Eq. 23 should have, (..., 3) [N, N·m, N·m].

    (−m1·a1·θ̇1² + m2·l·cos(θ2−θ1)·θ̇2², m1·a1·ṡ·θ̇1, −m2·l·cos(θ2−θ1)·ṡ·θ̇1)
    """
    reduced = published_bias(q, workspace_rate, robot)
    reduced[..., 1:] *= workspace_rate[..., :1]
    return reduced


def published_bias(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """The bias as printed in Eq. 23, whose second and third terms miss the factor ṡ.

    For comparison only: those two terms have not even the unit of a torque. Shape as
    `reduced_bias`.
    """
    nose, tail = first_moments(robot)
    pull = tail * np.cos(_load_angle(q, robot))
    theta1_rate, theta2_rate = workspace_rate[..., 1], workspace_rate[..., 2]
    ahead = pull * theta2_rate**2 - nose * theta1_rate**2
    return np.stack([ahead, nose * theta1_rate, -pull * theta1_rate], axis=-1)


def forward_acceleration(
    q: FloatArray,
    workspace_rate: FloatArray,
    force: FloatArray,
    hitch_torque_n_m: FloatArray | float,
    robot: RobotParameters,
    gravity_m_s2: FloatArray | None = None,
) -> FloatArray:
    """Accelerations (s̈, θ̈1, θ̈2) (..., 3) under forces: Eq. 23 (derived form) solved for ξ̈.

    The force (..., 2) is f [N] and τ [N·m]; the hitch torque (...) acts on the trailer, its
    opposite on the tractor. Gravity (2,) pulls along the floor; None: it is level.
    """
    load = -reduced_bias(q, workspace_rate, robot)
    if gravity_m_s2 is not None:
        load -= np.einsum("...ji,...j", null_space(q), gravity(q, gravity_m_s2, robot))
    load[..., :2] += force
    load[..., 1] -= hitch_torque_n_m
    load[..., 2] += hitch_torque_n_m
    solution = np.linalg.solve(reduced_mass_matrix(q, robot), load[..., None])
    return np.asarray(solution[..., 0])


def lateral_force(
    q: FloatArray,
    workspace_rate: FloatArray,
    workspace_acceleration: FloatArray,
    robot: RobotParameters,
    gravity_m_s2: FloatArray | None = None,
) -> FloatArray:
    """λ of Eq. 18: what keeps the wheels from slipping sideways.

    A·(M·q̈ + V + G) with q̈ = S·ξ̈ + Ṡ·ξ̇ (Eq. 21), ξ̈ = (s̈, θ̈1, θ̈2) (..., 3); f, τ and the hitch
    torque have no part along A. The force (...) is of the floor on both wheels together, positive
    to the tractor's right [N].
    """
    S = null_space(q)
    q_rate = np.einsum("...ij,...j", S, workspace_rate)
    q_acceleration = np.einsum("...ij,...j", S, workspace_acceleration) + np.einsum(
        "...ij,...j", null_space_rate(q, q_rate), workspace_rate
    )
    load = np.einsum("...ij,...j", mass_matrix(q, robot), q_acceleration) + bias(q, q_rate, robot)
    if gravity_m_s2 is not None:
        load = load + gravity(q, gravity_m_s2, robot)
    return np.asarray(np.einsum("...i,...i", constraint_matrix(q)[..., 0, :], load))


def _yaw_inertia(robot: RobotParameters) -> float:
    """J1 + m1·a1² of the tractor about P [kg·m²]."""
    return robot.tractor.yaw_inertia_kg_m2 + first_moments(robot)[0] * robot.tractor.com_offset_m


def _load_angle(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """θ2 − β − θ1: the hitch angle of the line from the COM to P."""
    return np.asarray(q[..., THETA2] - q[..., THETA1] - robot.lean_rad)
