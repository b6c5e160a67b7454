"""Eq. 11-23 (corrected) driven by wheel torques: what accelerations they give, and which they take.

Virtual work with Eq. 8-9 turns torques on the wheels into the forces of Eq. 18; for wheels of one
radius f = (τ_r + τ_l)/r and τ = b·(τ_r − τ_l)/r. The wheels and what their motors' rotors are at
the wheel spin along, which Table I leaves out: with J_w for each, 2·J_w/r² joins the mass of ṡ, and
b²-fold the inertia of θ1.

Beside the inertia act the hitch (spring, damper, dry friction), balls that resist, and gravity's
component along a floor that slopes (nomenclature's G(q)).
As in `kinetics`, functions work over any leading axes; ξ̇ = (ṡ, θ̇1, θ̇2).
"""

import numpy as np

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics.balls import direction, held_back
from ttwmr_mj.dynamics.ground import LEVEL, Ground
from ttwmr_mj.dynamics.hitch import spring_damper_torque
from ttwmr_mj.dynamics.kinematics import to_body, to_world, twist_from_wheels, wheels_from_twist
from ttwmr_mj.dynamics.kinetics import gravity, reduced_bias, reduced_mass_matrix
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray

FADING_RAD_S = 0.01  # dry friction fades below this hitch rate, a turn in ten minutes
FADING_M_S = 1e-3  # a ball's resistance fades below this speed


def wheel_jacobian(robot: RobotParameters) -> FloatArray:
    """(2, 2) wheel speeds (right, left) per u1 and per u2 (Eq. 8-9)."""
    return wheels_from_twist(np.eye(2), robot).T


def acceleration(
    q: FloatArray,
    workspace_rate: FloatArray,
    wheel_torque_n_m: FloatArray,
    robot: RobotParameters,
    ground: Ground = LEVEL,
) -> FloatArray:
    """(s̈, θ̈1, θ̈2) (..., 3) under wheel torques (..., 2) (right, left): Eq. 23 solved for ξ̈."""
    load = other_forces(q, workspace_rate, robot, ground) - reduced_bias(q, workspace_rate, robot)
    load[..., :2] += _times(wheel_jacobian(robot).T, wheel_torque_n_m)
    return np.asarray(np.linalg.solve(spun_mass_matrix(q, robot), load[..., None])[..., 0])


def inverse_dynamics(
    q: FloatArray,
    workspace_rate: FloatArray,
    twist_rate: FloatArray,
    robot: RobotParameters,
    ground: Ground = LEVEL,
) -> FloatArray:
    """Wheel torques (..., 2) that give P and the tractor (u̇1, u̇2) = (s̈, θ̈1) (..., 2).

    The trailer swings as Eq. 23's third row lets it.
    """
    load = other_forces(q, workspace_rate, robot, ground) - reduced_bias(q, workspace_rate, robot)
    mass = spun_mass_matrix(q, robot)
    swing = (load[..., 2] - mass[..., 2, 0] * twist_rate[..., 0]) / mass[..., 2, 2]
    force = _times(mass[..., :2, :2], twist_rate) - load[..., :2]
    force[..., 0] += mass[..., 0, 2] * swing
    # by virtual work a wheel's torque is the force times the motion per turn of that wheel
    return _times(twist_from_wheels(np.eye(2), robot), force)


def spun_mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """SᵀMS of Eq. 23 (..., 3, 3), wheels and rotors spinning along."""
    mass, jacobian = reduced_mass_matrix(q, robot), wheel_jacobian(robot)
    spin = wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
    # elementwise: a fused product would couple what equal wheels do not
    mass[..., :2, :2] += spin * np.add.reduce(jacobian[:, :, None] * jacobian[:, None], axis=0)
    return mass


def other_forces(
    q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters, ground: Ground
) -> FloatArray:
    """(..., 3) what hitch, balls and gravity do to (s, θ1, θ2) [N, N·m, N·m]."""
    force = _balls(q, workspace_rate, robot, ground)
    torque = hitch_torque(q, workspace_rate, robot)
    force[..., 1] -= torque
    force[..., 2] += torque
    G = gravity(q, ground.gravity_m_s2, robot)
    force[..., 0] -= to_body(q[..., THETA1], G[..., 0], G[..., 1])[0]
    force[..., 1:] -= G[..., THETA1:]
    return force


def hitch_torque(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Torque (...) of spring, damper and dry friction on the trailer [N·m]."""
    angle = q[..., THETA2] - q[..., THETA1]
    rate = workspace_rate[..., 2] - workspace_rate[..., 1]
    dry = robot.hitch.coulomb_friction_n_m * np.tanh(rate / FADING_RAD_S)
    return spring_damper_torque(angle, rate, robot.hitch) - dry


def _balls(
    q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters, ground: Ground
) -> FloatArray:
    force, lever = np.zeros_like(workspace_rate), robot.casters.rolling_resistance_m
    nose, right, left_one = held_back(robot, lever, ground.normal_gravity_m_s2)
    if not (nose or right or left_one):
        return force
    speed, turn1, turn2 = np.moveaxis(workspace_rate, -1, 0)
    reach = robot.casters.tractor_position_m
    ahead, left = direction(speed, reach * turn1, FADING_M_S)
    force[..., 0] -= nose * ahead
    force[..., 1] -= nose * reach * left
    hitch, length = q[..., THETA2] - q[..., THETA1], robot.trailer.com_offset_m
    along, across = to_body(hitch, speed, 0.0)
    spacing = robot.casters.trailer_half_spacing_m
    for side, tail in ((-spacing, right), (spacing, left_one)):
        ahead, left = direction(along - side * turn2, across - length * turn2, FADING_M_S)
        force[..., 0] -= tail * to_world(hitch, ahead, left)[0]
        force[..., 2] += tail * (length * left + side * ahead)
    return force


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Matrix (..., 2, 2) times vector (..., 2), the same bits whatever the batch."""
    return matrix[..., 0] * vector[..., :1] + matrix[..., 1] * vector[..., 1:]
