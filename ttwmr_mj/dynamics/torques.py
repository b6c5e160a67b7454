"""Eq. 11-23 (corrected) driven by wheel torques: what accelerations they give, and which they take.

Virtual work with Eq. 8-9 turns torques on the wheels into the forces of Eq. 18,
f = (τ_r + τ_l)/r and τ = b·(τ_r − τ_l)/r. The wheels and what their motors' rotors are at the wheel
spin along, which Table I leaves out: with J_w for each, 2·J_w/r² joins the mass of ṡ, and b²-fold
the inertia of θ1.

On a slope gravity's component along the floor pulls at both centres of mass (nomenclature's G(q)).
As in `kinetics`, functions work over any leading axes; ξ̇ = (ṡ, θ̇1, θ̇2).
"""

import numpy as np

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics.ground import LEVEL, Ground
from ttwmr_mj.dynamics.hitch import spring_damper_torque
from ttwmr_mj.dynamics.kinematics import to_body
from ttwmr_mj.dynamics.kinetics import gravity, reduced_bias, reduced_mass_matrix
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import LEFT, RIGHT, THETA1, THETA2, FloatArray

FADING_RAD_S = 0.01  # dry friction fades below this hitch rate, a turn in ten minutes


def forces_at_p(wheel_torque_n_m: FloatArray, robot: RobotParameters) -> FloatArray:
    """The f [N] and τ [N·m] of Eq. 18 (..., 2) that wheel torques (..., 2) (right, left) exert."""
    right, left = wheel_torque_n_m[..., RIGHT], wheel_torque_n_m[..., LEFT]
    radius, half_track = robot.tractor.wheel_radius_m, robot.half_track_m
    return np.stack([(right + left) / radius, (right - left) * (half_track / radius)], axis=-1)


def torques_for(force: FloatArray, robot: RobotParameters) -> FloatArray:
    """The inverse of `forces_at_p`."""
    drive, turn = 0.5 * force[..., 0], 0.5 * force[..., 1] / robot.half_track_m
    return np.asarray(robot.tractor.wheel_radius_m * np.stack([drive + turn, drive - turn], -1))


def acceleration(
    q: FloatArray,
    workspace_rate: FloatArray,
    wheel_torque_n_m: FloatArray,
    robot: RobotParameters,
    ground: Ground = LEVEL,
) -> FloatArray:
    """(s̈, θ̈1, θ̈2) (..., 3) under wheel torques (..., 2): Eq. 23 solved for ξ̈."""
    load = _load(q, workspace_rate, robot, ground)
    load[..., :2] += forces_at_p(wheel_torque_n_m, robot)
    mass = spun_mass_matrix(q, robot)
    # the tractor's turn stands alone, drive and swing are coupled
    a, b, c, d = mass[..., 0, 0], mass[..., 1, 1], mass[..., 0, 2], mass[..., 2, 2]
    scale = 1.0 / (a * d - c * c)
    drive = scale * (d * load[..., 0] - c * load[..., 2])
    swing = scale * (a * load[..., 2] - c * load[..., 0])
    return np.stack([drive, load[..., 1] / b, swing], axis=-1)


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
    mass, load = spun_mass_matrix(q, robot), _load(q, workspace_rate, robot, ground)
    swing = (load[..., 2] - mass[..., 2, 0] * twist_rate[..., 0]) / mass[..., 2, 2]
    drive = mass[..., 0, 0] * twist_rate[..., 0] + mass[..., 0, 2] * swing - load[..., 0]
    turn = mass[..., 1, 1] * twist_rate[..., 1] - load[..., 1]
    return torques_for(np.stack([drive, turn], axis=-1), robot)


def spun_mass_matrix(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """SᵀMS of Eq. 23 (..., 3, 3), wheels and rotors spinning along."""
    mass = reduced_mass_matrix(q, robot)
    spin = wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
    added = 2.0 * spin / robot.tractor.wheel_radius_m**2
    mass[..., 0, 0] += added
    mass[..., 1, 1] += added * robot.half_track_m**2
    return mass


def hitch_torque(
    q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters, fading_rad_s: float
) -> FloatArray:
    """Torque (...) of spring, damper and dry friction on the trailer [N·m]."""
    angle = q[..., THETA2] - q[..., THETA1]
    rate = workspace_rate[..., 2] - workspace_rate[..., 1]
    dry = robot.hitch.coulomb_friction_n_m * np.tanh(rate / fading_rad_s)
    return spring_damper_torque(angle, rate, robot.hitch) - dry


def _load(
    q: FloatArray, workspace_rate: FloatArray, robot: RobotParameters, ground: Ground
) -> FloatArray:
    """(..., 3) all that acts on (s, θ1, θ2) but the wheels: inertia, hitch and gravity."""
    load = -reduced_bias(q, workspace_rate, robot)
    torque = hitch_torque(q, workspace_rate, robot, FADING_RAD_S)
    load[..., 1] -= torque
    load[..., 2] += torque
    G = gravity(q, ground.gravity_m_s2, robot)
    load[..., 0] -= to_body(q[..., THETA1], G[..., 0], G[..., 1])[0]
    load[..., 1:] -= G[..., THETA1:]
    return load
