"""Eq. 11-23 (corrected) driven by wheel torques: what accelerations they give, and which they take.

Virtual work with Eq. 8-9 turns torques on the wheels into the forces of Eq. 18; for wheels of one
radius f = (τ_r + τ_l)/r and τ = b·(τ_r − τ_l)/r. The wheels and what their motors' rotors are at
the wheel spin along, which Table I leaves out: with J_w for each, 2·J_w/r² joins the mass of ṡ, and
b²-fold the inertia of θ1.

Beside the inertia act the hitches (spring, damper, dry friction), balls that resist, and gravity's
component along a floor that slopes (nomenclature's G(q)).
As in `kinetics`, functions work over any leading axes and any number n of trailers;
ξ̇ = (ṡ, θ̇1, θ̇2, …) (..., 2 + n).
"""

import numpy as np

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics.floor.balls import all_held_back, direction, train_drag
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.kinematics import to_body, twist_from_wheels, wheels_from_twist
from ttwmr_mj.dynamics.kinetics import add_hitches, gravity, reduced_bias, reduced_mass_matrix
from ttwmr_mj.dynamics.train import hitch_torques, solve
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray, hitch_angles

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
    """ξ̈ (..., 2 + n) under wheel torques (..., 2) (right, left): Eq. 23 solved for it."""
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

    The trailers swing as Eq. 23's rows from the third on let them.
    """
    load = other_forces(q, workspace_rate, robot, ground) - reduced_bias(q, workspace_rate, robot)
    mass = spun_mass_matrix(q, robot)
    swing = solve(mass[..., 2:, 2:], load[..., 2:] - mass[..., 2:, 0] * twist_rate[..., :1])
    force = _times(mass[..., :2, :2], twist_rate) - load[..., :2]
    for i in range(swing.shape[-1]):
        force[..., 0] += mass[..., 0, 2 + i] * swing[..., i]
    # by virtual work a wheel's torque is the force times the motion per turn of that wheel
    return _times(twist_from_wheels(np.eye(2), robot), force)


def spun_mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """SᵀMS of Eq. 23 (..., 2 + n, 2 + n), wheels and rotors spinning along."""
    mass, jacobian = reduced_mass_matrix(q, robot), wheel_jacobian(robot)
    spin = wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
    # elementwise: a fused product would couple what equal wheels do not
    mass[..., :2, :2] += spin * np.add.reduce(jacobian[:, :, None] * jacobian[:, None], axis=0)
    return mass


def other_forces(
    q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters, ground: Ground
) -> FloatArray:
    """(..., 2 + n) what hitches, balls and gravity do to (s, θ1, θ2, …) [N, N·m, N·m, …]."""
    force = _balls(q, workspace_rate, robot, ground)
    add_hitches(force, hitch_torque(q, workspace_rate, robot))
    G = gravity(q, ground.gravity_m_s2, robot)
    force[..., 0] -= to_body(q[..., THETA1], G[..., 0], G[..., 1])[0]
    force[..., 1:] -= G[..., THETA1:]
    return force


def hitch_torque(q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Torques (..., n) of springs, dampers and dry friction on the trailers behind them [N·m]."""
    rate = np.diff(workspace_rate[..., 1:], axis=-1)
    limit = np.array([hitch.coulomb_friction_n_m for hitch in robot.hitches])
    dry = limit * np.tanh(rate / FADING_RAD_S)
    return np.asarray(hitch_torques(hitch_angles(q), rate, robot) - dry)


def _balls(
    q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters, ground: Ground
) -> FloatArray:
    force = np.zeros_like(workspace_rate)
    forces = all_held_back(robot, ground.normal_gravity_m_s2)
    nose = forces[0].nose
    if not (nose or any(right or left for _, right, left in forces)):
        return force
    speed, turn1 = workspace_rate[..., 0], workspace_rate[..., 1]
    reach = robot.casters.tractor_position_m
    ahead, left = direction(speed, reach * turn1, FADING_M_S)
    force[..., 0] -= nose * ahead
    force[..., 1] -= nose * reach * left
    angle = q[..., THETA2:] - q[..., THETA1, None]
    pull, torque = train_drag(angle, workspace_rate[..., 2:], speed, robot, forces, FADING_M_S)
    force[..., 0] += pull
    force[..., 2:] += torque
    return force


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Matrix (..., 2, 2) times vector (..., 2), the same bits whatever the batch."""
    return matrix[..., 0] * vector[..., :1] + matrix[..., 1] * vector[..., 1:]
