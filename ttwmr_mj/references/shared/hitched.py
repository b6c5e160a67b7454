"""θ2 with which F keeps its path where the hitch has a spring and a damper.

They add d = −(k_t·φ + c_t·φ̇)/J to θ̈2, φ = θ2 − θ1, and balls that resist what `held_back` says.
F keeps its path if

    (F'' − g_p)·n + k·d = 0,      P' = F' + k·θ̇2·n,      θ1 = direction of P',

a differential equation for θ2, for φ̇ holds θ̈2. It has oscillations of its own, fast where
cos φ < 0, and integrated either way rounding grows. Wanted is the solution without these: least
squares of the equation, in units of |F''|, and of ROUGH_S⁴ times the fourth derivative of what is
added to the free trailer's θ2, at the samples of the reference, by Gauss-Newton steps. What is left
of the equation is of the order ROUGH_S⁸·ω⁸ of the addition, 3e-14 of it at 2 rad/s, and more in the
last samples. The second
derivative in the fourth's place would let an oscillation of 8 rad/s begin with the motion, as large
in θ̈2 as what is wanted.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.sparse import csc_array, dia_array
from scipy.sparse.linalg import spsolve

from ttwmr_mj.dynamics.flatness import dot, trailer_axes
from ttwmr_mj.dynamics.floor.influence import held_back_moving
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, wrap

MOST_STEPS, MOST_HALVINGS, CONVERGED_RAD = 50, 10, 1e-9
ALIKE = 1.0 + 1e-9  # what rounding leaves of a sum of squares that no step makes smaller
MOST_LEFT = 0.01  # of the equation, lest a false minimum be taken; found: up to 4e-5, at the end
ROUGH_S, ROUGHNESS = 0.01, (1.0, -4.0, 6.0, -4.0, 1.0)
LEAST_STEP_S = 5e-3  # second differences over less are rounding, which does not converge
LEAST_SAMPLES = 8  # for a smooth curve through them, of however short a run
BAND, PROBE_RAD = 3, 1e-6  # samples that a residual reaches to either side; of the differences


def has_spring(robot: RobotParameters) -> bool:
    """Whether a spring or a damper acts in the first hitch."""
    return bool(robot.hitch.stiffness_n_m_rad or robot.hitch.damping_n_m_s_rad)


def hitch_push(phi: FloatArray, phi_rate: FloatArray, robot: RobotParameters) -> FloatArray:
    """(...) k·d of spring and damper [m/s²], of hitch angles and their rates (...)."""
    hitch = robot.hitch
    torque = hitch.stiffness_n_m_rad * phi + hitch.damping_n_m_s_rad * phi_rate
    return np.asarray(-robot.swing_length_m / robot.swing_inertia_kg_m2 * torque)


def hitched(
    time_s: FloatArray,
    flat: FloatArray,
    theta2: FloatArray,
    gravity: FloatArray,
    drag: FloatArray,
    robot: RobotParameters,
) -> FloatArray | None:
    """What hitch and balls add, k·d·n (n, batch, 2) [m/s²]; None: F cannot keep its path so.

    Args:
        time_s: (n,) evenly spaced.
        flat: (n, batch, 3 or more, 2) F and its derivatives.
        theta2: (n, batch, 3 or more) of a trailer with a free hitch, and its derivatives.
        gravity: (batch, 2) g_p.
        drag: (batch,) of the balls.
        robot: with one trailer.
    """
    step_s = float(time_s[1] - time_s[0])
    stride = min(math.ceil(LEAST_STEP_S / step_s - 1e-9), len(time_s) // LEAST_SAMPLES)
    coarse = slice(None, None, max(1, stride))
    some, problem = time_s[coarse], _Problem(time_s, flat, theta2, gravity, drag, robot)
    added = _added(_Problem(some, flat[coarse], theta2[coarse], gravity, drag, robot))
    if added is None:
        return None
    if len(some) == len(time_s):
        return problem.push(added, *_differences(added, step_s))
    smooth = make_interp_spline(some, added, 5)  # with a smooth second derivative
    return problem.push(*(smooth.derivative(order)(time_s) for order in range(3)))


def _added(problem: _Problem) -> FloatArray | None:
    """(n, batch) what hitch and balls add to θ2; None: F cannot keep its path so."""
    added = np.zeros(problem.shape)
    with np.errstate(all="ignore"):  # what diverges is given up below
        for _ in range(MOST_STEPS):
            step = problem.step(added)
            if not np.isfinite(step).all():
                return None
            step *= problem.length(added, step)
            added = added + step
            if np.abs(step).max() < CONVERGED_RAD:
                solved = np.abs(problem.residual(added)).max() < MOST_LEFT
                return added if solved else None
    return None


class _Problem:
    """The equation along a reference."""

    def __init__(
        self,
        time_s: FloatArray,
        flat: FloatArray,
        theta2: FloatArray,
        gravity: FloatArray,
        drag: FloatArray,
        robot: RobotParameters,
    ) -> None:
        self._step = step_s = float(time_s[1] - time_s[0])
        self._robot, self._theta2, self._drag = robot, theta2, drag
        self.shape = theta2.shape[:2]
        self._velocity, self._acceleration = flat[:, :, 1], flat[:, :, 2]
        self._pulled = flat[:, :, 2] - gravity
        self._size = np.hypot(self._acceleration[..., 0], self._acceleration[..., 1])
        n, weights = len(flat), np.array(ROUGHNESS)
        diagonals = np.tile(weights[:, None], n)
        offsets = range(len(weights))
        order = len(weights) - 1
        self._rough = csc_array(dia_array((diagonals, [*offsets]), shape=(n - order, n)))
        self._rough *= (ROUGH_S / step_s) ** order

    def residual(self, added: FloatArray) -> FloatArray:
        """(n, batch) (F'' − g_p)·n + k·d, in units of |F''|."""
        push, across = self._push(added, *_differences(added, self._step))
        return np.asarray((dot(self._pulled, across) + push) / self._size)

    def push(self, added: FloatArray, rate: FloatArray, turn: FloatArray) -> FloatArray:
        """(n, batch, 2) k·d·n, of what is added to θ2 and its two derivatives."""
        push, across = self._push(added, rate, turn)
        return np.asarray(push[..., None] * across)

    def step(self, added: FloatArray) -> FloatArray:
        """(n, batch) what to add next."""
        base, slopes = self.residual(added), self._slopes(added)
        steps = np.full_like(added, np.nan)
        for i in range(added.shape[1]):
            if not (np.isfinite(base[:, i]).all() and np.isfinite(slopes[i]).all()):
                continue
            n, offsets = len(added), range(BAND, -BAND - 1, -1)
            by_added = csc_array(dia_array((slopes[i], [*offsets]), shape=(n, n)))
            matrix = by_added.T @ by_added + self._rough.T @ self._rough
            slope = by_added.T @ base[:, i] + self._rough.T @ (self._rough @ added[:, i])
            steps[:, i] = spsolve(csc_array(matrix), -slope)
        return steps

    def length(self, added: FloatArray, step: FloatArray) -> FloatArray:
        """(batch,) share of a step with which the squares do not grow; halved until it is found."""
        share, before = np.ones(added.shape[1]), self._squares(added)
        for _ in range(MOST_HALVINGS):
            grows = ~(self._squares(added + share * step) <= ALIKE * before)
            if not grows.any():
                break
            share[grows] *= 0.5
        return share

    def _squares(self, added: FloatArray) -> FloatArray:
        """(batch,) what is minimised."""
        left, rough = self.residual(added), self._rough @ added
        return np.asarray((left**2).sum(axis=0) + (rough**2).sum(axis=0))

    def _slopes(self, added: FloatArray) -> FloatArray:
        """(batch, 5, n) derivatives of the residual, as diagonals; a few columns at once."""
        n, batch = added.shape
        bands = np.zeros((batch, 2 * BAND + 1, n))
        for colour in range(2 * BAND + 1):
            columns = np.arange(colour, n, 2 * BAND + 1)
            probe = np.zeros_like(added)
            probe[columns] = PROBE_RAD
            # to both sides: a mirrored reference has mirrored slopes, to the last bit
            difference = self.residual(added + probe) - self.residual(added - probe)
            slope = difference / (2.0 * PROBE_RAD)
            for offset in range(-BAND, BAND + 1):
                rows = columns + offset
                there = (rows >= 0) & (rows < n)
                bands[:, BAND + offset, columns[there]] = slope[rows[there]].T
        return bands

    def _push(
        self, added: FloatArray, rate: FloatArray, turn: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """k·d (n, batch), and n."""
        robot, k = self._robot, self._robot.swing_length_m
        theta2, rate, turn = (
            self._theta2[..., 0] + added,
            self._theta2[..., 1] + rate,
            self._theta2[..., 2] + turn,
        )
        along, across = trailer_axes(theta2 - robot.lean_rad)
        velocity = self._velocity + (k * rate)[..., None] * across
        bend = self._acceleration + k * (turn[..., None] * across - (rate**2)[..., None] * along)
        theta1 = np.arctan2(velocity[..., 1], velocity[..., 0])
        theta1_rate = _cross(velocity, bend) / dot(velocity, velocity)
        push = hitch_push(wrap(theta2 - theta1), rate - theta1_rate, robot)
        if self._drag.any():
            push += held_back_moving(self._drag, velocity, theta2, rate, robot)
        return push, across


def _differences(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """First and second derivative (n, batch), of second order."""
    second = np.empty_like(values)
    second[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / step**2
    second[0], second[-1] = 2.0 * second[1] - second[2], 2.0 * second[-2] - second[-3]
    return np.gradient(values, step, axis=0, edge_order=2), second


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """(...) z component of a × b for plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
