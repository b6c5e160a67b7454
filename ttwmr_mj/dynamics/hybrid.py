"""Hybrid model (Eq. 24-29): a tractor that obeys, a trailer that swings.

All functions work over any leading axes. World frame, SI units. The state of Eq. 25 is
z = (x, ẋ, y, ẏ, θ2, θ̇2); its input v = (ẍ, ÿ) is the acceleration of P (Eq. 27-28).
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.dynamics.kinematics import to_world
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, FloatArray


def trailer_acceleration(
    theta2_rad: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
    hitch_torque_n_m: FloatArray | float = 0.0,
) -> FloatArray:
    """θ̈2 = (−ẍ sin θ2 + ÿ cos θ2)/k + T/(J2 + m2·l²) (Eq. 24, and Eq. 17 with a hitch torque).

    Any frame will do, as long as angle and acceleration are of the same: in the tractor's, θ2 − θ1
    goes with (u̇1, u1·u2).

    Args:
        theta2_rad: (...) trailer orientation.
        acceleration_m_s2: (..., 2) (ẍ, ÿ) of P.
        robot: Table I.
        hitch_torque_n_m: (...) torque of the hitch on the trailer.

    Returns:
        (...) [rad/s²].
    """
    pull = sideways(theta2_rad, acceleration_m_s2[..., 0], acceleration_m_s2[..., 1])
    return np.asarray(pull / robot.swing_length_m + hitch_torque_n_m / robot.swing_inertia_kg_m2)


def sideways(angle_rad: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """v·n (...) of vectors v = (x, y), n to the left of a trailer at an angle in their frame."""
    return np.asarray(y * np.cos(angle_rad) - x * np.sin(angle_rad))


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
    centripetal = twist[..., 0] * twist[..., 1]
    return np.stack(to_world(theta1_rad, surge_acceleration_m_s2, centripetal), axis=-1)


def z_from_q(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """State z (..., 6) (Eq. 25) of q and q_rate (..., 4); of θ1, the velocity's line stays."""
    return np.stack(
        [q[..., 0], q_rate[..., 0], q[..., 1], q_rate[..., 1], q[..., THETA2], q_rate[..., THETA2]],
        axis=-1,
    )


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
