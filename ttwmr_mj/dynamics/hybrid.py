"""Hybrid model (Eq. 24-29): a tractor with prescribed motion, a trailer that swings.

All functions work over any leading axes, world frame, SI units. The state of Eq. 25 is
z = (x, ẋ, y, ẏ, θ2, θ̇2) (..., 6); its input v = (ẍ, ÿ) (..., 2) is the acceleration of P
(Eq. 27-28); a hitch torque T (...) [N·m] acts on the trailer.
"""

import numpy as np

from ttwmr_mj.dynamics.kinematics import to_world
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, FloatArray, X, Y


def trailer_acceleration(
    theta2_rad: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
    hitch_torque_n_m: FloatArray | float = 0.0,
) -> FloatArray:
    """θ̈2 = (−ẍ sin θ2 + ÿ cos θ2)/k + T/(J2 + m2·l²) (Eq. 24, and Eq. 17 with a hitch torque).

    Any frame will do, as long as angle and acceleration are of the same: in the tractor's, θ2 − θ1
    goes with (u̇1, u1·u2). θ2 and the result are (...) [rad, rad/s²]. On a slope, gravity's pull
    along the floor is taken off the acceleration: v − g_p stands for v.
    """
    swung = theta2_rad - robot.lean_rad
    pull = sideways(swung, acceleration_m_s2[..., 0], acceleration_m_s2[..., 1])
    return np.asarray(pull / robot.swing_length_m + hitch_torque_n_m / robot.swing_inertia_kg_m2)


def sideways(angle_rad: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """v·n (...) of vectors v = (x, y), n to the left of a trailer at an angle in their frame."""
    return np.asarray(y * np.cos(angle_rad) - x * np.sin(angle_rad))


def acceleration_from_twist(
    theta1_rad: FloatArray, twist: FloatArray, surge_acceleration_m_s2: FloatArray
) -> FloatArray:
    """Input v (..., 2) of θ1 (...), twist (u1, u2) (..., 2) and u̇1 (...) (Eq. 27-28) [m/s²]."""
    centripetal = twist[..., 0] * twist[..., 1]
    return np.stack(to_world(theta1_rad, surge_acceleration_m_s2, centripetal), axis=-1)


def z_from_q(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """State z (..., 6) (Eq. 25) of q and q_rate (..., 4); of θ1, the velocity's line stays."""
    pairs = np.stack([q, q_rate], axis=-1)[..., [X, Y, THETA2], :]
    return pairs.reshape(*q.shape[:-1], 6)


def z_rate(
    z: FloatArray, v: FloatArray, robot: RobotParameters, hitch_torque_n_m: FloatArray | float = 0.0
) -> FloatArray:
    """ż (..., 6) (Eq. 29, with a hitch torque as in Eq. 42)."""
    theta2_acceleration = trailer_acceleration(z[..., 4], v, robot, hitch_torque_n_m)
    return np.stack(
        [z[..., 1], v[..., 0], z[..., 3], v[..., 1], z[..., 5], theta2_acceleration], axis=-1
    )
