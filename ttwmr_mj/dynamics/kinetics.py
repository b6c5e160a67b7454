"""Kinetic model (Eq. 11-23), with Eq. 23 as it follows from Eq. 14-17.

Printed Eq. 23 differs from its own derivation in three places: its first acceleration is s̈ and
not ẍ, and the second and third bias terms miss the factor ṡ. `reduced_bias` is the derived one,
`published_bias` the printed one.

Generalized forces: f pushes P along the heading, τ turns the tractor, λ acts along Aᵀ (Eq. 18,
positive to the tractor's right; Eq. 11 has the opposite sign of λ). A hitch torque T turns the
trailer by +T and the tractor by −T. All functions work over any leading axes, SI units.
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.dynamics.kinematics import constraint_matrix, null_space, null_space_rate
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray


def kinetic_energy(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Eq. 13 as ½·q̇ᵀM(q)q̇ (Eq. 12), (...) [J], of q and q_rate (..., 4)."""
    return np.asarray(0.5 * np.einsum("...i,...ij,...j", q_rate, mass_matrix(q, robot), q_rate))


def mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """M(q) of Eq. 18, symmetric positive definite.

    Args:
        q: (..., 4) generalized coordinates.
        robot: masses, inertias and offsets of Table I.

    Returns:
        (..., 4, 4) [kg, kg·m, kg·m²].
    """
    tractor, trailer = robot.tractor, robot.trailer
    nose = tractor.mass_kg * tractor.com_offset_m
    tail = trailer.mass_kg * trailer.com_offset_m
    theta1, theta2 = q[..., THETA1], q[..., THETA2]
    M = np.zeros((*q.shape[:-1], 4, 4))
    M[..., 0, 0] = M[..., 1, 1] = tractor.mass_kg + trailer.mass_kg
    M[..., 0, 2] = M[..., 2, 0] = -nose * np.sin(theta1)
    M[..., 1, 2] = M[..., 2, 1] = nose * np.cos(theta1)
    M[..., 0, 3] = M[..., 3, 0] = tail * np.sin(theta2)
    M[..., 1, 3] = M[..., 3, 1] = -tail * np.cos(theta2)
    M[..., 2, 2] = tractor.yaw_inertia_kg_m2 + nose * tractor.com_offset_m
    M[..., 3, 3] = robot.swing_inertia_kg_m2
    return M


def bias(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """V(q, q̇) of Eq. 18: centripetal terms of Eq. 14-15.

    Args:
        q: (..., 4) generalized coordinates.
        q_rate: (..., 4) their rates.
        robot: masses and offsets of Table I.

    Returns:
        (..., 4) [N, N, N·m, N·m]; the last two are zero.
    """
    tractor, trailer = robot.tractor, robot.trailer
    nose = tractor.mass_kg * tractor.com_offset_m * q_rate[..., THETA1] ** 2
    tail = trailer.mass_kg * trailer.com_offset_m * q_rate[..., THETA2] ** 2
    theta1, theta2 = q[..., THETA1], q[..., THETA2]
    V = np.zeros_like(q)
    V[..., 0] = tail * np.cos(theta2) - nose * np.cos(theta1)
    V[..., 1] = tail * np.sin(theta2) - nose * np.sin(theta1)
    return V


def input_matrix(q: FloatArray) -> FloatArray:
    """E(q) of Eq. 18, (..., 4, 2): generalized forces of f [N] and τ [N·m]."""
    E = np.zeros((*q.shape[:-1], 4, 2))
    E[..., 0, 0] = np.cos(q[..., THETA1])
    E[..., 1, 0] = np.sin(q[..., THETA1])
    E[..., 2, 1] = 1.0
    return E


def reduced_mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """SᵀMS of Eq. 23, (..., 3, 3), over the accelerations (s̈, θ̈1, θ̈2), for q (..., 4)."""
    tractor, trailer = robot.tractor, robot.trailer
    tail = trailer.mass_kg * trailer.com_offset_m
    mass = np.zeros((*q.shape[:-1], 3, 3))
    mass[..., 0, 0] = tractor.mass_kg + trailer.mass_kg
    mass[..., 0, 2] = mass[..., 2, 0] = tail * np.sin(q[..., THETA2] - q[..., THETA1])
    mass[..., 1, 1] = tractor.yaw_inertia_kg_m2 + tractor.mass_kg * tractor.com_offset_m**2
    mass[..., 2, 2] = robot.swing_inertia_kg_m2
    return mass


def reduced_bias(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Sᵀ(M·Ṡ·ξ̇ + V), the bias that Eq. 23 should have.

    (−m1·a1·θ̇1² + m2·l·cos(θ2−θ1)·θ̇2², m1·a1·ṡ·θ̇1, −m2·l·cos(θ2−θ1)·ṡ·θ̇1)

    Args:
        q: (..., 4) generalized coordinates.
        workspace_rate: (..., 3) ξ̇ = (ṡ, θ̇1, θ̇2).
        robot: masses and offsets of Table I.

    Returns:
        (..., 3) [N, N·m, N·m].
    """
    published = published_bias(q, workspace_rate, robot)
    speed = workspace_rate[..., 0]
    return np.stack(
        [published[..., 0], speed * published[..., 1], speed * published[..., 2]], axis=-1
    )


def published_bias(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """The bias as printed in Eq. 23, whose second and third terms miss the factor ṡ.

    For comparison only: those two terms have not even the unit of a torque. Arguments and shape
    are those of `reduced_bias`.
    """
    tractor, trailer = robot.tractor, robot.trailer
    nose = tractor.mass_kg * tractor.com_offset_m
    tail = trailer.mass_kg * trailer.com_offset_m * np.cos(q[..., THETA2] - q[..., THETA1])
    theta1_rate, theta2_rate = workspace_rate[..., 1], workspace_rate[..., 2]
    return np.stack(
        [
            tail * theta2_rate**2 - nose * theta1_rate**2,
            nose * theta1_rate,
            -tail * theta1_rate,
        ],
        axis=-1,
    )


def forward_acceleration(
    q: FloatArray,
    workspace_rate: FloatArray,
    force: FloatArray,
    hitch_torque_n_m: FloatArray | float,
    robot: RobotParameters,
) -> FloatArray:
    """Accelerations under given forces: Eq. 23 (derived form) solved for ξ̈.

    Args:
        q: (..., 4) generalized coordinates.
        workspace_rate: (..., 3) (ṡ, θ̇1, θ̇2).
        force: (..., 2) f [N] and τ [N·m].
        hitch_torque_n_m: (...) torque on the trailer; its opposite acts on the tractor.
        robot: Table I.

    Returns:
        (..., 3) (s̈, θ̈1, θ̈2) [m/s², rad/s², rad/s²].
    """
    load = -reduced_bias(q, workspace_rate, robot)
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
) -> FloatArray:
    """λ of Eq. 18: what keeps the wheels from slipping sideways.

    A·(M·q̈ + V) with q̈ = S·ξ̈ + Ṡ·ξ̇ (Eq. 21); f, τ and the hitch torque have no part along A.

    Args:
        q: (..., 4) generalized coordinates.
        workspace_rate: (..., 3) (ṡ, θ̇1, θ̇2).
        workspace_acceleration: (..., 3) (s̈, θ̈1, θ̈2).
        robot: Table I.

    Returns:
        (...) force of the floor on both wheels together, positive to the tractor's right [N].
    """
    S = null_space(q)
    q_rate = np.einsum("...ij,...j", S, workspace_rate)
    q_acceleration = np.einsum("...ij,...j", S, workspace_acceleration) + np.einsum(
        "...ij,...j", null_space_rate(q, q_rate), workspace_rate
    )
    inertial = np.einsum("...ij,...j", mass_matrix(q, robot), q_acceleration)
    return np.asarray(
        np.einsum("...i,...i", constraint_matrix(q)[..., 0, :], inertial + bias(q, q_rate, robot))
    )
