"""What acts on the trailer beside its hinge's motion: slope, resisting balls, hitch friction.

Five numbers, the same for a controller that knows them and for one that has to find them out:

    k·θ̈2 = (P'' − g_p)·n + c·½Σ(v̂·n ± (s/l)·v̂·t) + k·(friction's θ̈2)

g_p is gravity along the floor (`ground`). Two balls that resist (`balls`), s to either side of the
COM, hold the trailer back with the force c per mass, each half of it against its velocity v: nearly
as if gravity pulled along −v̂. The hitch's dry and viscous friction act against θ̇2 − θ̇1.
"""

import numpy as np

from ttwmr_mj.dynamics.flatness import dot, trailer_axes, velocity_behind
from ttwmr_mj.dynamics.floor.balls import Forces, torque_about_p
from ttwmr_mj.dynamics.floor.balls import held_back as forces_on_balls
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

GRAVITY = slice(0, 2)  # g_p, x and y [m/s²]
DRAG, DRY, VISCOUS = 2, 3, 4  # c [m/s²], dry friction [rad/s²], viscous friction [1/s]
INFLUENCES = 5
FADING_M_S = 1e-3  # a trailer slower than this is held back by less: no direction jumps at rest

EVENLY = Forces(0.0, 0.5, 0.5)  # a law does not ask which of the trailer's balls resists more


def influence_of(robot: RobotParameters, ground: Ground) -> FloatArray:
    """(5,) what acts on the first trailer of a robot whose numbers are all known."""
    hitch, inertia = robot.hitch, robot.swing_inertia_kg_m2
    _, right, left = forces_on_balls(
        robot, robot.casters.rolling_resistance_m, ground.normal_gravity_m_s2
    )
    drag = (right + left) / robot.trailer.mass_kg
    friction = hitch.coulomb_friction_n_m / inertia, hitch.damping_n_m_s_rad / inertia
    return np.array([*ground.gravity_m_s2, drag, *friction])


def held_back(
    drag_m_s2: FloatArray,
    along_m_s: FloatArray,
    across_m_s: FloatArray,
    turn_rad_s: FloatArray,
    robot: RobotParameters,
) -> FloatArray:
    """(...) what resisting balls add to k·θ̈2 [m/s²].

    Args:
        drag_m_s2: c.
        along_m_s: velocity of the trailer's COM along the trailer.
        across_m_s: the same to its left.
        turn_rad_s: θ̇2.
        robot: where the balls are: on either side of the COM.
    """
    torque = torque_about_p(along_m_s, across_m_s, turn_rad_s, robot, EVENLY, FADING_M_S)
    return np.asarray(drag_m_s2 * torque / robot.trailer.com_distance_m)


def held_back_moving(
    drag_m_s2: FloatArray,
    velocity_m_s: FloatArray,
    theta2_rad: FloatArray,
    turn_rad_s: FloatArray,
    robot: RobotParameters,
) -> FloatArray:
    """(...) the same of the velocity (..., 2) of P, θ2 and θ̇2."""
    t, n = trailer_axes(theta2_rad)
    com = velocity_behind(velocity_m_s, theta2_rad, turn_rad_s, robot.trailer.com_offset_m)
    return held_back(drag_m_s2, dot(com, t), dot(com, n), turn_rad_s, robot)
