"""How the trailers swing between two frames, while the tractor's ramp is known.

Fourth-order Runge-Kutta steps, and derivatives for the filter: of one trailer in closed form, in
numbers, which is quickest; of a train by `dynamics.train`.
"""

import math
from typing import NamedTuple, Protocol

import numpy as np

from ttwmr_mj.dynamics.train import FASTEST_SWING_RAD_S, jacobians, links, on_trailers, swing_matrix
from ttwmr_mj.dynamics.train import trailer_accelerations as accelerations
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

FASTEST_1_S = 1000.0  # a hitch that settles in 1 ms is locked for frames 33 ms apart
STICTION_RATE_RAD_S = 0.02  # dry friction changes its sign within this hitch rate
Angles = tuple[float, ...]


class Instant(NamedTuple):
    """The tractor at an instant."""

    theta1: float
    u1: float  # speed of P [m/s]
    u2: float  # turn rate [rad/s]


class Slopes(NamedTuple):
    """Derivatives of the trailers' accelerations."""

    by_theta1: FloatArray  # (n,)
    by_theta: FloatArray  # (n, n)
    by_twist: FloatArray  # (n, 2) by deviations of u1 and u2, of which u1's decays
    by_rate: FloatArray  # (n, n)


class Swing(Protocol):
    """What swings on a tractor.

    Attributes:
        fastest_1_s: the fastest of the hitches' rates.
    """

    fastest_1_s: float

    def advance(
        self, theta: Angles, rate: Angles, ramp: tuple[Instant, ...], u1_rate: float, dt: float
    ) -> tuple[Angles, Angles]:
        """Angles and rates a time later; the ramp is its start, middle and end."""

    def slopes(
        self, theta: Angles, rate: Angles, at: Instant, u1_rate: float, decay: float
    ) -> Slopes:
        """At an instant; deviations from u1 decay at that rate."""


def swing_of(robot: RobotParameters) -> Swing:
    """Of one trailer, or of a train."""
    return LoneSwing(robot) if len(robot.trailers) == 1 else TrainSwing(robot)


class LoneSwing:
    """One trailer."""

    def __init__(self, robot: RobotParameters) -> None:
        hitch, inertia = robot.hitch, robot.swing_inertia_kg_m2
        self._k, self._lean = robot.swing_length_m, robot.lean_rad
        # a hitch too stiff to be integrated is locked for every purpose here
        self._stiffness = min(hitch.stiffness_n_m_rad / inertia, FASTEST_1_S**2)
        self._damping = min(hitch.damping_n_m_s_rad / inertia, FASTEST_1_S)
        friction = hitch.coulomb_friction_n_m / inertia
        self._friction = min(friction, FASTEST_1_S * STICTION_RATE_RAD_S)
        grip = self._friction / STICTION_RATE_RAD_S
        self.fastest_1_s = self._damping + math.sqrt(self._stiffness) + grip

    def advance(
        self, theta: Angles, rate: Angles, ramp: tuple[Instant, ...], u1_rate: float, dt: float
    ) -> tuple[Angles, Angles]:
        """As of `Swing`."""
        (theta2,), (rate2,), bend = theta, rate, self._acceleration
        start, middle, end = ramp
        half = 0.5 * dt
        k1 = bend(theta2 - start.theta1, rate2, start.u1, start.u2, u1_rate)
        glide = theta2 + half * rate2
        k2 = bend(glide - middle.theta1, rate2 + half * k1, middle.u1, middle.u2, u1_rate)
        turned = glide + half * half * k1 - middle.theta1
        k3 = bend(turned, rate2 + half * k2, middle.u1, middle.u2, u1_rate)
        glide = theta2 + dt * rate2
        k4 = bend(glide + dt * half * k2 - end.theta1, rate2 + dt * k3, end.u1, end.u2, u1_rate)
        theta2 = glide + dt * dt / 6.0 * (k1 + k2 + k3)
        rate2 += dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return (theta2,), (rate2,)

    def slopes(
        self, theta: Angles, rate: Angles, at: Instant, u1_rate: float, decay: float
    ) -> Slopes:
        """As of `Swing`."""
        swung = theta[0] - at.theta1 - self._lean
        cos_hitch, sin_hitch = math.cos(swung), math.sin(swung)
        grip = self._friction / STICTION_RATE_RAD_S
        sliding = math.tanh((rate[0] - at.u2) / STICTION_RATE_RAD_S)
        loss = self._damping + grip * (1.0 - sliding**2)
        by_hitch = -(at.u1 * at.u2 * sin_hitch + u1_rate * cos_hitch) / self._k - self._stiffness
        by_u1 = (at.u2 * cos_hitch + decay * sin_hitch) / self._k
        by_u2 = at.u1 * cos_hitch / self._k + loss
        return Slopes(
            np.array([-by_hitch]),
            np.array([[by_hitch]]),
            np.array([[by_u1, by_u2]]),
            np.array([[-loss]]),
        )

    def _acceleration(
        self, hitch: float, rate: float, u1: float, u2: float, u1_rate: float
    ) -> float:
        """θ̈2 (Eq. 24 with Eq. 27-28 and the hitch's torque)."""
        swung = hitch - self._lean
        free = (u1 * u2 * math.cos(swung) - u1_rate * math.sin(swung)) / self._k
        hitch_rate = rate - u2
        return (
            free
            - self._stiffness * hitch
            - self._damping * hitch_rate
            - self._friction * math.tanh(hitch_rate / STICTION_RATE_RAD_S)
        )


class TrainSwing:
    """Several trailers."""

    def __init__(self, robot: RobotParameters) -> None:
        self._robot, count = robot, len(robot.trailers)
        # a torque turns two bodies against each other: four times it, on the least inertia there is
        least = _least_inertia(robot) / 4.0
        limits = FASTEST_1_S**2, FASTEST_1_S, FASTEST_1_S * STICTION_RATE_RAD_S
        self._stiffness, self._damping, self._friction = (
            np.minimum(values, least * limit)
            for values, limit in zip(_hitch_values(robot), limits, strict=True)
        )
        spring, damper = self._stiffness.max() / least, self._damping.max() / least
        grip = self._friction.max() / least / STICTION_RATE_RAD_S
        self.fastest_1_s = float(damper + math.sqrt(spring) + grip)
        # hitch angles of (θ1, θ2, …)
        self._hitches = np.eye(count, count + 1, k=1) - np.eye(count, count + 1)

    def advance(
        self, theta: Angles, rate: Angles, ramp: tuple[Instant, ...], u1_rate: float, dt: float
    ) -> tuple[Angles, Angles]:
        """As of `Swing`."""
        angle, turn, half = np.array(theta), np.array(rate), 0.5 * dt
        start, middle, end = ramp
        k1 = self._accelerations(angle, turn, start, u1_rate)
        glide = angle + half * turn
        k2 = self._accelerations(glide, turn + half * k1, middle, u1_rate)
        k3 = self._accelerations(glide + half * half * k1, turn + half * k2, middle, u1_rate)
        glide = angle + dt * turn
        k4 = self._accelerations(glide + dt * half * k2, turn + dt * k3, end, u1_rate)
        angle = glide + dt * dt / 6.0 * (k1 + k2 + k3)
        turn = turn + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        turn = np.clip(turn, -FASTEST_SWING_RAD_S, FASTEST_SWING_RAD_S)
        return tuple(angle.tolist()), tuple(turn.tolist())

    def slopes(
        self, theta: Angles, rate: Angles, at: Instant, u1_rate: float, decay: float
    ) -> Slopes:
        """As of `Swing`."""
        angle, turn = np.array(theta), np.array(rate)
        torque = self._torques(angle, turn, at)
        push = _of_pivot(at, u1_rate)
        by = jacobians(angle, turn, push, self._robot, on_trailers(torque))
        sliding = np.tanh(self._hitches @ np.array([at.u2, *rate]) / STICTION_RATE_RAD_S)
        loss = self._damping + self._friction / STICTION_RATE_RAD_S * (1.0 - sliding**2)
        spring = -by.by_torque @ (self._stiffness[:, None] * self._hitches)
        damper = -by.by_torque @ (loss[:, None] * self._hitches)
        cos, sin = math.cos(at.theta1), math.sin(at.theta1)
        ahead, left = np.array([cos, sin]), np.array([-sin, cos])
        by_theta1 = by.by_acceleration @ (u1_rate * left - at.u1 * at.u2 * ahead)
        by_u1 = by.by_acceleration @ (at.u2 * left - decay * ahead)
        by_u2 = by.by_acceleration @ (at.u1 * left) + damper[:, 0]
        return Slopes(
            by_theta1 + spring[:, 0],
            by.by_angle + spring[:, 1:],
            np.stack([by_u1, by_u2], axis=1),
            by.by_rate + damper[:, 1:],
        )

    def _accelerations(
        self, theta: FloatArray, rate: FloatArray, at: Instant, u1_rate: float
    ) -> FloatArray:
        torque = on_trailers(self._torques(theta, rate, at))
        return accelerations(theta, rate, _of_pivot(at, u1_rate), self._robot, torque)

    def _torques(self, theta: FloatArray, rate: FloatArray, at: Instant) -> FloatArray:
        hitch = self._hitches @ np.concatenate([[at.theta1], theta])
        slide = self._hitches @ np.concatenate([[at.u2], rate])
        rubbing = self._friction * np.tanh(slide / STICTION_RATE_RAD_S)
        return np.asarray(-self._stiffness * hitch - self._damping * slide - rubbing)


def _of_pivot(at: Instant, u1_rate: float) -> FloatArray:
    """(2,) P'' of a tractor that rolls."""
    cos, sin, across = math.cos(at.theta1), math.sin(at.theta1), at.u1 * at.u2
    return np.array([u1_rate * cos - across * sin, u1_rate * sin + across * cos])


def _hitch_values(robot: RobotParameters) -> FloatArray:
    """(3, n) stiffness, damping, dry friction of the hitches."""
    rows = [
        (hitch.stiffness_n_m_rad, hitch.damping_n_m_s_rad, hitch.coulomb_friction_n_m)
        for hitch in robot.hitches
    ]
    return np.array(rows).T


def _least_inertia(robot: RobotParameters) -> float:
    """The smallest eigenvalue of the trailers' mass matrix, which it has when they are stretched.

    By Schur's product theorem: cos Δ is positive semidefinite with ones on its diagonal.
    """
    stretched = np.zeros(len(links(robot)))
    return float(np.linalg.eigvalsh(swing_matrix(stretched, robot)).min())
