"""Kinetic model (Eq. 11-23), with Eq. 23 as it follows from Eq. 14-17.

Printed Eq. 23 differs from its own derivation in three places: its first acceleration is s̈ and
not ẍ, and the second and third bias terms miss the factor ṡ. `reduced_bias` is the derived one,
`published_bias` the printed one.

Generalized forces: f pushes P along the heading, τ turns the tractor, λ acts along Aᵀ (Eq. 18,
positive to the tractor's right; Eq. 11 has the opposite sign of λ). A hitch torque T turns the
trailer by +T and what tows it by −T. On a floor that slopes, gravity adds G(q) to the left side of
Eq. 18.

All functions work over any leading axes, SI units. Everywhere, q and q_rate (..., 3 + n) are the
generalized coordinates and their rates, workspace_rate (..., 2 + n) is ξ̇ = (ṡ, θ̇1, θ̇2, …), and
robot gives masses, inertias and offsets of Table I. The article has one trailer, n = 1; what more
of them add to Eq. 18 and 23 is in `train`.
"""

from collections.abc import Iterator

import numpy as np

from ttwmr_mj.dynamics.kinematics import constraint_matrix, null_space, null_space_rate, to_body
from ttwmr_mj.dynamics.train import Link, links, on_trailers, swing_bias, swing_matrix
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray


def first_moments(robot: RobotParameters) -> tuple[float, float]:
    """m1·a1 of the tractor and m2·l of the first trailer about P [kg·m], with what it tows.

    The trailer's acts at θ2 − β, the direction of its COM (`train.Link`).
    """
    tractor = robot.tractor
    return tractor.mass_kg * tractor.com_offset_m, links(robot)[0].moment_kg_m


def total_mass(robot: RobotParameters) -> float:
    """Of the tractor and all trailers [kg]."""
    mass = robot.tractor.mass_kg
    for trailer in robot.trailers:
        mass = mass + trailer.mass_kg
    return mass


def kinetic_energy(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Eq. 13 as ½·q̇ᵀM(q)q̇ (Eq. 12), (...) [J]."""
    return np.asarray(0.5 * np.einsum("...i,...ij,...j", q_rate, mass_matrix(q, robot), q_rate))


def mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """M(q) of Eq. 18, (..., 3 + n, 3 + n) [kg, kg·m, kg·m²], symmetric positive definite."""
    nose, _ = first_moments(robot)
    theta1 = q[..., THETA1]
    M = np.zeros((*q.shape, q.shape[-1]))
    M[..., 0, 0] = M[..., 1, 1] = total_mass(robot)
    M[..., 0, 2] = M[..., 2, 0] = -nose * np.sin(theta1)
    M[..., 1, 2] = M[..., 2, 1] = nose * np.cos(theta1)
    M[..., 2, 2] = _yaw_inertia(robot)
    M[..., THETA2:, THETA2:] = swing_matrix(q[..., THETA2:], robot)
    for i, link in _columns(robot):
        angle = q[..., i] - link.lean_rad
        M[..., 0, i] = M[..., i, 0] = link.moment_kg_m * np.sin(angle)
        M[..., 1, i] = M[..., i, 1] = -link.moment_kg_m * np.cos(angle)
    return M


def bias(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """V(q, q̇) of Eq. 18, (..., 3 + n) [N, N, N·m, …]: centripetal terms of Eq. 14-15, no torques.

    With n > 1 also what the trailers do to each other as they turn.
    """
    nose, _ = first_moments(robot)
    forward, theta1 = nose * q_rate[..., THETA1] ** 2, q[..., THETA1]
    V = np.zeros_like(q)
    for i, link in _columns(robot):
        backward, angle = link.moment_kg_m * q_rate[..., i] ** 2, q[..., i] - link.lean_rad
        V[..., 0] += backward * np.cos(angle)
        V[..., 1] += backward * np.sin(angle)
    V[..., 0] -= forward * np.cos(theta1)
    V[..., 1] -= forward * np.sin(theta1)
    V[..., THETA2:] = swing_bias(q[..., THETA2:], q_rate[..., THETA2:], robot)
    return V


def gravity(q: FloatArray, gravity_m_s2: FloatArray, robot: RobotParameters) -> FloatArray:
    """G(q) of the nomenclature, (..., 3 + n) [N, N, N·m, …]: the gradient of −Σ m·g_p·r of COMs r.

    The pull g_p along the floor is (..., 2), world frame. Beside Eq. 18's V it stands on the left:
    M·q̈ + V + G.
    """
    nose, _ = first_moments(robot)
    x, y = np.moveaxis(np.asarray(gravity_m_s2), -1, 0)
    G = np.zeros_like(q)
    mass = total_mass(robot)
    G[..., 0], G[..., 1] = -mass * x, -mass * y
    G[..., 2] = -nose * to_body(q[..., THETA1], x, y)[1]
    for i, link in _columns(robot):
        G[..., i] = link.moment_kg_m * to_body(q[..., i] - link.lean_rad, x, y)[1]
    return G


def input_matrix(q: FloatArray) -> FloatArray:
    """E(q) of Eq. 18, (..., 3 + n, 2): generalized forces of f [N] and τ [N·m]."""
    return null_space(q)[..., :2]


def reduced_mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """SᵀMS of Eq. 23, (..., 2 + n, 2 + n), over the accelerations (s̈, θ̈1, θ̈2, …)."""
    width = q.shape[-1] - 1
    mass = np.zeros((*q.shape[:-1], width, width))
    mass[..., 0, 0] = total_mass(robot)
    mass[..., 1, 1] = _yaw_inertia(robot)
    mass[..., 2:, 2:] = swing_matrix(q[..., THETA2:], robot)
    for i, link in _columns(robot):
        coupling = link.moment_kg_m * np.sin(_load_angle(q, i, link))
        mass[..., 0, i - 1] = mass[..., i - 1, 0] = coupling
    return mass


def reduced_bias(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Sᵀ(M·Ṡ·ξ̇ + V), the bias that Eq. 23 should have, (..., 2 + n) [N, N·m, N·m, …].

    (−m1·a1·θ̇1² + m2·l·cos(θ2−θ1)·θ̇2², m1·a1·ṡ·θ̇1, −m2·l·cos(θ2−θ1)·ṡ·θ̇1) for one trailer; more
    of them add to each other's rows what `train` has of it.
    """
    reduced = published_bias(q, workspace_rate, robot)
    reduced[..., 1:] *= workspace_rate[..., :1]
    if len(robot.trailers) > 1:
        reduced[..., 2:] += swing_bias(q[..., THETA2:], workspace_rate[..., 2:], robot)
    return reduced


def published_bias(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """The bias as printed in Eq. 23, whose second and third terms miss the factor ṡ.

    For comparison only: those two terms have not even the unit of a torque. Shape as
    `reduced_bias`.
    """
    nose, _ = first_moments(robot)
    theta1_rate = workspace_rate[..., 1]
    terms = np.zeros_like(workspace_rate)
    for i, link in _columns(robot):
        pull = link.moment_kg_m * np.cos(_load_angle(q, i, link))
        terms[..., 0] += pull * workspace_rate[..., i - 1] ** 2
        terms[..., i - 1] = -pull * theta1_rate
    terms[..., 0] -= nose * theta1_rate**2
    terms[..., 1] = nose * theta1_rate
    return terms


def forward_acceleration(
    q: FloatArray,
    workspace_rate: FloatArray,
    force: FloatArray,
    hitch_torque_n_m: FloatArray | float,
    robot: RobotParameters,
    gravity_m_s2: FloatArray | None = None,
) -> FloatArray:
    """Accelerations (s̈, θ̈1, θ̈2, …) (..., 2 + n) under forces: Eq. 23 (derived) solved for ξ̈.

    The force (..., 2) is f [N] and τ [N·m]; the hitches' torques are as of `add_hitches`. Gravity
    (2,) pulls along the floor; None: it is level.
    """
    load = -reduced_bias(q, workspace_rate, robot)
    if gravity_m_s2 is not None:
        load -= np.einsum("...ji,...j", null_space(q), gravity(q, gravity_m_s2, robot))
    load[..., :2] += force
    add_hitches(load, hitch_torque_n_m)
    solution = np.linalg.solve(reduced_mass_matrix(q, robot), load[..., None])
    return np.asarray(solution[..., 0])


def add_hitches(load: FloatArray, torque_n_m: FloatArray | float) -> None:
    """Add hitch torques to forces (..., 2 + n) on (s, θ1, θ2, …), in place.

    A torque acts on the trailer behind its hitch, its opposite on what tows that. Torques are
    (..., n), or those of the first hitch alone: a number, or (...).
    """
    torque = np.asarray(torque_n_m, dtype=np.float64)
    if torque.shape != (*load.shape[:-1], load.shape[-1] - 2):
        first, torque = torque, np.zeros((*load.shape[:-1], load.shape[-1] - 2))
        torque[..., 0] = first
    load[..., 1] -= torque[..., 0]
    load[..., 2:] += on_trailers(torque)


def lateral_force(
    q: FloatArray,
    workspace_rate: FloatArray,
    workspace_acceleration: FloatArray,
    robot: RobotParameters,
    gravity_m_s2: FloatArray | None = None,
) -> FloatArray:
    """λ of Eq. 18: what keeps the wheels from slipping sideways.

    A·(M·q̈ + V + G) with q̈ = S·ξ̈ + Ṡ·ξ̇ (Eq. 21), ξ̈ = (s̈, θ̈1, θ̈2, …) (..., 2 + n); f, τ and the
    hitches' torques have no part along A. The force (...) is of the floor on both wheels together,
    positive to the tractor's right [N].
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


def _columns(robot: RobotParameters) -> Iterator[tuple[int, Link]]:
    """Every trailer with the column of its angle in q."""
    return enumerate(links(robot), start=THETA2)


def _load_angle(q: FloatArray, i: int, link: Link) -> FloatArray:
    """Column i's θ − β − θ1: the angle on the tractor of the line from the load to the hitch."""
    return np.asarray(q[..., i] - q[..., THETA1] - link.lean_rad)
