"""Hybrid model (Eq. 24-29): a tractor that obeys, a trailer that swings; and its flat output.

All functions work over any leading axes. World frame, SI units. The state of Eq. 25 is
z = (x, ẋ, y, ẏ, θ2, θ̇2); its input v = (ẍ, ÿ) is the acceleration of P (Eq. 27-28).
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, FloatArray, wrap


def trailer_acceleration(
    theta2_rad: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
    hitch_torque_n_m: FloatArray | float = 0.0,
) -> FloatArray:
    """θ̈2 = (−ẍ sin θ2 + ÿ cos θ2)/k + T/(J2 + m2·l²) (Eq. 24, and Eq. 17 with a hitch torque).

    Args:
        theta2_rad: (...) trailer orientation.
        acceleration_m_s2: (..., 2) (ẍ, ÿ) of P.
        robot: Table I.
        hitch_torque_n_m: (...) torque of the hitch on the trailer.

    Returns:
        (...) [rad/s²].
    """
    sideways = acceleration_m_s2[..., 1] * np.cos(theta2_rad) - acceleration_m_s2[..., 0] * np.sin(
        theta2_rad
    )
    return np.asarray(
        sideways / robot.swing_length_m + hitch_torque_n_m / robot.swing_inertia_kg_m2
    )


def acceleration_from_twist(
    theta1_rad: FloatArray, twist: FloatArray, surge_acceleration_m_s2: FloatArray
) -> FloatArray:
    """Acceleration v = (ẍ, ÿ) of P from the tractor's motion (Eq. 27-28).

    Args:
        theta1_rad: (...) heading.
        twist: (..., 2) (u1, u2) [m/s, rad/s].
        surge_acceleration_m_s2: (...) u̇1.

    Returns:
        (..., 2) (v1, v2) [m/s²].
    """
    cos, sin = np.cos(theta1_rad), np.sin(theta1_rad)
    centripetal = twist[..., 0] * twist[..., 1]
    return np.stack(
        [
            surge_acceleration_m_s2 * cos - centripetal * sin,
            surge_acceleration_m_s2 * sin + centripetal * cos,
        ],
        axis=-1,
    )


def z_from_q(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """State z (..., 6) (Eq. 25) of q and q_rate (..., 4); of θ1, the velocity's line stays."""
    return np.stack(
        [q[..., 0], q_rate[..., 0], q[..., 1], q_rate[..., 1], q[..., THETA2], q_rate[..., THETA2]],
        axis=-1,
    )


def heading_from_z(z: FloatArray, near_rad: FloatArray) -> FloatArray:
    """θ1 (...) [rad] of the moving state z (..., 6), the one closest to a known heading.

    The velocity gives the heading up to a half turn (the robot may drive backwards); the
    representative within π/2 of `near_rad` (...) is returned. At rest the direction is undefined
    and atan2(0, 0) = 0 decides.
    """
    direction = np.arctan2(z[..., 3], z[..., 1])
    half_turn = 0.5 * wrap(2.0 * (direction - near_rad))
    return np.asarray(near_rad + half_turn)


def z_rate(
    z: FloatArray,
    v: FloatArray,
    robot: RobotParameters,
    hitch_torque_n_m: FloatArray | float = 0.0,
) -> FloatArray:
    """ż (Eq. 29, with a hitch torque as in Eq. 42).

    Args:
        z: (..., 6) state of Eq. 25.
        v: (..., 2) input of Eq. 27-28 [m/s²].
        robot: Table I.
        hitch_torque_n_m: (...) torque of the hitch on the trailer.

    Returns:
        (..., 6) time derivative of z.
    """
    theta2_acceleration = trailer_acceleration(z[..., 4], v, robot, hitch_torque_n_m)
    return np.stack(
        [z[..., 1], v[..., 0], z[..., 3], v[..., 1], z[..., 5], theta2_acceleration], axis=-1
    )


def z_rate_jacobians(
    z: FloatArray, v: FloatArray, robot: RobotParameters
) -> tuple[FloatArray, FloatArray]:
    """∂ż/∂z (..., 6, 6) and ∂ż/∂v (..., 6, 2) of Eq. 29 (free hitch), at z (..., 6), v (..., 2)."""
    K = robot.swing_length_m
    cos, sin = np.cos(z[..., 4]), np.sin(z[..., 4])
    by_z = np.zeros((*z.shape[:-1], 6, 6))
    by_z[..., [0, 2, 4], [1, 3, 5]] = 1.0
    by_z[..., 5, 4] = -(v[..., 0] * cos + v[..., 1] * sin) / K
    by_v = np.zeros((*z.shape[:-1], 6, 2))
    by_v[..., 1, 0] = by_v[..., 3, 1] = 1.0
    by_v[..., 5, 0] = -sin / K
    by_v[..., 5, 1] = cos / K
    return by_z, by_v


def swing_energy(
    hitch_angle_rad: FloatArray,
    hitch_rate_rad_s: FloatArray,
    twist: FloatArray,
    robot: RobotParameters,
) -> FloatArray:
    """Energy of the free trailer's swing while the tractor keeps its twist.

    With u1, u2 constant the hitch angle φ obeys φ̈ = u1·u2·cos φ / k: a pendulum in the
    centrifugal field, whose ½φ̇² − (u1·u2/k)·sin φ is constant. Its minimum, φ = +π/2 for
    u1·u2 > 0, is the trailer pointing radially outward.

    Args:
        hitch_angle_rad: (...) θ2 − θ1.
        hitch_rate_rad_s: (...) θ̇2 − θ̇1.
        twist: (..., 2) (u1, u2) [m/s, rad/s].
        robot: Table I.

    Returns:
        (...) [J], zero at rest with the trailer aligned.
    """
    field = twist[..., 0] * twist[..., 1] / robot.swing_length_m
    swing = 0.5 * hitch_rate_rad_s**2 - field * np.sin(hitch_angle_rad)
    return np.asarray(robot.swing_inertia_kg_m2 * swing)


def flat_output(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """F = P − k·(cos θ2, sin θ2), (..., 2) [m]: the trailer's centre of oscillation."""
    return q[..., :2] - robot.swing_length_m * _along(q[..., THETA2])


def flat_output_velocity(q: FloatArray, q_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Ḟ = Ṗ − k·θ̇2·(−sin θ2, cos θ2), (..., 2) [m/s]."""
    along = _along(q[..., THETA2])
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    turning = (robot.swing_length_m * q_rate[..., THETA2])[..., None]
    return q_rate[..., :2] - turning * across


def flat_output_acceleration(
    theta2_rad: FloatArray,
    theta2_rate_rad_s: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
) -> FloatArray:
    """F̈ = (v·t + k·θ̇2²)·t with t = (cos θ2, sin θ2), for a free hitch (Eq. 24).

    F accelerates along the trailer only, so θ2 can be read from the path of F wherever F̈ ≠ 0.

    Args:
        theta2_rad: (...) trailer orientation.
        theta2_rate_rad_s: (...) its rate.
        acceleration_m_s2: (..., 2) v = (ẍ, ÿ) of P.
        robot: Table I.

    Returns:
        (..., 2) [m/s²].
    """
    along = _along(theta2_rad)
    size = (acceleration_m_s2 * along).sum(axis=-1) + robot.swing_length_m * theta2_rate_rad_s**2
    return np.asarray(size[..., None] * along)


def _along(theta2_rad: FloatArray) -> FloatArray:
    """Unit vector (..., 2) from the trailer's tail to P."""
    return np.stack([np.cos(theta2_rad), np.sin(theta2_rad)], axis=-1)
