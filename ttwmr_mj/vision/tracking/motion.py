"""How the robot moves between two frames, and how sure one can be of it.

State s = (x, y, θ1, θ2, δ1, δ2, θ̇2): the hybrid model (Eq. 24-29) driven by the commanded twist
plus deviations δ1 [m/s], δ2 [rad/s] of the true twist from it, which decay and are stirred anew
(slip, servo error). Without commands the deviations are all the twist there is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.options import TrackerOptions
from ttwmr_mj.vision.tracking.commands import Stretch

SIZE = 7
X, Y, THETA1, THETA2, DELTA1, DELTA2, THETA2_RATE = range(SIZE)
LONGEST_LINEARIZATION_S = 0.04
FASTEST_1_S = 1000.0  # rate of the stiffest hitch that is followed
MILD = 0.5  # a rate times a time up to which a Taylor polynomial of second order does
SWING_NOISE_TIME_S = 0.033  # the missing acceleration is taken as constant for so long
STICTION_RATE_RAD_S = 0.02  # dry friction turns over within this hitch rate
# random walk of the pose itself, which no deviation of the twist explains: per second
POSE_WALK = np.array([2e-4, 2e-4, 1e-3, 1e-3])


@dataclass(frozen=True, slots=True)
class Belief:
    """A normal distribution of the state.

    Attributes:
        time_s: when.
        mean: (7,) x, y, θ1, θ2, δ1, δ2, θ̇2.
        covariance: (7, 7).
    """

    time_s: float
    mean: FloatArray
    covariance: FloatArray


class MotionModel:
    """Carries beliefs forward in time."""

    def __init__(self, robot: RobotParameters, options: TrackerOptions) -> None:
        """Take the robot's constants and the size of what the model lacks."""
        inertia = robot.swing_inertia_kg_m2
        self._k = robot.swing_length_m
        self._stiffness = robot.hitch.stiffness_n_m_rad / inertia
        self._damping = robot.hitch.damping_n_m_s_rad / inertia
        self._friction = robot.hitch.coulomb_friction_n_m / inertia
        self._decay = 1.0 / options.noise_time_s
        fastest = self._soften()
        self._longest_s = 1.0 / fastest if fastest else math.inf
        self._stiff = fastest * LONGEST_LINEARIZATION_S > MILD
        self.deviation = np.array([options.speed_noise_m_s, options.turn_noise_rad_s])
        density = np.zeros(SIZE)
        density[:DELTA1] = POSE_WALK**2
        density[DELTA1:THETA2_RATE] = 2.0 * self._decay * self.deviation**2
        density[THETA2_RATE] = options.swing_noise_rad_s2**2 * SWING_NOISE_TIME_S
        self._density = density

    def _soften(self) -> float:
        """Bound the hitch's torques to what can be integrated; the fastest rate left [1/s].

        A stiffer hitch is locked for every purpose here.
        """
        self._damping = min(self._damping, FASTEST_1_S)
        self._stiffness = min(self._stiffness, FASTEST_1_S**2)
        self._friction = min(self._friction, FASTEST_1_S * STICTION_RATE_RAD_S)
        return self._damping + math.sqrt(self._stiffness) + self._friction / STICTION_RATE_RAD_S

    def predict(self, belief: Belief, end_s: float, stretches: Iterable[Stretch]) -> Belief:
        """The belief at a later time.

        Args:
            belief: now.
            end_s: when the stretches end.
            stretches: the commanded twist from the belief's time to then.
        """
        mean = tuple(map(float, belief.mean))
        covariance = belief.covariance
        pending, before, twist = 0.0, mean, (0.0, 0.0, 0.0)
        for stretch in stretches:
            for part in self._parts(stretch):
                mean = self._advance(mean, part)
            pending += stretch.duration_s
            twist = (
                0.5 * (stretch.u1_start + stretch.u1_end),
                0.5 * (stretch.u2_start + stretch.u2_end),
                (stretch.u1_end - stretch.u1_start) / stretch.duration_s,
            )
            if pending > LONGEST_LINEARIZATION_S:
                covariance = self._spread(covariance, before, mean, twist, pending)
                pending, before = 0.0, mean
        if pending > 0.0:
            covariance = self._spread(covariance, before, mean, twist, pending)
        return Belief(end_s, np.array(mean), covariance)

    def _parts(self, stretch: Stretch) -> Iterator[Stretch]:
        """The stretch cut so short that the hitch's torques integrate stably."""
        count = math.ceil(stretch.duration_s / self._longest_s) if self._stiff else 1
        if count <= 1:
            yield stretch
            return
        duration = stretch.duration_s / count
        slope1 = (stretch.u1_end - stretch.u1_start) / count
        slope2 = (stretch.u2_end - stretch.u2_start) / count
        for i in range(count):
            u1, u2 = stretch.u1_start + i * slope1, stretch.u2_start + i * slope2
            yield Stretch(duration, u1, u2, u1 + slope1, u2 + slope2)

    def _swing(self, hitch: float, rate: float, u1: float, u2: float, u1_rate: float) -> float:
        """θ̈2 (Eq. 24 with Eq. 27-28 and the hitch's torque)."""
        free = (u1 * u2 * math.cos(hitch) - u1_rate * math.sin(hitch)) / self._k
        slip = rate - u2
        return (
            free
            - self._stiffness * hitch
            - self._damping * slip
            - self._friction * math.tanh(slip / STICTION_RATE_RAD_S)
        )

    def _advance(self, state: tuple[float, ...], stretch: Stretch) -> tuple[float, ...]:
        """One stretch: exact heading, Simpson for P, Runge-Kutta for the trailer."""
        x, y, theta1, theta2, delta1, delta2, rate = state
        dt = stretch.duration_s
        fade = math.exp(-self._decay * dt)
        a1, a2 = stretch.u1_start + delta1, stretch.u2_start + delta2
        delta1, delta2 = fade * delta1, fade * delta2
        b1, b2 = stretch.u1_end + delta1, stretch.u2_end + delta2
        m1, m2 = 0.5 * (a1 + b1), 0.5 * (a2 + b2)
        u1_rate = (b1 - a1) / dt
        middle = theta1 + 0.25 * dt * (a2 + m2)
        end = theta1 + dt * m2
        x += dt / 6.0 * (a1 * math.cos(theta1) + 4.0 * m1 * math.cos(middle) + b1 * math.cos(end))
        y += dt / 6.0 * (a1 * math.sin(theta1) + 4.0 * m1 * math.sin(middle) + b1 * math.sin(end))
        half = 0.5 * dt
        k1 = self._swing(theta2 - theta1, rate, a1, a2, u1_rate)
        glide = theta2 + half * rate
        k2 = self._swing(glide - middle, rate + half * k1, m1, m2, u1_rate)
        k3 = self._swing(glide + half * half * k1 - middle, rate + half * k2, m1, m2, u1_rate)
        glide = theta2 + dt * rate
        k4 = self._swing(glide + dt * half * k2 - end, rate + dt * k3, b1, b2, u1_rate)
        theta2 = glide + dt * dt / 6.0 * (k1 + k2 + k3)
        rate += dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return x, y, end, theta2, delta1, delta2, rate

    def _spread(
        self,
        covariance: FloatArray,
        start: tuple[float, ...],
        end: tuple[float, ...],
        twist: tuple[float, float, float],
        duration_s: float,
    ) -> FloatArray:
        """The covariance after a time, linearized about the middle of the motion."""
        _, _, theta1, theta2, delta1, delta2, rate = (
            0.5 * (a + b) for a, b in zip(start, end, strict=True)
        )
        transition = self._transition(theta1, theta2, delta1, delta2, rate, twist, duration_s)
        spread = transition @ covariance @ transition.T
        spread.flat[:: SIZE + 1] += self._density * duration_s
        return np.asarray(0.5 * (spread + spread.T))

    def _transition(
        self,
        theta1: float,
        theta2: float,
        delta1: float,
        delta2: float,
        rate: float,
        twist: tuple[float, float, float],
        duration_s: float,
    ) -> FloatArray:
        """(7, 7) derivative of the state after a time by the state before it."""
        u1, u2 = twist[0] + delta1, twist[1] + delta2
        u1_rate = twist[2] - self._decay * delta1
        cos, sin = math.cos(theta1), math.sin(theta1)
        hitch = theta2 - theta1
        cos_hitch, sin_hitch = math.cos(hitch), math.sin(hitch)
        grip = self._friction / STICTION_RATE_RAD_S
        friction = grip * (1.0 - math.tanh((rate - u2) / STICTION_RATE_RAD_S) ** 2)
        by_hitch = -(u1 * u2 * sin_hitch + u1_rate * cos_hitch) / self._k - self._stiffness
        slope = np.zeros((SIZE, SIZE))
        slope[X, THETA1], slope[X, DELTA1] = -u1 * sin, cos
        slope[Y, THETA1], slope[Y, DELTA1] = u1 * cos, sin
        slope[THETA1, DELTA2] = 1.0
        slope[THETA2, THETA2_RATE] = 1.0
        slope[DELTA1, DELTA1] = slope[DELTA2, DELTA2] = -self._decay
        slope[THETA2_RATE, THETA1], slope[THETA2_RATE, THETA2] = -by_hitch, by_hitch
        slope[THETA2_RATE, DELTA1] = (u2 * cos_hitch + self._decay * sin_hitch) / self._k
        slope[THETA2_RATE, DELTA2] = u1 * cos_hitch / self._k + self._damping + friction
        slope[THETA2_RATE, THETA2_RATE] = -self._damping - friction
        slope *= duration_s
        if self._stiff:
            return np.asarray(expm(slope))
        transition = slope + 0.5 * slope @ slope
        transition.flat[:: SIZE + 1] += 1.0
        return transition
