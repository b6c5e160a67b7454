"""Trains on circles: every combination of trailers outside and inside is a relative equilibrium.

Where P runs on a circle at a constant rate ω, P'' is radial, and trailers that are radial turn
with it: all sines of `train` vanish. Each may be outside of its hitch or inside, wherever the
hitches are; a load off its trailer's axis turns that axis off the radius.

In the frame that turns, the trailers are δθ̈ = (∂θ̈/∂θ)·δθ about it, so poles come in pairs ±√λ:
imaginary with all trailers outside, else at least one is real and positive.
"""

from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.train import jacobians, trailer_accelerations
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

ROUNDS = 20  # of Newton's method; leans of 0.1 rad take 4
UNIT_RATE = 1.0  # the equilibrium's shape is the same at every rate


class Circling(NamedTuple):
    """A relative equilibrium, seen along the radius from the circle's centre to P."""

    radius_m: float  # of P's circle
    trailer_rad: FloatArray  # (n,) angles of the trailers against that radius
    centre_m: FloatArray  # (2,) F of the last trailer, along the radius and to its left

    def poles(self, robot: RobotParameters, rate_rad_s: float) -> FloatArray:
        """(2n,) of the trailers at a rate ω, P on its circle [1/s], complex."""
        slope = _slope(self.trailer_rad, self.radius_m, robot)
        roots = rate_rad_s * np.sqrt(np.linalg.eigvals(slope).astype(np.complex128))
        return np.concatenate([roots, -roots])


def circling(robot: RobotParameters, outside: tuple[bool, ...], radius_m: float) -> Circling:
    """The equilibrium with P on a circle.

    Args:
        robot: its trailers, n of them.
        outside: of each trailer, front to back.
        radius_m: of P's circle.
    """
    theta = np.where(outside, np.pi, 0.0)
    if any(trailer.com_lateral_m for trailer in robot.trailers):
        inward = np.array([-(UNIT_RATE**2) * radius_m, 0.0])
        for _ in range(ROUNDS):
            left = trailer_accelerations(theta, np.full_like(theta, UNIT_RATE), inward, robot)
            theta = theta - np.linalg.solve(_slope(theta, radius_m, robot), left)
    end = np.array([radius_m, 0.0])
    for i, (trailer, angle) in enumerate(zip(robot.trailers, theta, strict=True)):
        last = i == len(theta) - 1
        length = trailer.swing_length_m if last else trailer.next_hitch_offset_m or 0.0
        turned = angle - trailer.lean_rad if last else angle
        end = end - length * np.array([np.cos(turned), np.sin(turned)])
    return Circling(radius_m, theta, end)


def circling_behind(robot: RobotParameters, outside: tuple[bool, ...], radius_m: float) -> Circling:
    """The equilibrium whose last trailer's centre of oscillation runs on a circle.

    Negative radii of P's circle mean that P is on the far side of the centre. A load off its axis
    must be the last trailer's.
    """
    reach = [trailer.next_hitch_offset_m or 0.0 for trailer in robot.trailers[:-1]]
    lengths = [*reach, robot.trailers[-1].swing_length_m]
    out = sum(length if far else -length for length, far in zip(lengths, outside, strict=True))
    return circling(robot, outside, radius_m - out)


def _slope(theta: FloatArray, radius_m: float, robot: RobotParameters) -> FloatArray:
    """∂θ̈/∂θ (n, n) at unit rate."""
    inward = np.array([-(UNIT_RATE**2) * radius_m, 0.0])
    return jacobians(theta, np.full_like(theta, UNIT_RATE), inward, robot).by_angle
