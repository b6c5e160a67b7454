"""Differential flatness: the whole motion from the path of the trailer's centre of oscillation.

F = P − k·t with t = (cos θ2, sin θ2) accelerates along the trailer only: F'' = a·t with
a = P''·t + k·θ̇2² (Eq. 24 for a free hitch). Where F'' ≠ 0, therefore,

    θ2 = direction of ±F'',   P = F + k·t,   θ1 = direction of P',   u1 = |P'|,   u2 = θ̇1,

and every derivative follows from derivatives of F: those of θ2 and P of order n from F up to order
n + 2. The sign of a is a free choice: a > 0 has P ahead of F in the direction of its acceleration
(on a circle: the trailer outside P), a < 0 behind it (the trailer inside, unstable).

A train is flat where every trailer but the last tows the next at its own centre of oscillation,
d = k. A trailer moves like two points: the mass m·l/k at its centre of oscillation O and the rest
at its hitch, the one before's O. With M_i what is lumped at O_i, the rod that is left of trailer i
carries the force Σ_j≥i M_j·O_j'', and that along itself: front to back O_i−1 = O_i + k_i·t_i with
t_i the direction of ± that force, from the last O, the flat output, to P = O_0. Each trailer takes
two derivatives, and each has a sign.

Plane vectors are treated as complex numbers: with z = e^(L), the derivatives of L = ln|z| + i·arg z
follow from those of z by Leibniz' rule, and back. All functions work over leading axes.
"""

from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, FloatArray

ComplexArray = NDArray[np.complex128]

FLAT_TOLERANCE = 1e-3


class FlatMotion(NamedTuple):
    """The robot's motion behind a path of F; m is the number of derivatives of F given, with F.

    Angles are in (−π, π], not unwrapped.
    """

    position: FloatArray  # (..., m − 2n, 2) P and its derivatives [m, m/s, ...]
    theta1: FloatArray  # (..., m − 2n − 1) θ1 and its derivatives [rad, rad/s, ...]
    trailers: tuple[FloatArray, ...]  # (..., m − 2n or more) θ2, θ3, … and their derivatives
    twist: FloatArray  # (..., 2) u1 [m/s] (never negative), u2 [rad/s]
    along: FloatArray  # (...) a of the last trailer, the acceleration of F along t [m/s²]

    @property
    def theta2(self) -> FloatArray:
        """The first trailer's angle and its derivatives."""
        return self.trailers[0]


def motion_from_flat(
    flat: FloatArray,
    sign: FloatArray | float | tuple[float, ...],
    robot: RobotParameters,
    pull: FloatArray | None = None,
) -> FlatMotion:
    """P, θ1, θ2, … and their derivatives from F and its derivatives.

    What accelerates F beside the hitch (gravity on a slope; of one trailer, balls that resist)
    comes off F'': then it is F'' − pull that points along the trailer.

    Args:
        flat: (..., m, 2) F of the last trailer and its derivatives by time, m ≥ 3 + 2n; no force
            may vanish, nor P'.
        sign: of a: +1 for the trailer outside of a circle, −1 for inside; one or (...). Of
            several trailers one for each, front to back.
        robot: its trailers; several must be coupled at centres of oscillation (`is_flat`).
        pull: (..., m − 2, 2) that acceleration and its derivatives; None: there is none.

    Returns:
        the motion, as far as the derivatives reach.
    """
    signs = sign if isinstance(sign, tuple) else (sign,)
    given = _complex(flat)
    position, pulled = np.moveaxis(given, -1, 0), None
    if pull is not None:
        pulled = np.moveaxis(np.broadcast_to(_complex(pull), given[..., 2:].shape), -1, 0)
    masses = lumped_masses(robot)
    force = np.zeros_like(position)
    angles: list[FloatArray] = []
    for i in range(len(masses) - 1, -1, -1):
        bent = position[2:] if pulled is None else position[2:] - pulled[: len(position) - 2]
        # in units of the last mass, so that a lone trailer's force is F'' itself
        share = masses[i] / masses[-1]
        force = bent if i == len(masses) - 1 else force[: len(bent)] + share * bent
        turn = _logarithm(signs[i] * force)
        if not angles:
            along = signs[i] * np.abs(force[0])
        position = position[:-2] + robot.trailers[i].swing_length_m * _turning(turn.imag)
        turn.imag[0] += robot.trailers[i].lean_rad
        angles.append(np.moveaxis(turn.imag, 0, -1))
    theta1 = _logarithm(position[1:]).imag
    return FlatMotion(
        position=_plane(np.moveaxis(position, 0, -1)),
        theta1=np.moveaxis(theta1, 0, -1),
        trailers=tuple(reversed(angles)),
        twist=np.stack([np.abs(position[1]), theta1[1]], axis=-1),
        along=along,
    )


def is_flat(robot: RobotParameters) -> bool:
    """Whether every hitch behind a trailer is at that trailer's centre of oscillation.

    To a thousandth of its distance. Their loads must then be on their axes.
    """
    return all(
        abs((trailer.next_hitch_offset_m or 0.0) / trailer.swing_length_m - 1.0) < FLAT_TOLERANCE
        and trailer.com_lateral_m == 0.0
        for trailer in robot.trailers[:-1]
    )


def lumped_masses(robot: RobotParameters) -> tuple[float, ...]:
    """M_i [kg] at each trailer's centre of oscillation, front to back, of a train that is flat."""
    shares = [trailer.com_distance_m / trailer.swing_length_m for trailer in robot.trailers]
    behind = [t.mass_kg * (1.0 - share) for t, share in zip(robot.trailers, shares, strict=True)]
    own = (t.mass_kg * share for t, share in zip(robot.trailers, shares, strict=True))
    return tuple(map(sum, zip(own, [*behind[1:], 0.0], strict=True)))


def centre_derivatives(
    position: FloatArray, theta: FloatArray, robot: RobotParameters
) -> FloatArray:
    """F of the last trailer and its derivatives (..., m, 2).

    From those of P (..., m, 2) and of every trailer's angle (..., m, n).
    """
    for i, trailer in enumerate(robot.trailers):
        swung, length = np.moveaxis(theta[..., i], -1, 0).copy(), trailer.next_hitch_offset_m or 0.0
        if i == len(robot.trailers) - 1:
            swung[0] -= trailer.lean_rad
            length = trailer.swing_length_m
        position = position - length * _plane(np.moveaxis(_turning(swung), 0, -1))
    return position


def point_behind(q: FloatArray, distance_m: float, lean_rad: float = 0.0) -> FloatArray:
    """(..., 2) the trailer's point at P − distance·t, for q (..., 3 + n) [m]; NaN where θ2 is.

    At a distance k it is F, the flat output; at l the trailer's COM. Where the load is off the
    axis, t is turned by its lean (`robot.lean_rad`).
    """
    along, _ = trailer_axes(q[..., THETA2] - lean_rad)
    return q[..., :2] - distance_m * along


def trailer_point(
    q: FloatArray, robot: RobotParameters, distance_m: float, lean_rad: float = 0.0, index: int = -1
) -> FloatArray:
    """(..., 2) the same of any trailer (−1: the last), at hitch − distance·t [m]."""
    index = index % len(robot.trailers)
    hitch = q[..., :2]
    for i, trailer in enumerate(robot.trailers[:index]):
        hitch = hitch - (trailer.next_hitch_offset_m or 0.0) * trailer_axes(q[..., THETA2 + i])[0]
    return hitch - distance_m * trailer_axes(q[..., THETA2 + index] - lean_rad)[0]


def velocity_behind(
    velocity_m_s: FloatArray, theta2_rad: FloatArray, rate_rad_s: FloatArray, distance_m: float
) -> FloatArray:
    """(..., 2) that point's velocity Ṗ − distance·θ̇2·n [m/s], for Ṗ (..., 2), θ2 and θ̇2 (...)."""
    _, across = trailer_axes(theta2_rad)
    return velocity_m_s - (distance_m * rate_rad_s)[..., None] * across


def flat_output_acceleration(
    theta2_rad: FloatArray,
    theta2_rate_rad_s: FloatArray,
    acceleration_m_s2: FloatArray,
    robot: RobotParameters,
) -> FloatArray:
    """F̈ = (v·t + k·θ̇2²)·t (..., 2) [m/s²] of v = (ẍ, ÿ) (..., 2), for a free hitch (Eq. 24)."""
    along, _ = trailer_axes(theta2_rad)
    size = dot(acceleration_m_s2, along) + robot.swing_length_m * theta2_rate_rad_s**2
    return np.asarray(size[..., None] * along)


def trailer_axes(theta2_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors t (towards P) and n (to its left), (..., 2) each, of a trailer at θ2 (...)."""
    cos, sin = np.cos(theta2_rad), np.sin(theta2_rad)
    return np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(...) scalar product of plane vectors (..., 2)."""
    return np.asarray((a * b).sum(axis=-1))


def _logarithm(z: ComplexArray) -> ComplexArray:
    """Derivatives (m, ...) of ln z from those of z: zₙ = Σ C(n−1, j)·zⱼ·Lₙ₋ⱼ, solved for Lₙ."""
    L = np.empty_like(z)
    L[0] = np.log(z[0])
    for n in range(1, z.shape[0]):
        known = sum((comb(n - 1, j) * z[j] * L[n - j] for j in range(1, n)), np.zeros_like(z[0]))
        L[n] = (z[n] - known) / z[0]
    return L


def _turning(angle: FloatArray) -> ComplexArray:
    """Derivatives (m, ...) of e^(i·angle) from those of the angle, by the same rule."""
    L = 1j * angle.astype(np.complex128)
    z = np.empty_like(L)
    z[0] = np.exp(L[0])
    for n in range(1, L.shape[0]):
        z[n] = sum((comb(n - 1, j) * z[j] * L[n - j] for j in range(n)), np.zeros_like(z[0]))
    return z


def _complex(points: FloatArray) -> ComplexArray:
    return np.asarray(points[..., 0] + 1j * points[..., 1], dtype=np.complex128)


def _plane(points: ComplexArray) -> FloatArray:
    return np.stack([points.real, points.imag], axis=-1)
