"""Feasible recovery paths onto a reference of the trailer's centre of oscillation F.

Far from the reference the flatness-based law demands more than the servos can do, and nothing
plans what the robot then does. A recovery path, here a way back, needs no more: F_ref + p with

    p(τ) = Σ_j e⁽ʲ⁾·Dʲ·h_j(τ/D),   h_j(s) = sʲ/j!·(1 − s)⁴·Σ_{i ≤ 3−j} C(3+i, i)·sⁱ,

the polynomial of degree 7 that starts with the error e, e', e'', e''' and ends with none after D.
Whoever follows it starts without error. F and F' are where the robot is; F'' must point along the
trailer and F''' turn with it, F'' = a·t, F''' = a'·t + a·θ̇2·n, which leaves a and a' free: they are
accelerations of P, and the wheels can change those within a period. So ways differ in D, a and a'.
Flatness gives the whole motion along each at once; speeds and accelerations of the wheels and the
size of a are compared with their limits. The cost of a way counts its duration, by how much it
exceeds the limits and how far it leads away; the cheapest is followed until the next saturation.

The law thus recovers from a start if one of the ways stays within the limits with a margin for the
feedback, and the law that follows it stays within its own region. Otherwise there is no guarantee.
"""

from math import comb, factorial

import numpy as np
from numpy.polynomial.polynomial import polyder, polymul

from ttwmr_mj.dynamics.flatness import motion_from_flat, point_behind, trailer_axes, velocity_behind
from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray

ORDERS = 5  # p and four derivatives
# Measured on the sampled model: 40 random starts, trailer inside a circle of 0.6 m at 1 rad/s, P up
# to 0.3 m to either side, θ2 up to 60° off. 39 are caught within 10 s; in brackets, with others.
DURATIONS_RAD = np.geomspace(0.6, 6.0, 9)  # D, as the trailer's turn meanwhile (up to 3: 78 %)
SIZES = np.array([1.0, 0.7, 0.45, 1.5, 2.2])  # of a at the start, in |F''| (1 alone: 90 %)
RATES = np.array([0.0, -0.7, 0.7])  # of a' at the start, in a times the turn rate (0 alone: 93 %)
POINTS = 60  # of the longest way that are examined (20: 55 %)
USABLE = 0.95  # share of the servos' limits that a way may take: feedback has the rest
EXCESS_RAD = 10.0  # cost of twice the limits, in turn of the reference (3: 75 %, 30: 90 %)
AWAY_RAD = 10.0  # cost of leading a circle's radius, |F''|/rate², away (0: 95 %, 30: 93 %)
PATIENCE = 2  # samples of trouble in a row, and of a way, before another (1: 93 %, 4: 73 %)


class WaysBack:
    """The reference, with a way back to it for each simulation that needs one."""

    def __init__(
        self,
        flat: FloatArray,
        least: FloatArray,
        sign: float,
        turn_rate_rad_s: float,
        robot: RobotParameters,
        period_s: float,
        nsim: int,
    ) -> None:
        """All simulations start on the reference.

        Args:
            flat: (n, 1, 5, 2) F and its derivatives.
            least: (n, 1) size that a must keep [m/s²].
            sign: of a.
            turn_rate_rad_s: mean size of the reference's θ̇2.
            robot: geometry and servo.
            period_s: T.
            nsim: simulations.
        """
        self._flat, self._least, self._sign = flat, least, sign
        self._turn_rate, self._robot, self._period = turn_rate_rad_s, robot, period_s
        steps = np.unique(np.rint(DURATIONS_RAD / (turn_rate_rad_s * period_s)))
        grid = np.meshgrid(steps, SIZES, RATES, indexing="ij")
        self._steps, self._size, self._rate = (values.ravel() for values in grid)
        # the way of each simulation: e at its start, when that was, D; all begin at its end
        self._error = np.zeros((nsim, 4, 2))
        self._began = np.full(nsim, -PATIENCE)
        self._duration = np.ones(nsim)
        self._troubled = np.zeros(nsim)  # samples in a row

    def reference(self, k: int) -> FloatArray:
        """(nsim, 5, 2) F and its derivatives to follow at sample k."""
        elapsed = (k - self._began) * self._period
        return np.asarray(self._flat[k] + way_back(self._error, elapsed, self._duration))

    def wanted(self, k: int, trouble: BoolArray) -> BoolArray:
        """(nsim,) who needs another way; to be asked at every sample, with whose law is cut."""
        self._troubled = (self._troubled + 1.0) * trouble
        return np.asarray((self._troubled >= PATIENCE) & (k - self._began > PATIENCE))

    def choose(
        self,
        k: int,
        who: BoolArray,
        body: FloatArray,
        velocity: FloatArray,
        wheels: FloatArray,
        gravity: FloatArray,
    ) -> tuple[FloatArray, FloatArray] | None:
        """Give simulations a way from where they are; None near the end of the reference.

        Args:
            k: the sample.
            who: (nsim,) those who get one, m of them.
            body: (m, 5) x, y, θ1, θ2, θ̇2.
            velocity: (m, 2) P'.
            wheels: (m, 2) setpoints of the servos [rad/s].
            gravity: (m, 2) along the floor [m/s²].

        Returns:
            (m,) a and a' to start with.
        """
        usable = self._steps < len(self._flat) - k
        if not usable.any():
            return None
        steps, now = self._steps[usable], self._flat[k, 0]
        radius = np.hypot(*now[2]) / self._turn_rate**2  # of a circle with this acceleration
        a = self._sign * np.hypot(*now[2]) * self._size[usable]
        a_rate = a * self._turn_rate * self._rate[usable]
        error = self._flat_state(body, velocity, a, a_rate) - now[:4]
        error[:, :, 2] += gravity
        strain, away = self._strain(k, error, steps * self._period, wheels, gravity)
        angle = self._turn_rate * self._period * steps
        cost = EXCESS_RAD * np.maximum(strain - 1.0, 0.0) + AWAY_RAD * away / radius
        chosen = (angle[:, None] + cost).argmin(axis=0)
        self._error[who], self._began[who] = error[chosen, np.arange(len(body))], k
        self._duration[who] = steps[chosen] * self._period
        return a[chosen], a_rate[chosen]

    def _flat_state(
        self, body: FloatArray, velocity: FloatArray, a: FloatArray, a_rate: FloatArray
    ) -> FloatArray:
        """(c, m, 4, 2) F and three derivatives of bodies (m, 5), for c choices of a and a'."""
        length, lean, rate = self._robot.swing_length_m, self._robot.lean_rad, body[:, 4]
        theta2 = body[:, 3] - lean
        t, n = trailer_axes(theta2)
        F = point_behind(body, length, lean), velocity_behind(velocity, theta2, rate, length)
        second = a[:, None, None] * t
        third = a_rate[:, None, None] * t + (a[:, None] * rate)[..., None] * n
        known = (np.broadcast_to(values, second.shape) for values in F)
        return np.stack([*known, second, third], axis=2)

    def _strain(
        self,
        k: int,
        error: FloatArray,
        duration_s: FloatArray,
        wheels: FloatArray,
        gravity: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """What ways take: the worst ratio to what they may take (c, m), and how far |p| gets [m].

        Args:
            k: the sample of the start.
            error: (c, m, 4, 2) e and its derivatives then.
            duration_s: (c,).
            wheels: (m, 2) setpoints then [rad/s].
            gravity: (m, 2) along the floor [m/s²].
        """
        longest = round(float(duration_s.max()) / self._period)
        stride = max(longest // POINTS, 1)
        window = np.arange(0, longest + 1, stride)
        count = (window.size, *error.shape[:2])
        elapsed = np.broadcast_to(self._period * window[:, None, None], count)
        p = way_back(error, elapsed, np.broadcast_to(duration_s[:, None], count))
        pull = np.zeros((len(gravity), ORDERS - 2, 2))
        pull[:, 0] = gravity
        motion = motion_from_flat(self._flat[k + window, None] + p, self._sign, self._robot, pull)
        speeds = wheels_from_twist(motion.twist, self._robot)
        change = np.abs(np.diff(speeds, axis=0)).max(axis=(0, -1)) / (stride * self._period)
        # at the start a and a' may jump: two periods for it
        jump = np.abs(speeds[0] - wheels).max(axis=-1) / (2.0 * self._period)
        servo = self._robot.servo
        speed = np.abs(speeds).max(axis=(0, -1)) / (USABLE * servo.speed_limit_rad_s)
        change = np.maximum(change, jump) / (USABLE * servo.acceleration_limit_rad_s2)
        size = self._least[k + window, None] / np.maximum(np.abs(motion.along), 1e-9)
        away = np.hypot(p[..., 0, 0], p[..., 0, 1]).max(axis=0)
        return np.maximum.reduce([speed, change, size.max(axis=0)]), away


def way_back(error: FloatArray, elapsed_s: FloatArray, duration_s: FloatArray) -> FloatArray:
    """(..., 5, 2) p and its derivatives.

    Args:
        error: (..., 4, 2) e and its derivatives at the start.
        elapsed_s: (...) time since then; at and beyond the duration p is zero.
        duration_s: (...) D.
    """
    s = np.minimum(elapsed_s / duration_s, 1.0)[..., None, None]
    powers = s ** np.arange(8)
    scaled = error * duration_s[..., None, None] ** np.arange(4)[:, None]
    shape = np.stack([powers @ derivative.T for derivative in _BASIS], axis=-2)[..., 0, :, :]
    rates = duration_s[..., None, None] ** -np.arange(float(ORDERS))[:, None]
    return np.asarray((shape @ scaled) * rates * (s < 1.0))


def _basis() -> list[FloatArray]:
    """Coefficients (4, 8) of h_j in powers of s, and of their derivatives by s."""
    h = np.zeros((4, 8))
    for j in range(4):
        tail = [comb(3 + i, i) for i in range(4 - j)]
        h[j, j:] = polymul([1.0, -4.0, 6.0, -4.0, 1.0], tail) / factorial(j)
    slopes = [np.pad(polyder(h, order, axis=1), ((0, 0), (0, order))) for order in range(ORDERS)]
    return list(np.ascontiguousarray(slopes))  # rounding depends on the layout


_BASIS = _basis()
