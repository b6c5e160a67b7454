"""Balls that resist: what rolling resistance and friction in their sockets cost.

A ball of radius ρ under a load N that rolls is held back by the force δ·N/ρ of rolling resistance,
δ the lever by which the floor's pressure runs ahead, and by τ/ρ of the dry torque τ in its socket.
Both act at its point of contact, against the ball's velocity over the floor, whatever its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.kinematics import Value, to_body, to_world
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

FADING_M_S = 1e-4  # resistance fades below this speed, where its direction is undefined


class Forces(NamedTuple):
    """Against the motion of the nose's ball and of one trailer's; one each, or (nsim,) [N]."""

    nose: Value
    right: Value
    left: Value


def ball_loads(
    robot: RobotParameters, weight_m_s2: float, index: int = 0
) -> tuple[float, float, float]:
    """Loads [N] of the nose's ball and of a trailer's (right, left), standing; 0: the first.

    A trailer's balls are beside its COM and carry it alone.
    """
    tractor, trailer = robot.tractor, robot.trailers[index]
    nose = tractor.mass_kg * tractor.com_offset_m / robot.casters.tractor_position_m
    aside = 0.5 * trailer.com_lateral_m / robot.casters.trailer_half_spacing_m
    weight = trailer.mass_kg * weight_m_s2
    return nose * weight_m_s2, (0.5 - aside) * weight, (0.5 + aside) * weight


def held_back(robot: RobotParameters, lever_m: Value, weight_m_s2: float, index: int = 0) -> Forces:
    """Forces [N] that hold back the nose's ball and a trailer's (right, left) as they roll."""
    return Forces(*(resistance(robot, lever_m, n) for n in ball_loads(robot, weight_m_s2, index)))


def all_held_back(robot: RobotParameters, weight_m_s2: float) -> tuple[Forces, ...]:
    """The same of every trailer, front to back, with the robot's own lever."""
    lever = robot.casters.rolling_resistance_m
    return tuple(held_back(robot, lever, weight_m_s2, i) for i in range(len(robot.trailers)))


def resistance(robot: RobotParameters, lever_m: Value, load_n: float) -> Value:
    """Force [N] that holds back one ball that rolls with a lever δ under a load."""
    casters = robot.casters
    return lever_m / casters.radius_m * load_n + casters.socket_friction_n_m / casters.radius_m


def slowing(forces: Forces, length_m: Value, inertia_kg_m2: Value = 1.0) -> Value:
    """By what a trailer that swings about P slows its balls at most [m/s²].

    Args:
        forces: that hold them back [N]; or these over the inertia.
        length_m: from P to the trailer's COM.
        inertia_kg_m2: of the trailer about P.
    """
    return (forces.right + forces.left) * length_m**2 / inertia_kg_m2


def resisting_torque(
    hitch_rad: FloatArray,
    p_speed: tuple[FloatArray, Value],
    theta2_rate: FloatArray,
    robot: RobotParameters,
    forces: Forces,
    fading_m_s: Value = FADING_M_S,
) -> FloatArray:
    """(nsim,) torque about P [N·m] of what holds back the trailer's balls.

    Args:
        hitch_rad: (nsim,) θ2 − θ1.
        p_speed: velocity of P ahead and to the left in the tractor's frame [m/s].
        theta2_rate: (nsim,) [rad/s].
        robot: where its balls are.
        forces: that hold them back [N], or anything in proportion.
        fading_m_s: a slower ball is held back by less.
    """
    along, across = to_body(hitch_rad, *p_speed)
    across = across - robot.trailer.com_offset_m * theta2_rate
    return torque_about_p(along, across, theta2_rate, robot, forces, fading_m_s)


def torque_about_p(
    along_m_s: FloatArray,
    across_m_s: FloatArray,
    theta2_rate: FloatArray,
    robot: RobotParameters,
    forces: Forces,
    fading_m_s: Value = FADING_M_S,
) -> FloatArray:
    """The same, of the velocity of the balls' middle along the trailer and to its left."""
    length, spacing = robot.trailer.com_offset_m, robot.casters.trailer_half_spacing_m
    torque = np.zeros_like(along_m_s)
    for side, force in ((-spacing, forces.right), (spacing, forces.left)):
        ahead, left = direction(along_m_s - side * theta2_rate, across_m_s, fading_m_s)
        torque += force * (length * left + side * ahead)
    return torque


def train_drag(
    angle_rad: FloatArray,
    rate_rad_s: FloatArray,
    speed_m_s: FloatArray,
    robot: RobotParameters,
    forces: Sequence[Forces],
    fading_m_s: Value = FADING_M_S,
) -> tuple[FloatArray, FloatArray]:
    """What the balls of all trailers do to P and to the trailers.

    Args:
        angle_rad: (..., n) of the trailers on the tractor: θ2 − θ1, θ3 − θ1, …
        rate_rad_s: (..., n) θ̇2, θ̇3, …
        speed_m_s: (...) of P, along the tractor.
        robot: where its balls and hitches are.
        forces: of each trailer's balls.
        fading_m_s: a slower ball is held back by less.

    Returns:
        (...) force on P along the tractor [N], (..., n) generalized torques on θ2, θ3, … [N·m].
    """
    pull, torque = np.zeros_like(speed_m_s), np.zeros_like(angle_rad)
    spacing, velocity = robot.casters.trailer_half_spacing_m, (speed_m_s, np.zeros_like(speed_m_s))
    for i, trailer in enumerate(robot.trailers):
        angle, rate = angle_rad[..., i], rate_rad_s[..., i]
        length, reach = trailer.com_offset_m, trailer.next_hitch_offset_m or 0.0
        along, across = to_body(angle, *velocity)
        for side, force in ((-spacing, forces[i].right), (spacing, forces[i].left)):
            ahead, left = direction(along - side * rate, across - length * rate, fading_m_s)
            x, y = to_world(angle, ahead, left)
            pull = pull - force * x
            torque[..., i] += force * (length * left + side * ahead)
            for k, before in enumerate(robot.trailers[:i]):
                lever = before.next_hitch_offset_m or 0.0
                torque[..., k] += force * lever * to_body(angle_rad[..., k], x, y)[1]
        swept = to_world(angle, np.zeros_like(rate), reach * rate)
        velocity = velocity[0] - swept[0], velocity[1] - swept[1]
    return pull, torque


def direction(
    x: FloatArray, y: FloatArray, fading_m_s: Value = FADING_M_S
) -> tuple[FloatArray, FloatArray]:
    """Unit vector of a velocity, shorter where that is slow."""
    # not fading**2, which of a number is not always rounded as of an array
    size = np.sqrt(x**2 + y**2 + fading_m_s * fading_m_s)
    return x / size, y / size
