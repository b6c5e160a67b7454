"""Kinematic model (Eq. 1-10): the no-side-slip constraint, its null space, wheels and twist.

All functions work over any leading axes. World frame, SI units; q = (x, y, θ1, θ2) (Eq. 2).
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import LEFT, RIGHT, THETA1, FloatArray


def constraint_matrix(q: FloatArray) -> FloatArray:
    """A(q) = [sin θ1, −cos θ1, 0, 0] (Eq. 4).

    Args:
        q: (..., 4) generalized coordinates.

    Returns:
        (..., 1, 4) the constraint's row; a unit vector pointing to the tractor's right.
    """
    A = np.zeros((*q.shape[:-1], 1, 4))
    A[..., 0, 0] = np.sin(q[..., THETA1])
    A[..., 0, 1] = -np.cos(q[..., THETA1])
    return A


def constraint_residual(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """A(q)·q̇ = ẋ sin θ1 − ẏ cos θ1 (Eq. 3), zero without side slip.

    Args:
        q: (..., 4) generalized coordinates.
        q_rate: (..., 4) their rates.

    Returns:
        (...) speed of P towards the tractor's right [m/s].
    """
    theta1 = q[..., THETA1]
    return np.asarray(q_rate[..., 0] * np.sin(theta1) - q_rate[..., 1] * np.cos(theta1))


def null_space(q: FloatArray) -> FloatArray:
    """S(q) with A(q)·S(q) = 0 (Eq. 6).

    Args:
        q: (..., 4) generalized coordinates.

    Returns:
        (..., 4, 3) the columns are the motions ṡ, θ̇1, θ̇2.
    """
    S = np.zeros((*q.shape[:-1], 4, 3))
    S[..., 0, 0] = np.cos(q[..., THETA1])
    S[..., 1, 0] = np.sin(q[..., THETA1])
    S[..., 2, 1] = 1.0
    S[..., 3, 2] = 1.0
    return S


def null_space_rate(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """dS/dt (Eq. 21), (..., 4, 3), of q (..., 4) moving at q_rate (..., 4)."""
    S_rate = np.zeros((*q.shape[:-1], 4, 3))
    theta1_rate = q_rate[..., THETA1]
    S_rate[..., 0, 0] = -np.sin(q[..., THETA1]) * theta1_rate
    S_rate[..., 1, 0] = np.cos(q[..., THETA1]) * theta1_rate
    return S_rate


def q_rate(q: FloatArray, workspace_rate: FloatArray) -> FloatArray:
    """q̇ = S(q)·ξ̇ (Eq. 5, 10).

    Args:
        q: (..., 4) generalized coordinates.
        workspace_rate: (..., 3) ξ̇ = (ṡ, θ̇1, θ̇2) [m/s, rad/s, rad/s].

    Returns:
        (..., 4) rates of q [m/s, m/s, rad/s, rad/s].
    """
    theta1, speed = q[..., THETA1], workspace_rate[..., 0]
    return np.stack(
        [
            speed * np.cos(theta1),
            speed * np.sin(theta1),
            workspace_rate[..., 1],
            workspace_rate[..., 2],
        ],
        axis=-1,
    )


def workspace_rate(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """ξ̇ = Sᵀ(q)·q̇, the inverse of Eq. 5 for motions that respect the constraint.

    Args:
        q: (..., 4) generalized coordinates.
        q_rate: (..., 4) their rates; a sideways velocity of P is dropped.

    Returns:
        (..., 3) (ṡ, θ̇1, θ̇2) [m/s, rad/s, rad/s].
    """
    theta1 = q[..., THETA1]
    speed = q_rate[..., 0] * np.cos(theta1) + q_rate[..., 1] * np.sin(theta1)
    return np.stack([speed, q_rate[..., 2], q_rate[..., 3]], axis=-1)


def twist_from_wheels(wheel_speed_rad_s: FloatArray, robot: RobotParameters) -> FloatArray:
    """(u1, u2) of the tractor from its wheel speeds (Eq. 8-9).

    The factor of Eq. 9 is r divided by the track width 2b, not (r/2)·b.

    Args:
        wheel_speed_rad_s: (..., 2) right, left.
        robot: its tractor gives r and 2b.

    Returns:
        (..., 2) u1 = ṡ [m/s] and u2 = θ̇1 [rad/s].
    """
    tractor = robot.tractor
    right, left = wheel_speed_rad_s[..., RIGHT], wheel_speed_rad_s[..., LEFT]
    u1 = (0.5 * tractor.wheel_radius_m) * (right + left)
    u2 = (tractor.wheel_radius_m / tractor.track_width_m) * (right - left)
    return np.stack([u1, u2], axis=-1)


def wheels_from_twist(twist: FloatArray, robot: RobotParameters) -> FloatArray:
    """Wheel speeds (..., 2) (right, left) [rad/s] that give (u1, u2) (..., 2): Eq. 8-9 inverted."""
    forward, turn = twist[..., 0], robot.half_track_m * twist[..., 1]
    return np.stack([forward + turn, forward - turn], axis=-1) / robot.tractor.wheel_radius_m
