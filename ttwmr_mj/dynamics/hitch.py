"""Torque of the hitch joint on the trailer (Eq. 38-41): spring, damper, dry friction.

The hitch angle is θ2 − θ1 and its rate θ̇2 − θ̇1. Every torque here acts on the trailer, its
opposite on the tractor. All functions are elementwise over arrays of any shape.
"""

import numpy as np

from ttwmr_mj.robot import Hitch, RobotParameters
from ttwmr_mj.state import FloatArray


def spring_damper_torque(
    hitch_angle_rad: FloatArray, hitch_rate_rad_s: FloatArray, hitch: Hitch
) -> FloatArray:
    """k_t·(θ1−θ2) + c_t·(θ̇1−θ̇2) [N·m], from the potentials of Eq. 39-40."""
    return -hitch.stiffness_n_m_rad * hitch_angle_rad - hitch.damping_n_m_s_rad * hitch_rate_rad_s


def spring_damper_acceleration(
    hitch_angle_rad: FloatArray, hitch_rate_rad_s: FloatArray, robot: RobotParameters
) -> FloatArray:
    """What spring and damper add to θ̈2 [rad/s²]: their torque over J2 + m2·l² (Eq. 17)."""
    torque = spring_damper_torque(hitch_angle_rad, hitch_rate_rad_s, robot.hitch)
    return torque / robot.swing_inertia_kg_m2


def published_spring_acceleration(
    hitch_angle_rad: FloatArray, hitch_rate_rad_s: FloatArray, robot: RobotParameters
) -> FloatArray:
    """The same as printed in Eq. 41, where the torque is divided by k alone.

    The factor m2·l is missing, so the printed gains act m2·l times as strong as a torque would:
    "200" stands for 9.3 N·m/rad with Table I. For reproduction only.
    """
    torque = spring_damper_torque(hitch_angle_rad, hitch_rate_rad_s, robot.hitch)
    return torque / robot.swing_length_m


def rub(hitch_rate_rad_s: FloatArray, impulse_rad_s: FloatArray | float) -> FloatArray:
    """The hitch's rate after dry friction that could change it by so much: nearer to rest.

    Friction stops the hitch where it can, and never reverses its motion.
    """
    left = np.maximum(np.abs(hitch_rate_rad_s) - impulse_rad_s, 0.0)
    return np.asarray(np.copysign(left, hitch_rate_rad_s))
