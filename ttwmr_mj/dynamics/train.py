"""A train of n free trailers behind a pivot P whose motion is given: Eq. 17 and 24 for any n.

Trailer i (mass m_i, inertia J_i, COM l_i behind its hitch) tows the next at d_i behind its hitch.
With M_i the mass of all that follow it, Lagrange's equations are

    Σ_j A_ij·(cos Δ_ij·θ̈_j + sin Δ_ij·θ̇_j²) = b_i·(P'' − g_p)·n_i + T_i − T_i+1,

    b_i = m_i·l_i + d_i·M_i,  A_ii = J_i + m_i·l_i² + d_i²·M_i,  A_ij = d_i·b_j for i < j,

Δ_ij = θ_i − θ_j and n_i to the left of trailer i. T_i is the torque of hitch i on the trailer
behind it, its opposite on what tows it; g_p is gravity along a floor that slopes. A load off the
axis turns b_i by its lean β_i: it acts at θ_i − β_i, in n_i and, for the j of i < j, in Δ_ij. For
one trailer b/A = 1/k.

Everywhere, angles (..., n) are θ2, θ3, …, front to back. Any frame will do as long as angles and
P'' are of the same; rates are those of the world. SI units.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.hitch import spring_damper_torque
from ttwmr_mj.dynamics.hybrid import sideways, trailer_acceleration
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

# Where predictions cut a trailer's rate: 16 turns a second, which none makes. Unseen for long,
# predicted step by step, a train that has fallen would turn ever faster, and overflow.
FASTEST_SWING_RAD_S = 100.0


class Link(NamedTuple):
    """A trailer with what hangs on it, as whatever tows it feels it."""

    moment_kg_m: float  # b
    lean_rad: float  # β
    inertia_kg_m2: float  # A_ii, about its hitch
    reach_m: float  # d; zero for the last


class Constants(NamedTuple):
    """What a robot gives the equations."""

    moment_kg_m: FloatArray  # (n,) b
    lean_rad: FloatArray  # (n,) β
    size_kg_m2: FloatArray  # (n, n) A
    turned_rad: FloatArray  # (n, n) what leans add to Δ


class Posture(NamedTuple):
    """What does not depend on the trailers' rates."""

    coupling: FloatArray  # (..., n, n) A·cos Δ [kg·m²]
    turned: FloatArray  # (..., n, n) A·sin Δ [kg·m²]
    load_n_m: FloatArray  # (..., n) by P's acceleration


class Jacobians(NamedTuple):
    """How the angular accelerations (..., n) change to first order."""

    by_angle: FloatArray  # (..., n, n) [1/s²]
    by_rate: FloatArray  # (..., n, n) [1/s]
    by_acceleration: FloatArray  # (..., n, 2) by P'' [1/m]
    by_torque: FloatArray  # (..., n, n) by the hitches' torques [1/(kg·m²)]


def links(robot: RobotParameters) -> tuple[Link, ...]:
    """All trailers, front to back."""
    last = robot.trailers[-1]
    chain = [Link(last.mass_kg * last.com_distance_m, last.lean_rad, last.swing_inertia_kg_m2, 0.0)]
    behind = last.mass_kg
    for trailer in robot.trailers[-2::-1]:
        reach = trailer.next_hitch_offset_m or 0.0  # there is one, or the robot was refused
        along = trailer.mass_kg * trailer.com_offset_m + behind * reach
        aside = trailer.mass_kg * trailer.com_lateral_m
        inertia = trailer.swing_inertia_kg_m2 + behind * reach**2
        lean = float(np.arctan2(aside, along))
        chain.append(Link(float(np.hypot(along, aside)), lean, inertia, reach))
        behind += trailer.mass_kg
    return tuple(reversed(chain))


def swing_matrix(theta: FloatArray, robot: RobotParameters) -> FloatArray:
    """A_ij·cos Δ_ij, (..., n, n) [kg·m²], symmetric positive definite."""
    size, angle = _couplings(theta, robot)
    return np.asarray(size * np.cos(angle))


def swing_bias(theta: FloatArray, rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """Σ_j A_ij·sin Δ_ij·θ̇_j² (..., n) [N·m]: what turning trailers do to each other."""
    size, angle = _couplings(theta, robot)
    return _sum(size * np.sin(angle) * (rate**2)[..., None, :])


def pivot_torque(
    theta: FloatArray, acceleration_m_s2: FloatArray, robot: RobotParameters
) -> FloatArray:
    """b_i·v·n_i (..., n) [N·m] of the pivot's acceleration v (..., 2), or of v − g_p on a slope."""
    moment, lean = _moments(robot)
    x, y = acceleration_m_s2[..., 0, None], acceleration_m_s2[..., 1, None]
    return np.asarray(moment * sideways(theta - lean, x, y))


def hitch_torques(
    hitch_rad: FloatArray, hitch_rate_rad_s: FloatArray, robot: RobotParameters
) -> FloatArray:
    """T_i (..., n) [N·m] of springs and dampers, from every hitch's angle and rate (..., n)."""
    torques = np.empty_like(hitch_rad)
    for i, hitch in enumerate(robot.hitches):
        torques[..., i] = spring_damper_torque(hitch_rad[..., i], hitch_rate_rad_s[..., i], hitch)
    return torques


def on_trailers(hitch_torque_n_m: FloatArray) -> FloatArray:
    """T_i − T_i+1 (..., n) of T_i (..., n): a hitch turns the trailer before it the other way."""
    torque = hitch_torque_n_m.copy()
    torque[..., :-1] -= hitch_torque_n_m[..., 1:]
    return torque


def trailer_accelerations(
    theta: FloatArray,
    rate: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
    torque_n_m: FloatArray | float = 0.0,
) -> FloatArray:
    """θ̈ (..., n) [rad/s²] of all trailers.

    Args:
        theta: (..., n).
        rate: (..., n) [rad/s].
        acceleration_m_s2: (..., 2) of P; on a slope less g_p.
        robot: whose trailers.
        torque_n_m: (..., n) on each trailer, as `on_trailers` gives them of the hitches'.
    """
    if theta.shape[-1] == 1:
        torque = np.asarray(torque_n_m)[..., 0] if np.ndim(torque_n_m) else torque_n_m
        return trailer_acceleration(theta[..., 0], acceleration_m_s2, robot, torque)[..., None]
    return accelerations_of(constants(robot), theta, rate, acceleration_m_s2, torque_n_m)


def accelerations_of(
    train: Constants,
    theta: FloatArray,
    rate: FloatArray,
    acceleration_m_s2: FloatArray,
    torque_n_m: FloatArray | float = 0.0,
) -> FloatArray:
    """`trailer_accelerations` of `constants`, for who asks often: a robot's hash takes time."""
    return accelerations_at(posture(train, theta, acceleration_m_s2), rate, torque_n_m)


def posture(train: Constants, theta: FloatArray, acceleration_m_s2: FloatArray) -> Posture:
    """What angles (..., n) and an acceleration of P (..., 2) give the equations."""
    angle = apart(theta, train)
    x, y = acceleration_m_s2[..., 0, None], acceleration_m_s2[..., 1, None]
    load = train.moment_kg_m * sideways(theta - train.lean_rad, x, y)
    return Posture(train.size_kg_m2 * np.cos(angle), train.size_kg_m2 * np.sin(angle), load)


def accelerations_at(
    posture: Posture, rate: FloatArray, torque_n_m: FloatArray | float = 0.0
) -> FloatArray:
    """θ̈ (..., n) [rad/s²] of trailers in a posture, at rates (..., n)."""
    bias = _sum(posture.turned * (rate**2)[..., None, :])
    return solve(posture.coupling, posture.load_n_m - bias + torque_n_m)


def jacobians(
    theta: FloatArray,
    rate: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
    torque_n_m: FloatArray | float = 0.0,
) -> Jacobians:
    """Derivatives of `trailer_accelerations`, whose arguments these are."""
    theta, rate = np.broadcast_arrays(theta, rate)
    size, angle = _couplings(theta, robot)
    coupling, turned = size * np.cos(angle), size * np.sin(angle)
    swing = trailer_accelerations(theta, rate, acceleration_m_s2, robot, torque_n_m)
    # Δ_ij grows with θ_i and falls with θ_j
    change = coupling * (rate**2)[..., None, :] - turned * swing[..., None, :]
    by_angle = change.copy()
    moment, lean = _moments(robot)
    cos, sin = np.cos(theta - lean), np.sin(theta - lean)
    x, y = acceleration_m_s2[..., 0, None], acceleration_m_s2[..., 1, None]
    i = np.arange(theta.shape[-1])
    by_angle[..., i, i] -= _sum(change) + moment * (x * cos + y * sin)
    by_rate = -2.0 * turned * rate[..., None, :]
    normal = np.stack([-moment * sin, moment * cos], axis=-1)
    inverse = np.linalg.inv(coupling)
    hitches = np.eye(theta.shape[-1]) - np.eye(theta.shape[-1], k=1)
    return Jacobians(inverse @ by_angle, inverse @ by_rate, inverse @ normal, inverse @ hitches)


def solve(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """(..., n) solutions of matrices (..., n, n), each by itself whatever the batch."""
    if vector.shape[-1] == 1:
        return np.asarray(vector / matrix[..., 0])
    if vector.shape[-1] == 2:  # Cramer's rule: a third of the time
        a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
        first = d * vector[..., 0] - b * vector[..., 1]
        solution = np.empty((*first.shape, 2))  # np.stack takes as long as all the rest
        solution[..., 0] = first
        solution[..., 1] = a * vector[..., 1] - c * vector[..., 0]
        solution /= (a * d - b * c)[..., None]
        return solution
    return np.asarray(np.linalg.solve(matrix, vector[..., None])[..., 0])


@lru_cache(maxsize=256)
def constants(robot: RobotParameters) -> Constants:
    """Those of a robot's trailers, front to back."""
    chain = links(robot)
    size = np.diag([link.inertia_kg_m2 for link in chain])
    turned = np.zeros_like(size)
    for j, link in enumerate(chain):
        for i in range(j):
            size[i, j] = size[j, i] = chain[i].reach_m * link.moment_kg_m
            turned[i, j], turned[j, i] = link.lean_rad, -link.lean_rad
    moment = np.array([link.moment_kg_m for link in chain])
    return Constants(moment, np.array([link.lean_rad for link in chain]), size, turned)


def _moments(robot: RobotParameters) -> tuple[FloatArray, FloatArray]:
    """First moments b and leans β, (n,) each."""
    return constants(robot)[:2]


def _couplings(theta: FloatArray, robot: RobotParameters) -> tuple[FloatArray, FloatArray]:
    """A_ij (n, n) and Δ_ij (..., n, n)."""
    train = constants(robot)
    return train.size_kg_m2, apart(theta, train)


def apart(theta: FloatArray, train: Constants) -> FloatArray:
    """Δ_ij (..., n, n) with what leans add to them."""
    return np.asarray(theta[..., :, None] - theta[..., None, :] + train.turned_rad)


def _sum(terms: FloatArray) -> FloatArray:
    """(...) of terms (..., n), added in the same order whatever the batch."""
    return np.asarray(np.add.accumulate(terms, axis=-1)[..., -1])
