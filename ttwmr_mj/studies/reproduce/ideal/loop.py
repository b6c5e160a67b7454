"""The published laws on Eq. 31 itself: no wheels, no servo, no contact, a free trailer.

Two ways through time: `solve` follows the closed loop as a differential equation, `sampled` holds
the command over a step and moves exactly in between, so that its limit is the same equation.

The laws are written here a second time, on plain floats: millions of evaluations are needed, at
2 µs each; the controllers' take 17 µs on arrays, and all step sizes of a law as one batch would
still take six times as long as one after the other on floats. A test keeps them equal to
`controllers.lyapunov` and `controllers.lyapunov_pid`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.controllers.lyapunov_pid import LyapunovPidOptions
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

State = tuple[float, float, float, float, float, float, float]
ESCAPED = 1e6  # m, m/s, rad: a state that far has diverged


@dataclass(frozen=True, slots=True)
class Answer:
    """What the law answers at one instant.

    Attributes:
        v1, v2: accelerations of P [m/s²].
        d: D of Eq. 48 [m/s²].
        e5: θ2 − θ2d on the circle [rad].
    """

    v1: float
    v2: float
    d: float
    e5: float


@dataclass(frozen=True, slots=True)
class IdealLoop:
    """Eq. 31 on a circle, closed by law (32), (47) or (70).

    The state is z of Eq. 25 and the integral of e5: (x, ẋ, y, ẏ, θ2, θ̇2, ∫e5 dt).

    Attributes:
        options: the law; a `LyapunovOptions` is law (32).
        radius_m, rate_rad_s, phase_rad: the circle.
        theta2_offset_rad: θ2d − (ω·t + phase): π/2 aligned with the tractor, π outward.
        limit_m_s2: |v1| and |v2| are cut to this.
    """

    options: LyapunovOptions
    radius_m: float
    rate_rad_s: float
    phase_rad: float = 0.0
    theta2_offset_rad: float = 0.5 * math.pi
    limit_m_s2: float = math.inf
    swing_length_m: float = RobotParameters().swing_length_m

    def at_rest(self, x_m: float, y_m: float) -> State:
        """Standing at a point, the trailer as the reference starts: along the tangent."""
        return (x_m, 0.0, y_m, 0.0, self.phase_rad + 0.5 * math.pi, 0.0, 0.0)

    def errors(self, time_s: float, z: State) -> tuple[float, float, float, float]:
        """(e1, e2, e3, e4) of Eq. 30."""
        rate = self.rate_rad_s
        angle = rate * time_s + self.phase_rad
        x, y = self.radius_m * math.cos(angle), self.radius_m * math.sin(angle)
        return z[0] - x, z[1] + rate * y, z[2] - y, z[3] - rate * x

    def lyapunov(self, time_s: float, z: State) -> float:
        """V of Eq. 33."""
        e1, e2, e3, e4 = self.errors(time_s, z)
        o = self.options
        return 0.5 * (o.alpha1 * e1**2 + o.alpha2 * e2**2 + o.alpha3 * e3**2 + o.alpha4 * e4**2)

    def distances(self, path: Solution) -> FloatArray:
        """(n,) of P from its reference along a solution [m]."""
        errors = [self.errors(t, z) for t, z in zip(path.time_s, path.z, strict=True)]
        return np.asarray(np.hypot(*np.array(errors)[:, ::2].T))

    def command(self, time_s: float, z: State) -> Answer:
        """The law at one instant, cut to the limit."""
        o = self.options
        e1, e2, e3, e4 = self.errors(time_s, z)
        angle = self.rate_rad_s * time_s + self.phase_rad
        pull = self.rate_rad_s**2 * self.radius_m
        v1 = -pull * math.cos(angle) - o.alpha2 * e2 - o.alpha1 / o.alpha2 * pulled(e1, e2, o)
        v2 = -pull * math.sin(angle) - o.alpha4 * e4 - o.alpha3 / o.alpha4 * pulled(e3, e4, o)
        sin, cos = math.sin(z[4]), math.cos(z[4])
        d = o.alpha4 * e4 * sin + o.alpha2 * e2 * cos
        e5 = _on_circle(z[4] - angle - self.theta2_offset_rad)
        if isinstance(o, LyapunovPidOptions):
            wanted = -o.k_d * (z[5] - self.rate_rad_s) - o.k_p * e5 - o.k_i * z[6]
            gamma = _gamma(v2 * cos - v1 * sin - self.swing_length_m * wanted, d, o)
            v1, v2 = v1 + gamma * o.alpha4 * e4, v2 - gamma * o.alpha2 * e2
        limit = self.limit_m_s2
        return Answer(max(-limit, min(limit, v1)), max(-limit, min(limit, v2)), d, e5)

    def rates(self, time_s: float, z: State) -> State:
        """Eq. 31 and the rate of the integral."""
        command = self.command(time_s, z)
        across = command.v2 * math.cos(z[4]) - command.v1 * math.sin(z[4])
        turn = across / self.swing_length_m
        return z[1], command.v1, z[3], command.v2, z[5], turn, command.e5


def pulled(e: float, e_rate: float, options: LyapunovOptions) -> float:
    """The error plus the term used for e²/ė (Eq. 32)."""
    if options.singular_terms == "omitted":
        return e
    if options.singular_terms == "regularized":
        return e + e * e * e_rate / (e_rate * e_rate + options.regularization_m_s**2)
    return e + e * e / e_rate if e_rate else e


def _gamma(excess: float, d: float, options: LyapunovPidOptions) -> float:
    if options.gamma == "constant":
        wish = options.rho * excess
    elif options.gamma == "regularized":
        wish = excess * d / (d * d + options.gamma_regularization_m_s2**2)
    else:
        wish = excess / d if d else 0.0
    limit = math.inf if options.gamma_limit is None else options.gamma_limit
    return max(-limit, min(limit, wish))


def _on_circle(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class Solution:
    """A solution: times (n,) [s], states (n, 7), and why it ended."""

    time_s: FloatArray
    z: FloatArray
    end: str  # "time", "singular" (no solution goes on) or "escaped"


def ends_where(passes_zero: Callable[[float, Any], float]) -> Callable[[float, Any], float]:
    """An event of `solve_ivp` that ends the solution where a function of (time, state) is zero."""

    def event(time_s: float, state: Any) -> float:
        return passes_zero(time_s, state)

    event.terminal = True  # type: ignore[attr-defined]  # solve_ivp's protocol
    return event


def solve(
    loop: IdealLoop,
    start: State,
    duration_s: float,
    until: Callable[[float, State], float] | None = None,
    samples: int = 200,
) -> Solution:
    """The closed loop as a differential equation (DOP853, relative tolerance 1e-8).

    Args:
        loop: plant and law.
        start: state at time zero.
        duration_s: how long.
        until: ends the solution where it passes zero; also ending it is a step that vanishes.
        samples: rows of the answer, evenly spaced, and the last instant reached.
    """
    from scipy.integrate import solve_ivp

    found = solve_ivp(
        loop.rates,
        (0.0, duration_s),
        start,
        method="DOP853",
        rtol=1e-8,
        atol=1e-10,
        first_step=1e-6,
        events=None if until is None else ends_where(until),
        dense_output=until is not None,  # costs as much again
        t_eval=None if until else np.linspace(0.0, duration_s, samples),
    )
    if until is None:
        return Solution(found.t, found.y.T, "time" if found.success else "singular")
    times = np.linspace(0.0, float(found.t[-1]), samples)
    return Solution(times, found.sol(times).T, "time" if found.status == 0 else "singular")


def sampled(
    loop: IdealLoop, start: State, duration_s: float, step_s: float, samples: int = 200
) -> Solution:
    """The law evaluated every step and held: what a computer does with it.

    P moves exactly under the held acceleration; θ2 by the acceleration at the step's start.
    """
    count = round(duration_s / step_s)
    every = max(1, count // samples)
    times, rows = [], []
    x, u, y, w, angle, rate, integral = start
    swing_length = loop.swing_length_m
    half, end = 0.5 * step_s, "time"
    for k in range(count + 1):
        now = k * step_s
        z = (x, u, y, w, angle, rate, integral)
        if k % every == 0:
            times.append(now)
            rows.append(z)
            if not max(map(abs, z[:4])) < ESCAPED:
                end = "escaped"
                break
        command = loop.command(now, z)
        v1, v2 = command.v1, command.v2
        angle_acceleration = (v2 * math.cos(angle) - v1 * math.sin(angle)) / swing_length
        x, u = x + step_s * (u + half * v1), u + step_s * v1
        y, w = y + step_s * (w + half * v2), w + step_s * v2
        angle += step_s * (rate + half * angle_acceleration)
        rate += step_s * angle_acceleration
        integral += step_s * command.e5
    return Solution(np.array(times), np.array(rows), end)
