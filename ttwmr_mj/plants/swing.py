"""Integration of the hitch angle φ = θ2 − θ1 of a trailer behind a tractor whose motion is given.

    φ̈ = (u1·u2·cos φ − u̇1·sin φ)/k − u̇2 + T/(J2 + m2·l²)          (Eq. 17, 24, 27-28)

On a slope, gravity's pull along the floor is taken off the accelerations u̇1 and u1·u2 of P. T is
the torque of the hitch and of balls that resist. A load off the trailer's axis swings at φ − β
(`robot.lean_rad`).

Classical fourth-order Runge-Kutta over stretches of time in which the tractor's accelerations are
constant, and dry friction that truly sticks.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from ttwmr_mj.config import each
from ttwmr_mj.dynamics.floor.balls import FADING_M_S, Forces, held_back, resisting_torque, slowing
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.hitch import published_spring_acceleration, spring_damper_acceleration
from ttwmr_mj.dynamics.hybrid import sideways
from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

# Damped linear oscillators are stable under classical RK4 while |eigenvalue|·step stays below
# 2.616, the distance of the stability region's boundary from the origin in the left half plane.
RK4_STABLE_RADIUS = 2.6


class Forcing(NamedTuple):
    """What the tractor's motion does to the hitch over one stretch of time, per simulation.

    A stretch of zero duration changes nothing, exactly.
    """

    duration_s: FloatArray  # (nsim,)
    ahead: FloatArray  # (3, nsim) at start, middle and end; (1, nsim) constant: u̇1 per length
    left: FloatArray  # (3, nsim) u1·u2 per length
    drive: FloatArray  # (nsim,) −u̇2 [rad/s²]
    twist: FloatArray | None  # (2, 3, nsim) u1 and u2 of the tractor, where they are needed

    def after(self, fraction: FloatArray) -> Forcing:
        """The rest of the stretch from a fraction (nsim,) of its duration on."""
        return self._part(fraction, np.ones_like(fraction))

    def until(self, fraction: FloatArray) -> Forcing:
        """The stretch up to a fraction (nsim,) of its duration."""
        return self._part(np.zeros_like(fraction), fraction)

    def _part(self, start: FloatArray, end: FloatArray) -> Forcing:
        times = np.stack([start, 0.5 * (end + start), end])
        ahead = self.ahead if len(self.ahead) == 1 else _parabola(self.ahead, times)
        left = _parabola(self.left, times)  # exact on level floor, where u1 and u2 are linear
        twist = None if self.twist is None else np.stack([_parabola(u, times) for u in self.twist])
        return Forcing((end - start) * self.duration_s, ahead, left, self.drive, twist)


def _parabola(nodes: FloatArray, times: FloatArray) -> FloatArray:
    """At times (m, nsim) in [0, 1], through values (3, nsim) at start, middle and end."""
    start, middle, end = nodes
    slope, bend = 4.0 * middle - 3.0 * start - end, 2.0 * (start - 2.0 * middle + end)
    return np.asarray(start + times * (slope + times * bend))


class _Constants(NamedTuple):
    """What a robot's numbers are to its hitch; one each, or (nsim,)."""

    stiffness: float  # [1/s²]
    damping: float  # [1/s]
    friction: float  # [rad/s²]
    forces: Forces  # that hold back the balls [1/(m·s²)]
    fading: float  # speed below which balls are held back by less [m/s]
    longest_step_s: float

    @classmethod
    def of(
        cls, robot: RobotParameters, ground: Ground, longest_s: float, *, published_spring: bool
    ) -> _Constants:
        """Arguments as of `HitchSwing`."""
        law = published_spring_acceleration if published_spring else spring_damper_acceleration
        one, zero = np.ones(()), np.zeros(())
        stiffness, damping = -float(law(one, zero, robot)), -float(law(zero, one, robot))
        inertia = robot.swing_inertia_kg_m2
        friction = robot.hitch.coulomb_friction_n_m / inertia
        forces = held_back(robot, robot.casters.rolling_resistance_m, ground.normal_gravity_m_s2)
        forces = Forces(*(f / inertia for f in forces))
        # as soft as the step needs it, lest a ball that is nearly at rest chatter
        fading = max(FADING_M_S, float(slowing(forces, robot.trailer.com_offset_m)) * longest_s)
        linear = np.array([[0.0, 1.0], [-stiffness, -damping]])
        fastest = float(np.abs(np.linalg.eigvals(linear)).max())
        longest_step_s = RK4_STABLE_RADIUS / fastest if fastest else np.inf
        return cls(stiffness, damping, friction, forces, fading, longest_step_s)


class HitchSwing:
    """The hitch's equation of motion with its spring, damper and dry friction.

    Friction keeps its direction while the hitch slides and stops it where the rate, taken as
    linear in time, passes zero; the rest of the step starts from there. At rate exactly zero the
    hitch stays stuck until the load exceeds the friction at the start of a step. Each such event
    costs an error of second order in the step.

    Attributes:
        longest_step_s: bound on the step for a stable integration; infinite without a spring and
            damper.
        length_m: k, the length that the forcing's accelerations are divided by.
        needs_twist: whether balls resist, so that the forcing needs the tractor's twist.
    """

    def __init__(
        self, robot: RobotParameters, ground: Ground, longest_s: float, *, published_spring: bool
    ) -> None:
        """Take the constants.

        Args:
            robot: hitch, trailer and balls; or those of every simulation (`config.stacked`).
            ground: its weight on the balls; likewise.
            longest_s: step that will be taken.
            published_spring: divide torques by k as in Eq. 41.
        """
        of = partial(_Constants.of, longest_s=longest_s, published_spring=published_spring)
        constants = each(of, robot, ground)
        self._stiffness, self._damping, self._friction, self._forces, self._fading, _ = constants
        self._robot = robot
        self._sprung = bool(np.any(self._stiffness) or np.any(self._damping))
        self._rubs = bool(np.any(self._friction))
        self.length_m = robot.swing_length_m
        self.needs_twist = bool(np.any(self._forces.right) or np.any(self._forces.left))
        self.longest_step_s = float(np.min(constants.longest_step_s))

    def step(self, state: FloatArray, forcing: Forcing) -> FloatArray:
        """Hitch angle [rad] and rate [rad/s], (2, 1, nsim), after one stretch of time."""
        return self._step(state[:, 0], forcing)[:, None]

    def _step(self, state: FloatArray, forcing: Forcing) -> FloatArray:
        if not self._rubs:
            return self._glide(state, forcing, 0.0)
        state, stop = self._slide_or_stick(state, forcing)
        if np.any(stop < 1.0):
            state, _ = self._slide_or_stick(state, forcing.after(stop))
        return state

    def _slide_or_stick(self, state: FloatArray, forcing: Forcing) -> tuple[FloatArray, FloatArray]:
        """The state at the first stop, and the fraction of the time at which it was.

        The fraction is one where there was no stop; the state is then that of the end.
        """
        angle, rate = state
        load = self._acceleration(state, forcing, 0.0) + forcing.drive
        direction = np.sign(np.where(rate == 0.0, load, rate))
        end_angle, end_rate = self._glide(state, forcing, self._friction * direction)
        stuck = (rate == 0.0) & (np.abs(load) <= self._friction)
        stops = ~stuck & (end_rate * direction < 0.0)
        fraction = np.where(stops, rate / np.where(stops, rate - end_rate, 1.0), 1.0)
        stop_angle = angle + 0.5 * fraction * forcing.duration_s * rate
        end_angle = np.where(stuck, angle, np.where(stops, stop_angle, end_angle))
        return np.stack([end_angle, np.where(stuck | stops, 0.0, end_rate)]), fraction

    def _glide(
        self, state: FloatArray, forcing: Forcing, friction: FloatArray | float
    ) -> FloatArray:
        """The state (2, nsim) after a stretch in which friction (nsim,) [rad/s²] does not turn."""
        drive = forcing.drive - friction

        def rate(share: float, now: FloatArray) -> FloatArray:
            slope = np.empty_like(now)
            slope[0] = now[1]
            np.add(self._acceleration(now, forcing, share), drive, out=slope[1])
            return slope

        return runge_kutta(rate, state, forcing.duration_s)

    def _acceleration(self, state: FloatArray, forcing: Forcing, share: float) -> FloatArray:
        """φ̈ without drive and dry friction, (nsim,) [rad/s²], at a share of the stretch."""
        angle, rate = state
        node = round(2.0 * share)
        ahead = forcing.ahead[min(node, len(forcing.ahead) - 1)]
        free = sideways(angle - self._robot.lean_rad, ahead, forcing.left[node])
        if self._sprung:
            free = free - (self._stiffness * angle + self._damping * rate)
        if forcing.twist is not None:
            u1, u2 = forcing.twist[:, node]
            rest = self._robot, self._forces, self._fading
            free = free + resisting_torque(angle, (u1, 0.0), rate + u2, *rest)
        return free
