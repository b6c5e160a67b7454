"""Dynamic feedback linearisation of the trailer's centre of oscillation F.

With t = (cos θ2, sin θ2), n to its left, gravity g along the floor (on a slope) and d added to θ̈2
by all else (friction, resisting balls, what the observer found), the equation of motion is
k·θ̈2 = (P'' − g)·n + k·d. Then

    F''   = g + a·t − k·d·n,                a = (P'' − g)·t + k·θ̇2²
    F'''  = (a' + k·d·θ̇2)·t + a·θ̇2·n                              (d slow)
    F'''' = (a'' − a·θ̇2² + k·d·θ̈2)·t + (2a'·θ̇2 + a·θ̈2 + k·d·θ̇2²)·n

so that (a, a') as states of the controller and the choice

    θ̈2 = (s·n − 2a'·θ̇2 − k·d·θ̇2²)/a,   a'' = s·t + a·θ̇2² − k·d·θ̈2,
    P'' = g + (a − k·θ̇2²)·t + k·(θ̈2 − d)·n

make F'''' = s. With e = F − F_ref, as a complex number,

    s = F_ref'''' − 4λe''' − 6λ²e'' − 4λ³e' − λ⁴e − (λ + iω)⁴·ξ·τ,     ξ' = κλ·e/τ,

where τ = t as a complex number, which turns at ω: what remains of e on a circle turns with the
trailer, and so must the integral; the factor (λ + iω)⁴ undoes the chain's delay at that frequency.

Stability: with D = d/dt, (D + λ)⁴(D − iω)·e + κλ(λ + iω)⁴·e = 0 at constant ω. At κ = 0 its roots
are −λ, four times, and the integral's iω, which moves to iω − κλ to first order in κ; at ω = 0 all
are stable up to κ = 0.57. So e → 0 exponentially for small κ. λ is in proportion to the reference's
turn rate, so that an error of a given share of the reference demands that share of its
accelerations, slow or fast. The argument assumes that a ≠ 0 (else θ2 is
undefined: a is kept above a share of the reference's), a period short against 1/λ, no saturated
wheel, P' ≠ 0, and that d changes slowly. The whole state is covered: F, F', F'', F''' determine P,
P', θ2 and θ̇2, and θ1 follows P'. There are no zero dynamics, trailer outside or inside.

Where wheels saturate, P nearly stands still, a is kept from zero or F'' is far off for some samples
in a row, the law does not keep to the reference: it follows a recovery path within the servos'
limits (`transition`), and from its end the reference. Farther off, model predictive control leads
back (`recovery`; with recovery = "own" nothing else does); meanwhile a follows what P really does,
with a' = 0, so that the law goes on from there. Measured with "own", on contact physics, trailer
inside a circle of 0.6 m at 1 rad/s, in a grid of starts up to 0.3 m and 90 degrees off:
docs/theory/controllers.md.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.controllers.shared.estimation.observer import Observed, rolling_turn_rate
from ttwmr_mj.controllers.shared.planning import PlanningLaw
from ttwmr_mj.controllers.shared.recovery import Recovery, RecoveryKind
from ttwmr_mj.controllers.shared.steering import SteeringOptions
from ttwmr_mj.controllers.shared.transition import WaysBack
from ttwmr_mj.controllers.shared.wheels import AccelerationToWheels
from ttwmr_mj.dynamics.flatness import (
    ComplexArray,
    dot,
    point_behind,
    trailer_axes,
    velocity_behind,
)
from ttwmr_mj.dynamics.floor.influence import DRAG, GRAVITY, VISCOUS, held_back_moving
from ttwmr_mj.dynamics.hitch import spring_damper_acceleration
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.feasibility import LEAST_ACCELERATION_M_S2
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

# Shares of the starts in `transition` that are caught, 98 % with these two.
BANDWIDTH = 3.5  # λ in turn rates of the reference's trailer, if none is given (2.5: 85 %, 5: 88 %)
FAR = 0.4  # error of F'', as a share of it, from which on a way back is sought (0.2, 0.8: 93 %)


class Flatness(PlanningLaw["FlatnessOptions"]):
    """The law above, on the observer's state, with the wheel map of the article's law."""

    def start(self, task: Task) -> None:
        """Take the reference."""
        super().start(task)
        path, options, nsim = task.path_ahead, self._options, task.nsim
        assert path.flat_derivatives is not None, "path_faults looks for it"
        flat = path.flat_derivatives
        self._length, self._lean = self._robot.swing_length_m, self._robot.lean_rad
        direction, _ = trailer_axes(path.theta2_rad[0] - self._lean)
        self._wheels = AccelerationToWheels(self._robot, self._period, nsim)
        # a and a', the states of the chain
        along = acceleration_along(path)
        pull = dot(self._model.influence[GRAVITY], direction)
        self._along = np.broadcast_to(along[0] - pull, (nsim,)).copy()
        self._along_rate = np.broadcast_to(dot(flat[0, :, 3], direction), (nsim,)).copy()
        self._sign = np.sign(along[0])
        self._least = options.least_acceleration_share * np.abs(along)
        self._turn_rate = path.theta_rate[:, :, 1]  # ω
        self._integral: ComplexArray = np.zeros(nsim, dtype=np.complex128)
        mean_rate = float(np.abs(self._turn_rate).mean())
        self._bandwidth = options.bandwidth_per_s or BANDWIDTH * mean_rate
        self._trouble: BoolArray = np.zeros(nsim, dtype=np.bool_)
        self._ways = WaysBack(
            flat, self._least, float(self._sign[0]), mean_rate, self._robot, self._period, nsim
        )
        self._recovery: Recovery | None = None
        if options.recovery != "own":
            robot, friction = self._robot, self._friction
            self._recovery = Recovery(robot, friction, self._period, nsim, self._learns)
            self._plan(path)

    def _plan(self, path: ReferencePath, passes: int = 0) -> None:
        if self._recovery is not None:
            self._recovery.plan(path, self._planned, passes)

    def command(self, k: int, estimate: Estimate) -> Command:
        """One sample of the law."""
        now = self._observer.update(estimate)
        theta2, rate = now.body[:, 3] - self._lean, now.body[:, 4]
        T, length = self._period, self._length
        d, g = now.unexplained + self._hitch(now), now.influence[:, GRAVITY]
        self._change_way(k, now)
        s, error = self._fourth_derivative(k, now, d)
        t, n = trailer_axes(theta2)
        a, a_rate, kd = self._along, self._along_rate, length * d
        theta2_acceleration = (dot(s, n) - 2.0 * a_rate * rate - kd * rate**2) / a
        a_acceleration = dot(s, t) + a * rate**2 - kd * theta2_acceleration
        # means over the period, along axes turned to its middle
        t, n = trailer_axes(theta2 + 0.5 * T * rate)
        along = a + 0.5 * T * a_rate + T * T / 6.0 * a_acceleration - length * rate**2
        across = length * (theta2_acceleration - d)
        wish = g + along[:, None] * t + across[:, None] * n
        command = self._wheels.command(wish, self._state(now))
        command, led = self._led_back(k, now, command)
        after = self._observer.commanded(command.wheel_speed_rad_s)
        self._along = a + T * a_rate + 0.5 * T * T * a_acceleration
        self._along_rate = a_rate + T * a_acceleration
        cut = command.saturated | led
        held = self._hold_to_the_possible(k, now, after, cut)
        trouble = self._trouble | held | cut | command.near_singular
        self._trouble = trouble & ~led
        share = self._options.integral_share * self._bandwidth
        self._integral = self._integral + T * share * error * ~cut
        return replace(command, signals=self._signals(now))

    def _hitch(self, now: Observed) -> FloatArray:
        """(nsim,) θ̈2 of spring, damper, smoothed friction and resisting balls."""
        theta2, rate = now.body[:, 3], now.body[:, 4]
        spring = spring_damper_acceleration(
            theta2 - now.body[:, 2], self._friction.rate(now), self._robot
        )
        push = spring + self._friction.acceleration(now, self._model.influence[VISCOUS])
        if not now.influence[:, DRAG].any():
            return push
        drag, velocity = now.influence[:, DRAG], self._velocity(now)
        held = held_back_moving(drag, velocity, theta2, rate, self._robot)
        return push + held / self._length

    def _fourth_derivative(
        self, k: int, now: Observed, d: FloatArray
    ) -> tuple[FloatArray, ComplexArray]:
        """Choice s (nsim, 2) [m/s⁴], and e (nsim,) [m] in the trailer's frame, a complex number."""
        reference = self._ways.reference(k)
        theta2, rate = now.body[:, 3] - self._lean, now.body[:, 4]
        a, kd = self._along, self._length * d
        t, n = trailer_axes(theta2)
        e = point_behind(now.body, self._length, self._lean) - reference[:, 0]
        e1 = velocity_behind(self._velocity(now), theta2, rate, self._length) - reference[:, 1]
        g = now.influence[:, GRAVITY]
        e2 = g + a[:, None] * t - kd[:, None] * n - reference[:, 2]
        e3 = (self._along_rate + kd * rate)[:, None] * t + (a * rate)[:, None] * n
        e3 = e3 - reference[:, 3]
        self._trouble = np.hypot(*e2.T) > FAR * np.hypot(*reference[:, 2].T)
        w = self._bandwidth
        s = reference[:, 4] - 4 * w * e3 - 6 * w**2 * e2 - 4 * w**3 * e1 - w**4 * e
        i = (w + 1j * self._turn_rate[k]) ** 4 * self._integral
        s = s - i.real[:, None] * t - i.imag[:, None] * n
        return s, dot(e, t) + 1j * dot(e, n)

    def _change_way(self, k: int, now: Observed) -> None:
        """A new way back for those who could not do what the law asked for."""
        who = self._ways.wanted(k, self._trouble)
        if not who.any():
            return
        start = self._ways.choose(
            k,
            who,
            now.body[who],
            self._velocity(now)[who],
            now.wheels[who],
            now.influence[who, GRAVITY],
        )
        if start is not None:
            self._along[who], self._along_rate[who] = start

    def _led_back(self, k: int, now: Observed, command: Command) -> tuple[Command, BoolArray]:
        """The command, with other wheel speeds for those (nsim,) who are led back by plans."""
        none = np.zeros(self._nsim, dtype=np.bool_)
        if self._recovery is None:
            return command, none
        k = self._since_plan(k, now)
        led, led_wheels = self._recovery.command(k, now, self._disturbance(now))
        if not led.any():
            return command, led
        wheels = command.wheel_speed_rad_s.copy()
        wheels[led] = led_wheels
        self._wheels.follow(led, wheels)
        self._ways.leave(led)
        cut = np.where(led, self._at_limit(wheels, now), command.saturated)
        return replace(command, wheel_speed_rad_s=wheels, saturated=cut), led

    def _hold_to_the_possible(
        self, k: int, now: Observed, after: Observed, cut: BoolArray
    ) -> BoolArray:
        """Keep a away from zero, and to what P really does where the law did not get its wish.

        Returns:
            (nsim,) where a had come too close to zero.
        """
        change = self._velocity(after) - self._velocity(now)
        t, _ = trailer_axes(0.5 * (now.body[:, 3] + after.body[:, 3]) - self._lean)
        pull = dot(now.influence[:, GRAVITY], t)
        possible = dot(change, t) / self._period - pull + self._length * after.body[:, 4] ** 2
        size = self._sign * np.where(cut, possible, self._along)
        least = self._least[k]
        self._along = self._sign * np.maximum(size, least)
        self._along_rate = np.where(cut | (size < least), 0.0, self._along_rate)
        return np.asarray(size < least)

    def _velocity(self, now: Observed) -> FloatArray:
        """(nsim, 2) of P, slip included [m/s]."""
        return self._model.velocity(now.body, now.wheels, now.slip)

    def _state(self, now: Observed) -> RobotState:
        """What the wheel map asks for; it looks at rates only at the first sample."""
        turn_rate = rolling_turn_rate(now.wheels, self._robot)
        rates = np.column_stack([self._velocity(now), turn_rate, now.body[:, 4]])
        return RobotState(q=now.body[:, :4], q_rate=rates)


def acceleration_along(path: ReferencePath) -> FloatArray:
    """(n, batch) a = F''·t of a reference of F [m/s²]; NaN where θ2 is undefined."""
    assert path.flat_derivatives is not None, "path_faults looks for it"
    return dot(path.flat_derivatives[:, :, 2], trailer_axes(path.theta2_rad)[0])


class FlatnessOptions(SteeringOptions):
    """Linearises the motion of F exactly; steers the trailer."""

    law = Flatness
    kind: Literal["flatness"] = "flatness"
    bandwidth_per_s: float | None = Field(
        default=None,
        ge=1e-12,
        le=30,
        description="λ: all four poles of the error are near −λ; default: 3.5 times the mean "
        "turn rate of the reference's trailer, typically 1 to 4",
    )
    integral_share: float = Field(
        default=0.15,
        ge=0,
        le=0.5,
        description="κ: the integral of the error settles at the rate κλ; typically 0.15",
    )
    least_acceleration_share: float = Field(
        default=0.3,
        ge=1e-12,
        le=1,
        description="share of the reference's |F''| below which the law does not let |F''| "
        "fall, as θ2 is undefined where F'' = 0; typically 0.3",
    )
    recovery: RecoveryKind = "auto"

    def path_faults(self, reference: Reference, path: ReferencePath) -> list[Fault]:
        """The law needs the centre of oscillation, accelerating."""
        key, got, law = ("reference", "kind"), repr(reference.kind), "controller.kind = 'flatness'"
        if path.flat_derivatives is None:
            problem = f"{law} needs a reference of the trailer's centre of oscillation"
            allowed = "'flat_circle', 'flat_ellipse', 'flat_arc'"
            return [Fault(key=key, got=got, problem=problem, allowed=allowed)]
        along = acceleration_along(path)
        turned = np.sign(along) != np.sign(along[0])  # it has passed through zero, between samples
        along = np.where(turned, 0.0, np.nan_to_num(np.abs(along))).min(axis=1)  # NaN: F'' is zero
        if along.min() >= LEAST_ACCELERATION_M_S2:
            return []
        problem = (
            "on which the trailer's centre of oscillation hardly accelerates at "
            f"{path.time_s[along.argmin()]:.3g} s ({along.min():.1g} m/s²); {law} needs at least "
            f"{LEAST_ACCELERATION_M_S2:g} m/s² everywhere"
        )
        return [Fault(key=key, got=got, problem=problem, hint="'tvlqr' and 'mpc' do not")]
