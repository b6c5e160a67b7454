"""Differential flatness: the whole motion from the path of the trailer's centre of oscillation.

F = P − k·t with t = (cos θ2, sin θ2) accelerates along the trailer only: F'' = a·t with
a = P''·t + k·θ̇2² (Eq. 24 for a free hitch). Where F'' ≠ 0, therefore,

    θ2 = direction of ±F'',   P = F + k·t,   θ1 = direction of P',   u1 = |P'|,   u2 = θ̇1,

and every derivative follows from derivatives of F: those of θ2 and P of order n from F up to order
n + 2. The sign of a is a free choice: a > 0 has P ahead of F in the direction of its acceleration
(on a circle: the trailer outside P), a < 0 behind it (the trailer inside, unstable).

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


class FlatMotion(NamedTuple):
    """The robot's motion behind a path of F; m is the number of derivatives of F given, with F.

    Angles are in (−π, π], not unwrapped.
    """

    position: FloatArray  # (..., m − 2, 2) P and its derivatives [m, m/s, ...]
    theta1: FloatArray  # (..., m − 3) θ1 and its derivatives [rad, rad/s, ...]
    theta2: FloatArray  # (..., m − 2) θ2 and its derivatives [rad, rad/s, ...]
    twist: FloatArray  # (..., 2) u1 [m/s] (never negative), u2 [rad/s]
    along: FloatArray  # (...) a, the acceleration of F along t [m/s²]


def motion_from_flat(
    flat: FloatArray,
    sign: FloatArray | float,
    robot: RobotParameters,
    pull: FloatArray | None = None,
) -> FlatMotion:
    """P, θ1, θ2 and their derivatives from F and its derivatives.

    What accelerates F beside the hitch (gravity on a slope, balls that resist) comes off F'': then
    it is F'' − pull that points along the trailer.

    Args:
        flat: (..., m, 2) F and its derivatives by time, m ≥ 5; F'' must not vanish, nor P'.
        sign: of a: +1 for the trailer outside of a circle, −1 for inside; one or (...).
        robot: its swing length k.
        pull: (..., m − 2, 2) that acceleration and its derivatives; None: there is none.

    Returns:
        the motion, as far as the derivatives reach.
    """
    given = _complex(flat)
    points = np.moveaxis(given, -1, 0)
    bent = given[..., 2:] if pull is None else given[..., 2:] - _complex(pull)
    pulled = np.moveaxis(bent, -1, 0)
    trailer = _logarithm(sign * pulled)
    direction = _turning(trailer.imag)
    theta2 = trailer.imag
    theta2[0] += robot.lean_rad
    position = points[:-2] + robot.swing_length_m * direction
    tractor = _logarithm(position[1:])
    theta1 = tractor.imag
    return FlatMotion(
        position=_plane(np.moveaxis(position, 0, -1)),
        theta1=np.moveaxis(theta1, 0, -1),
        theta2=np.moveaxis(theta2, 0, -1),
        twist=np.stack([np.abs(position[1]), theta1[1]], axis=-1),
        along=sign * np.abs(pulled[0]),
    )


def centre_derivatives(
    position: FloatArray, theta2: FloatArray, robot: RobotParameters
) -> FloatArray:
    """F = P − k·(cos θ2, sin θ2) and its derivatives (..., m, 2), from P's and θ2's (..., m)."""
    swung = np.moveaxis(theta2, -1, 0).copy()
    swung[0] -= robot.lean_rad
    direction = _turning(swung)
    return position - robot.swing_length_m * _plane(np.moveaxis(direction, 0, -1))


def point_behind(q: FloatArray, distance_m: float, lean_rad: float = 0.0) -> FloatArray:
    """(..., 2) the trailer's point at P − distance·t, for q (..., 3 + n) [m]; NaN where θ2 is.

    At a distance k it is F, the flat output; at l the trailer's COM. Where the load is off the
    axis, t is turned by its lean (`robot.lean_rad`).
    """
    along, _ = trailer_axes(q[..., THETA2] - lean_rad)
    return q[..., :2] - distance_m * along


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
