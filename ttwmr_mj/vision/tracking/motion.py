"""How the robot moves between two frames, and how sure one can be of it.

State s = (x, y, θ1, θ2, …, δ1, δ2, θ̇2, …): the hybrid model (Eq. 24-29) driven by the commanded
twist plus deviations δ1 [m/s], δ2 [rad/s] of the true twist from it, which decay and are stirred
anew (slip, servo error). Without commands the deviations are all the twist there is.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.tracking.commands import TwistRamp
from ttwmr_mj.vision.tracking.options import TrackerOptions
from ttwmr_mj.vision.tracking.swing import Instant, swing_of

LONGEST_LINEARIZATION_S = 0.04  # a control period of 33 ms; 66 ms change deviations by 5 %
TAYLOR_ORDER = 11  # of e^A where |A| ≤ 1/4: the first term left out is 1e-16
MILD = 0.5  # a rate times a time up to which a Taylor polynomial of second order does
ACCELERATION_TIME_S = 0.033  # the missing acceleration is taken as constant for so long
# random walk of x, y and the angles themselves, which no deviation of the twist explains: m and
# rad in the root of a second, far below what the deviations stir up
POSITION_WALK, ANGLE_WALK = (2e-4, 2e-4), 1e-3

MOST_VARIANCE = 1e4  # of m, rad and their rates: nothing is known; a trailer unseen is soon there

State = tuple[float, ...]  # the few numbers of `Gaussian.mean`; faster than so small an array


@dataclass(frozen=True, slots=True)
class Gaussian:
    """A normal distribution of the state."""

    time_s: float  # when
    mean: FloatArray  # (5 + 2n,) x, y, θ1, θ2, …, δ1, δ2, θ̇2, …
    covariance: FloatArray  # of these


class MotionModel:
    """Carries distributions of the state forward in time.

    Attributes:
        size: of the state.
        deviation: (2,) standard deviation of δ1 and δ2 in the long run.
    """

    def __init__(self, robot: RobotParameters, options: TrackerOptions) -> None:
        """Take the robot's constants and the size of what the model lacks."""
        n = len(robot.trailers)
        self._width, self.size = 3 + n, 5 + 2 * n
        self._swing = swing_of(robot)
        self._stiff = self._swing.fastest_1_s * LONGEST_LINEARIZATION_S > MILD
        self._longest_s = 1.0 / self._swing.fastest_1_s if self._stiff else math.inf
        self._decay = 1.0 / options.noise_time_s
        self.deviation = np.array([options.speed_noise_m_s, options.turn_noise_rad_s])
        swing = options.swing_noise_rad_s2**2 * ACCELERATION_TIME_S
        walk = np.array([*POSITION_WALK, *[ANGLE_WALK] * (1 + n)]) ** 2
        twist = 2.0 * self._decay * self.deviation**2
        self._density = np.concatenate([walk, twist, np.full(n, swing)])

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

    def _advance(self, state: State, ramp: TwistRamp) -> State:
        """One ramp: exact heading, Simpson's rule for P, Runge-Kutta for the trailers."""
        x, y, theta1, *theta = state[: self._width]
        delta1, delta2, *rate = state[self._width :]
        dt = ramp.duration_s
        fade = math.exp(-self._decay * dt)
        a1, a2 = ramp.u1_start + delta1, ramp.u2_start + delta2
        delta1, delta2 = fade * delta1, fade * delta2
        b1, b2 = ramp.u1_end + delta1, ramp.u2_end + delta2
        m1, m2 = 0.5 * (a1 + b1), 0.5 * (a2 + b2)
        middle = theta1 + 0.25 * dt * (a2 + m2)
        end = theta1 + dt * m2
        x += dt / 6.0 * (a1 * math.cos(theta1) + 4.0 * m1 * math.cos(middle) + b1 * math.cos(end))
        y += dt / 6.0 * (a1 * math.sin(theta1) + 4.0 * m1 * math.sin(middle) + b1 * math.sin(end))
        turning = Instant(theta1, a1, a2), Instant(middle, m1, m2), Instant(end, b1, b2)
        angles, rates = self._swing.advance(tuple(theta), tuple(rate), turning, (b1 - a1) / dt, dt)
        return x, y, end, *angles, delta1, delta2, *rates

    def _spread(
        self, covariance: FloatArray, start: State, end: State, ramp: TwistRamp, duration_s: float
    ) -> FloatArray:
        """The covariance after a time, linearized about the middle of the motion."""
        middle = tuple(0.5 * (a + b) for a, b in zip(start, end, strict=True))
        transition = self._transition(middle, ramp, duration_s)
        spread = transition @ covariance @ transition.T
        spread.flat[:: self.size + 1] += self._density * duration_s
        if spread.diagonal().max() > MOST_VARIANCE:  # of each by itself, or all would seem known
            cut = np.sqrt(np.minimum(1.0, MOST_VARIANCE / spread.diagonal()))
            spread *= cut[:, None] * cut
        return np.asarray(0.5 * (spread + spread.T))

    def _transition(self, middle: State, ramp: TwistRamp, duration_s: float) -> FloatArray:
        """(size, size) derivative of the state after a time by the state before it."""
        width, size = self._width, self.size
        _, _, theta1, *theta = middle[:width]
        delta1, delta2, *rate = middle[width:]
        u1 = 0.5 * (ramp.u1_start + ramp.u1_end) + delta1
        u2 = 0.5 * (ramp.u2_start + ramp.u2_end) + delta2
        u1_rate = (ramp.u1_end - ramp.u1_start) / ramp.duration_s - self._decay * delta1
        at = Instant(theta1, u1, u2)
        by = self._swing.slopes(tuple(theta), tuple(rate), at, u1_rate, self._decay)
        cos, sin = math.cos(theta1), math.sin(theta1)
        twist, rates = slice(width, width + 2), slice(width + 2, size)
        slope = np.zeros((size, size))
        slope[0, 2], slope[1, 2] = -u1 * sin, u1 * cos
        slope[0, width], slope[1, width] = cos, sin
        slope[2, width + 1] = 1.0
        slope[np.arange(3, width), np.arange(width + 2, size)] = 1.0
        slope[width, width] = slope[width + 1, width + 1] = -self._decay
        slope[rates, 2], slope[rates, 3:width] = by.by_theta1, by.by_theta
        slope[rates, twist], slope[rates, rates] = by.by_twist, by.by_rate
        slope *= duration_s
        if self._stiff:
            # in the hitches' own time, in which θ̇2 is no larger a number than θ2
            unit = np.ones(size)
            unit[rates] = self._longest_s
            return np.asarray(exponential(unit[:, None] * slope / unit) * unit / unit[:, None])
        transition = slope + 0.5 * slope @ slope
        transition.flat[:: size + 1] += 1.0
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
