"""Kinematic model (Eq. 1-10): the no-side-slip constraint, its null space, wheels and twist.

All functions work over any leading axes, world frame, SI units. Everywhere, q and q_rate (..., 4)
are the generalized coordinates (x, y, θ1, θ2) (Eq. 2) and their rates, and workspace_rate (..., 3)
is ξ̇ = (ṡ, θ̇1, θ̇2) [m/s, rad/s, rad/s]; with more trailers, their angles follow.
"""

import numpy as np

from ttwmr_mj.config import Stack
from ttwmr_mj.errors import InputError, require, shown
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import LEFT, RIGHT, THETA1, FloatArray

Value = FloatArray | float

RIGHT_LESS_LEFT = np.array([1.0, -1.0])


def constraint_matrix(q: FloatArray) -> FloatArray:
    """A(q) = [sin θ1, −cos θ1, 0, 0] (Eq. 4), (..., 1, 4): points to the tractor's right."""
    A = np.zeros((*q.shape[:-1], 1, q.shape[-1]))
    A[..., 0, 0] = np.sin(q[..., THETA1])
    A[..., 0, 1] = -np.cos(q[..., THETA1])
    return A


def constraint_residual(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """A(q)·q̇ = ẋ sin θ1 − ẏ cos θ1 (Eq. 3): speed (...) of P to the right, zero without slip."""
    _, left = to_body(q[..., THETA1], q_rate[..., 0], q_rate[..., 1])
    return np.asarray(-left)


def null_space(q: FloatArray) -> FloatArray:
    """S(q) with A(q)·S(q) = 0 (Eq. 6), (..., 4, 3): the columns are the motions ṡ, θ̇1, θ̇2."""
    width = q.shape[-1]
    S = np.zeros((*q.shape[:-1], width, width - 1))
    S[..., 0, 0] = np.cos(q[..., THETA1])
    S[..., 1, 0] = np.sin(q[..., THETA1])
    S[..., 2:, 1:] = np.eye(width - 2)
    return S


def null_space_rate(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """dS/dt (Eq. 21), (..., 4, 3)."""
    S_rate = np.zeros((*q.shape, q.shape[-1] - 1))
    theta1_rate = q_rate[..., THETA1]
    S_rate[..., 0, 0] = -np.sin(q[..., THETA1]) * theta1_rate
    S_rate[..., 1, 0] = np.cos(q[..., THETA1]) * theta1_rate
    return S_rate


def q_rate(q: FloatArray, workspace_rate: FloatArray) -> FloatArray:
    """q̇ = S(q)·ξ̇ (Eq. 5, 10), (..., 4)."""
    theta1, speed = q[..., THETA1], workspace_rate[..., 0]
    velocity = np.stack([speed * np.cos(theta1), speed * np.sin(theta1)], axis=-1)
    return np.concatenate([velocity, workspace_rate[..., 1:]], axis=-1)


def workspace_rate(q: FloatArray, q_rate: FloatArray) -> FloatArray:
    """ξ̇ = Sᵀ(q)·q̇ (..., 3), the inverse of Eq. 5; a sideways velocity of P is dropped."""
    speed, _ = to_body(q[..., THETA1], q_rate[..., 0], q_rate[..., 1])
    return np.concatenate([speed[..., None], q_rate[..., 2:]], axis=-1)


def twist_from_wheels(wheel_speed_rad_s: FloatArray, robot: RobotParameters) -> FloatArray:
    """(u1, u2) of the tractor from its wheel speeds (Eq. 8-9).

    The factor of Eq. 9 is r divided by the track width 2b, not (r/2)·b.

    Args:
        wheel_speed_rad_s: (..., 2) right, left.
        robot: its tractor gives r and 2b.

    Returns:
        (..., 2) u1 = ṡ [m/s] and u2 = θ̇1 [rad/s].

    Raises:
        InputError: these are no such numbers, or no robot.
    """
    wheels = _pairs("wheel_speed_rad_s", wheel_speed_rad_s, robot)
    return np.stack(rolling(wheels, *wheel_geometry(robot)), axis=-1)


def wheel_geometry(robot: RobotParameters) -> tuple[float, float, float]:
    """What `rolling` and `rolling_wheels` need to know: radius, track, difference of the radii.

    One number each, or (nsim,) for robots of as many simulations (`config.stacked`).
    """
    tractor = robot.tractor
    return tractor.wheel_radius_m, tractor.track_width_m, tractor.wheel_radius_difference_m


def rolling(
    wheels: FloatArray, radius_m: Value, track_m: Value, difference_m: Value = 0.0
) -> tuple[FloatArray, FloatArray]:
    """u1 and u2 (Eq. 8-9) of wheel speeds (..., 2); of wheel angles: path and turn, (...) each.

    The mean of the radii is given, and by how much the right wheel's exceeds the left one's.
    """
    right, left = wheels[..., RIGHT], wheels[..., LEFT]
    both, apart = right + left, right - left
    u1, u2 = (0.5 * radius_m) * both, (radius_m / track_m) * apart
    if np.any(difference_m):
        u1 = u1 + (0.25 * difference_m) * apart
        u2 = u2 + (0.5 * difference_m / track_m) * both
    return u1, u2


def wheels_from_twist(twist: FloatArray, robot: RobotParameters) -> FloatArray:
    """Wheel speeds (..., 2) (right, left) [rad/s] that give (u1, u2) (..., 2): Eq. 8-9 inverted.

    Raises:
        InputError: these are no such numbers, or no robot.
    """
    return rolling_wheels(_pairs("twist", twist, robot), *wheel_geometry(robot))


def _pairs(where: str, given: object, robot: object) -> FloatArray:
    """(..., 2) what a law or a script gives, if it is that, and the robot is one."""
    try:
        values = np.asarray(given)
    except ValueError:  # lists of unequal lengths
        values = np.empty(0)
    if values.dtype.kind not in "iuf" or values.shape[-1:] != (2,):
        got = f"an array {values.shape} of {values.dtype}"
        got = got if isinstance(given, np.ndarray) else shown(given)
        raise InputError.at(where, got=got, allowed="numbers of shape (..., 2)")
    if not isinstance(robot, Stack):  # of many simulations
        require(RobotParameters, "robot", robot)
    return values


def rolling_wheels(
    twist: FloatArray, radius_m: Value, track_m: Value, difference_m: Value = 0.0
) -> FloatArray:
    """The inverse of `rolling`: wheel speeds (..., 2) from (u1, u2) (..., 2)."""
    forward, turn = twist[..., 0], 0.5 * track_m * twist[..., 1]
    speeds = np.stack([forward + turn, forward - turn], axis=-1)
    apart = np.asarray(0.5 * difference_m)[..., None] * RIGHT_LESS_LEFT
    radii = np.asarray(radius_m)[..., None] + apart
    return np.asarray(speeds / radii)


def arcs_between(position_m: FloatArray, theta1_rad: FloatArray) -> FloatArray:
    """Path and turn (n − 1, ..., 2) of the arcs from each pose to the next [m, rad].

    Args:
        position_m: (n, ..., 2) of P.
        theta1_rad: (n, ...) headings, unwrapped.
    """
    turn = np.diff(theta1_rad, axis=0)
    middle, step = theta1_rad[:-1] + 0.5 * turn, np.diff(position_m, axis=0)
    chord = step[..., 0] * np.cos(middle) + step[..., 1] * np.sin(middle)
    return np.stack([chord / np.sinc(0.5 * turn / np.pi), turn], axis=-1)


def to_world(
    heading_rad: FloatArray, ahead: FloatArray, left: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """A vector given ahead and to the left of a heading as (x, y) in the world, (...) each."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return cos * ahead - sin * left, sin * ahead + cos * left


def to_body(heading_rad: FloatArray, x: Value, y: Value) -> tuple[FloatArray, FloatArray]:
    """The inverse of `to_world`: the parts of (x, y) ahead and to the left of a heading."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return cos * x + sin * y, cos * y - sin * x
