"""Integration of the hitch angle φ = θ2 − θ1 of a trailer behind a tractor that moves as told.

    φ̈ = (u1·u2·cos φ − u̇1·sin φ)/k − u̇2 + T/(J2 + m2·l²)          (Eq. 17, 24, 27-28)

Classical fourth-order Runge-Kutta over stretches of time in which the tractor's accelerations are
constant, and dry friction that truly sticks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.hitch import published_spring_acceleration, spring_damper_acceleration
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
    along: FloatArray  # (nsim,) −u̇1/k [1/s²]
    across: FloatArray  # (3, nsim) u1·u2/k at start, middle and end [1/s²]
    drive: FloatArray  # (nsim,) −u̇2, later also friction [rad/s²]

    def after(self, fraction: FloatArray) -> Forcing:
        """The rest of the stretch from a fraction (nsim,) of its duration on."""
        start, middle, end = self.across  # u1 and u2 are linear in time: a parabola
        slope, bend = 4.0 * middle - 3.0 * start - end, 2.0 * (start - 2.0 * middle + end)
        times = np.stack([fraction, 0.5 * (1.0 + fraction), np.ones_like(fraction)])
        across = start + times * (slope + times * bend)
        return self._replace(duration_s=(1.0 - fraction) * self.duration_s, across=across)


class HitchSwing:
    """The hitch's equation of motion with its spring, damper and dry friction.

    Friction keeps its direction while the hitch slides and stops it where the rate, taken as
    linear in time, passes zero; the rest of the step starts from there. At rate exactly zero the
    hitch stays stuck until the load exceeds the friction at the start of a step. Each such event
    costs an error of second order in the step.

    Attributes:
        longest_step_s: bound on the step for a stable integration; infinite without a spring and
            damper.
    """

    def __init__(self, robot: RobotParameters, *, published_spring: bool) -> None:
        """Take the hitch's constants; published_spring divides torques by k as in Eq. 41."""
        law = published_spring_acceleration if published_spring else spring_damper_acceleration
        one, zero = np.ones(()), np.zeros(())
        self._stiffness = -float(law(one, zero, robot))  # [1/s²]
        self._damping = -float(law(zero, one, robot))  # [1/s]
        self._friction = robot.hitch.coulomb_friction_n_m / robot.swing_inertia_kg_m2  # [rad/s²]
        linear = np.array([[0.0, 1.0], [-self._stiffness, -self._damping]])
        fastest = float(np.abs(np.linalg.eigvals(linear)).max())
        self.longest_step_s = RK4_STABLE_RADIUS / fastest if fastest else np.inf

    def step(
        self, angle: FloatArray, rate: FloatArray, forcing: Forcing
    ) -> tuple[FloatArray, FloatArray]:
        """Hitch angle [rad] and rate [rad/s], (nsim,) each, after one stretch of time."""
        if not self._friction:
            return self._runge_kutta(angle, rate, forcing)
        angle, rate, stop = self._slide_or_stick(angle, rate, forcing)
        if np.any(stop < 1.0):
            angle, rate, _ = self._slide_or_stick(angle, rate, forcing.after(stop))
        return angle, rate

    def _slide_or_stick(
        self, angle: FloatArray, rate: FloatArray, forcing: Forcing
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angle and rate at the first stop, and the fraction of the time at which it was.

        The fraction is one where there was no stop; angle and rate are then those of the end.
        """
        load = self._acceleration(angle, rate, forcing.along, forcing.across[0]) + forcing.drive
        direction = np.sign(np.where(rate == 0.0, load, rate))
        against = forcing._replace(drive=forcing.drive - self._friction * direction)
        end_angle, end_rate = self._runge_kutta(angle, rate, against)
        stuck = (rate == 0.0) & (np.abs(load) <= self._friction)
        stops = ~stuck & (end_rate * direction < 0.0)
        fraction = np.where(stops, rate / np.where(stops, rate - end_rate, 1.0), 1.0)
        stop_angle = angle + 0.5 * fraction * forcing.duration_s * rate
        end_angle = np.where(stuck, angle, np.where(stops, stop_angle, end_angle))
        return end_angle, np.where(stuck | stops, 0.0, end_rate), fraction

    def _runge_kutta(
        self, angle: FloatArray, rate: FloatArray, forcing: Forcing
    ) -> tuple[FloatArray, FloatArray]:
        dt, along, (start, middle, end), drive = forcing
        half = 0.5 * dt
        k1 = self._acceleration(angle, rate, along, start) + drive
        glide = angle + half * rate
        k2 = self._acceleration(glide, rate + half * k1, along, middle) + drive
        k3 = self._acceleration(glide + half * half * k1, rate + half * k2, along, middle) + drive
        glide = angle + dt * rate
        k4 = self._acceleration(glide + dt * half * k2, rate + dt * k3, along, end) + drive
        return (
            glide + dt * dt / 6.0 * (k1 + k2 + k3),
            rate + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4),
        )

    def _acceleration(
        self, angle: FloatArray, rate: FloatArray, along: FloatArray, across: FloatArray
    ) -> FloatArray:
        """φ̈ without drive and dry friction, (nsim,) [rad/s²]."""
        free = along * np.sin(angle) + across * np.cos(angle)
        if self._stiffness or self._damping:
            free = free - (self._stiffness * angle + self._damping * rate)
        return np.asarray(free)
