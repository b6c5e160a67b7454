"""How the robot moves between two frames, and how sure one can be of it.

State s = (x, y, θ1, θ2, δ1, δ2, θ̇2): the hybrid model (Eq. 24-29) driven by the commanded twist
plus deviations δ1 [m/s], δ2 [rad/s] of the true twist from it, which decay and are stirred anew
(slip, servo error). Without commands the deviations are all the twist there is.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.tracking.commands import TwistRamp
from ttwmr_mj.vision.tracking.options import TrackerOptions

SIZE = 7
DELTA1, DELTA2, THETA2_RATE = range(4, SIZE)
LONGEST_LINEARIZATION_S = 0.04  # a control period of 33 ms; 66 ms change deviations by 5 %
FASTEST_1_S = 1000.0  # a hitch that settles in 1 ms is locked for frames 33 ms apart
TAYLOR_ORDER = 11  # of e^A where |A| ≤ 1/4: the first term left out is 1e-16
MILD = 0.5  # a rate times a time up to which a Taylor polynomial of second order does
ACCELERATION_TIME_S = 0.033  # the missing acceleration is taken as constant for so long
STICTION_RATE_RAD_S = 0.02  # dry friction changes its sign within this hitch rate
# random walk of x, y, θ1, θ2 themselves, which no deviation of the twist explains: m and rad in
# the root of a second, far below what the deviations stir up
POSE_WALK = np.array([2e-4, 2e-4, 1e-3, 1e-3])

State = tuple[float, ...]  # the seven numbers of `Gaussian.mean`; faster than arrays of seven


@dataclass(frozen=True, slots=True)
class Gaussian:
    """A normal distribution of the state."""

    time_s: float  # when
    mean: FloatArray  # (7,) x, y, θ1, θ2, δ1, δ2, θ̇2
    covariance: FloatArray  # (7, 7)


class MotionModel:
    """Carries distributions of the state forward in time.

    Attributes:
        deviation: (2,) standard deviation of δ1 and δ2 in the long run.
    """

    def __init__(self, robot: RobotParameters, options: TrackerOptions) -> None:
        """Take the robot's constants and the size of what the model lacks."""
        hitch, inertia = robot.hitch, robot.swing_inertia_kg_m2
        self._k, self._lean = robot.swing_length_m, robot.lean_rad
        # a hitch too stiff to be integrated is locked for every purpose here
        self._stiffness = min(hitch.stiffness_n_m_rad / inertia, FASTEST_1_S**2)
        self._damping = min(hitch.damping_n_m_s_rad / inertia, FASTEST_1_S)
        friction = hitch.coulomb_friction_n_m / inertia
        self._friction = min(friction, FASTEST_1_S * STICTION_RATE_RAD_S)
        fastest = self._damping + math.sqrt(self._stiffness) + self._friction / STICTION_RATE_RAD_S
        self._stiff = fastest * LONGEST_LINEARIZATION_S > MILD
        self._longest_s = 1.0 / fastest if self._stiff else math.inf
        self._decay = 1.0 / options.noise_time_s
        self.deviation = np.array([options.speed_noise_m_s, options.turn_noise_rad_s])
        density = np.zeros(SIZE)
        density[:DELTA1] = POSE_WALK**2
        density[DELTA1:THETA2_RATE] = 2.0 * self._decay * self.deviation**2
        density[THETA2_RATE] = options.swing_noise_rad_s2**2 * ACCELERATION_TIME_S
        self._density = density

    def predict(self, state: Gaussian, end_s: float, ramps: Iterable[TwistRamp]) -> Gaussian:
        """The state at a later time.

        Args:
            state: now.
            end_s: when the ramps end.
            ramps: the commanded twist from the state's time to then.
        """
        mean: State = tuple(map(float, state.mean))
        covariance = state.covariance
        pending, before, ramp = 0.0, mean, None
        for ramp in ramps:
            for part in self._parts(ramp):
                mean = self._advance(mean, part)
            pending += ramp.duration_s
            if pending > LONGEST_LINEARIZATION_S:
                covariance = self._spread(covariance, before, mean, ramp, pending)
                pending, before = 0.0, mean
        if ramp is not None and pending > 0.0:
            covariance = self._spread(covariance, before, mean, ramp, pending)
        return Gaussian(end_s, np.array(mean), covariance)

    def _parts(self, ramp: TwistRamp) -> Iterator[TwistRamp]:
        """The ramp cut so short that the hitch's torques integrate stably."""
        count = math.ceil(ramp.duration_s / self._longest_s)
        if count <= 1:
            yield ramp
            return
        duration = ramp.duration_s / count
        rise1, rise2 = (ramp.u1_end - ramp.u1_start) / count, (ramp.u2_end - ramp.u2_start) / count
        for i in range(count):
            u1, u2 = ramp.u1_start + i * rise1, ramp.u2_start + i * rise2
            yield TwistRamp(duration, u1, u2, u1 + rise1, u2 + rise2)

    def _trailer_acceleration(
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

    def _advance(self, state: State, ramp: TwistRamp) -> State:
        """One ramp: exact heading, Simpson's rule for P, Runge-Kutta for the trailer."""
        x, y, theta1, theta2, delta1, delta2, rate = state
        dt = ramp.duration_s
        fade = math.exp(-self._decay * dt)
        a1, a2 = ramp.u1_start + delta1, ramp.u2_start + delta2
        delta1, delta2 = fade * delta1, fade * delta2
        b1, b2 = ramp.u1_end + delta1, ramp.u2_end + delta2
        m1, m2 = 0.5 * (a1 + b1), 0.5 * (a2 + b2)
        u1_rate = (b1 - a1) / dt
        middle = theta1 + 0.25 * dt * (a2 + m2)
        end = theta1 + dt * m2
        x += dt / 6.0 * (a1 * math.cos(theta1) + 4.0 * m1 * math.cos(middle) + b1 * math.cos(end))
        y += dt / 6.0 * (a1 * math.sin(theta1) + 4.0 * m1 * math.sin(middle) + b1 * math.sin(end))
        half, bend = 0.5 * dt, self._trailer_acceleration
        k1 = bend(theta2 - theta1, rate, a1, a2, u1_rate)
        glide = theta2 + half * rate
        k2 = bend(glide - middle, rate + half * k1, m1, m2, u1_rate)
        k3 = bend(glide + half * half * k1 - middle, rate + half * k2, m1, m2, u1_rate)
        glide = theta2 + dt * rate
        k4 = bend(glide + dt * half * k2 - end, rate + dt * k3, b1, b2, u1_rate)
        theta2 = glide + dt * dt / 6.0 * (k1 + k2 + k3)
        rate += dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return x, y, end, theta2, delta1, delta2, rate

    def _spread(
        self, covariance: FloatArray, start: State, end: State, ramp: TwistRamp, duration_s: float
    ) -> FloatArray:
        """The covariance after a time, linearized about the middle of the motion."""
        middle = tuple(0.5 * (a + b) for a, b in zip(start, end, strict=True))
        transition = self._transition(middle, ramp, duration_s)
        spread = transition @ covariance @ transition.T
        spread.flat[:: SIZE + 1] += self._density * duration_s
        return np.asarray(0.5 * (spread + spread.T))

    def _transition(self, middle: State, ramp: TwistRamp, duration_s: float) -> FloatArray:
        """(7, 7) derivative of the state after a time by the state before it."""
        _, _, theta1, theta2, delta1, delta2, rate = middle
        u1 = 0.5 * (ramp.u1_start + ramp.u1_end) + delta1
        u2 = 0.5 * (ramp.u2_start + ramp.u2_end) + delta2
        u1_rate = (ramp.u1_end - ramp.u1_start) / ramp.duration_s - self._decay * delta1
        cos, sin = math.cos(theta1), math.sin(theta1)
        swung = theta2 - theta1 - self._lean
        cos_hitch, sin_hitch = math.cos(swung), math.sin(swung)
        grip = self._friction / STICTION_RATE_RAD_S
        loss = self._damping + grip * (1.0 - math.tanh((rate - u2) / STICTION_RATE_RAD_S) ** 2)
        by_hitch = -(u1 * u2 * sin_hitch + u1_rate * cos_hitch) / self._k - self._stiffness
        by_delta1 = (u2 * cos_hitch + self._decay * sin_hitch) / self._k
        by_delta2 = u1 * cos_hitch / self._k + loss
        slope = np.array(
            [  # by x, y, θ1, θ2, δ1, δ2, θ̇2
                [0.0, 0.0, -u1 * sin, 0.0, cos, 0.0, 0.0],
                [0.0, 0.0, u1 * cos, 0.0, sin, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
                [0.0, 0.0, 0.0, 0.0, -self._decay, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 0.0, -self._decay, 0.0],
                [0.0, 0.0, -by_hitch, by_hitch, by_delta1, by_delta2, -loss],
            ]
        )
        slope *= duration_s
        if self._stiff:
            # in the hitch's own time, in which θ̇2 is no larger a number than θ2
            unit = np.array([1.0] * THETA2_RATE + [self._longest_s])
            return np.asarray(exponential(unit[:, None] * slope / unit) * unit / unit[:, None])
        transition = slope + 0.5 * slope @ slope
        transition.flat[:: SIZE + 1] += 1.0
        return np.asarray(transition)


def exponential(matrix: FloatArray) -> FloatArray:
    """e^A of a small square matrix: Taylor's polynomial of A/2ⁿ, squared n times.

    scipy's `expm` solves for several right-hand sides, for which its OpenBLAS wakes a thread per
    core even for seven rows: 8 ms of waiting on a busy machine.
    """
    halvings = max(0, math.frexp(np.abs(matrix).sum(axis=1).max())[1] + 2)
    small, one = math.ldexp(1.0, -halvings) * matrix, np.eye(len(matrix))
    power = one
    for n in range(TAYLOR_ORDER, 0, -1):
        power = one + small @ power / n
    for _ in range(halvings):
        power = power @ power
    return np.asarray(power)
