"""Integration of the hitch angles φ of several trailers behind a tractor whose motion is given.

φ_i = θ_i+1 − θ_i, so θ_j+1 = θ1 + Σ_i≤j φ_i: with C the matrix of that sum, the equations of
`dynamics.train` become, in hitch angles,

    CᵀAC·φ̈ = Cᵀ·(load − A·1·u̇2) + T,

T the hitches' torques, each on its own row. Steps and forcing are those of `plants.swing`.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ttwmr_mj.dynamics.floor.balls import FADING_M_S, all_held_back, slowing, train_drag
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.train import hitch_torques, pivot_torque, solve, swing_bias, swing_matrix
from ttwmr_mj.plants.swing import RK4_STABLE_RADIUS, Forcing
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray

# Projected Gauss-Seidel on who sticks: the error falls to a half in a sweep for two hitches of
# Table I's trailer, to nine tenths for five.
SWEEPS = 60


class TrainSwing:
    """The hitches' equations of motion with springs, dampers and dry friction.

    Friction keeps its direction while a hitch slides and stops it where its rate, taken as linear
    in time, passes zero; the rest of the step starts from there. Hitches at rest stay stuck, each
    as long as the friction that holds all of them at once stays within its limit at the start of a
    step; a stuck hitch does not turn. Each such event costs an error of second order in the step.

    Attributes:
        longest_step_s: bound on the step for a stable integration; infinite without springs and
            dampers.
        length_m: one: the forcing's accelerations are what they are.
        needs_twist: that the forcing needs the tractor's twist.
    """

    length_m, needs_twist = 1.0, True

    def __init__(self, robot: RobotParameters, ground: Ground, longest_s: float) -> None:
        """Take the constants; arguments as of `HitchSwing`."""
        self._robot = robot
        self._friction = np.array([hitch.coulomb_friction_n_m for hitch in robot.hitches])
        self._sum = _sums(robot)
        self._forces = all_held_back(robot, ground.normal_gravity_m_s2)
        self._resisted = any(right or left for _, right, left in self._forces)
        self._sprung = any(h.stiffness_n_m_rad or h.damping_n_m_s_rad for h in robot.hitches)
        # as soft as the step needs it, lest a ball that is nearly at rest chatter
        fastest = max(
            slowing(forces, trailer.com_offset_m, trailer.swing_inertia_kg_m2)
            for forces, trailer in zip(self._forces, robot.trailers, strict=True)
        )
        self._fading = max(FADING_M_S, float(fastest) * longest_s)
        self.longest_step_s = longest_step_s(robot)

    def step(self, state: FloatArray, forcing: Forcing) -> FloatArray:
        """Hitch angles [rad] and rates [rad/s], (2, n, nsim), after one stretch of time."""
        nobody = np.zeros(state.shape[1:], dtype=np.bool_)
        if not self._friction.any():
            return self._glide(state, forcing, np.zeros_like(state[0]), nobody)
        for _ in range(len(self._friction)):
            torque, stuck = self._held(state, forcing)
            end = self._glide(state, forcing, torque, stuck)
            # friction is against the motion: who goes along with it has turned round
            stops = ~stuck & (self._friction[:, None] > 0.0) & (end[1] * torque > 0.0)
            if not stops.any():
                return end
            rate, lost = state[1], state[1] - end[1]
            fraction = np.where(stops, rate / np.where(stops, lost, 1.0), 1.0)
            first = fraction.min(axis=0)
            state = self._glide(state, forcing.until(first), torque, stuck)
            state[1, stops & (fraction <= first)] = 0.0
            forcing = forcing.after(first)
        return self._glide(state, forcing, *self._held(state, forcing))

    def _held(self, state: FloatArray, forcing: Forcing) -> tuple[FloatArray, BoolArray]:
        """Dry friction's torque (n, nsim) on each hitch, and who is held by it."""
        rate, limit = state[1], self._friction[:, None]
        torque = -limit * np.sign(rate)
        resting = (rate == 0.0) & (limit > 0.0)
        if not resting.any():
            return torque, resting
        matrix, load = self._equations(state, forcing, 0)
        yielding = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
        free = np.einsum("sij,sj->is", yielding, load)
        for _ in range(SWEEPS):
            for i in range(len(torque)):
                swing = free[i] + _dot(yielding[:, i].T, torque)
                better = np.clip(torque[i] - swing / yielding[:, i, i], -limit[i], limit[i])
                torque[i] = np.where(resting[i], better, torque[i])
        return torque, resting & (np.abs(torque) < limit)

    def _glide(
        self, state: FloatArray, forcing: Forcing, torque: FloatArray, stuck: BoolArray
    ) -> FloatArray:
        """The state after a stretch in which friction (n, nsim) does not turn; who sticks rests."""
        held = stuck.T
        apart = held[:, :, None] | held[:, None, :]
        one = np.eye(len(torque))

        def rate(share: float, now: FloatArray) -> FloatArray:
            matrix, load = self._equations(now, forcing, round(2.0 * share))
            matrix = np.where(apart, one, matrix)
            load = np.where(held, 0.0, load + torque.T)
            return np.stack([now[1], solve(matrix, load).T])

        return runge_kutta(rate, state, forcing.duration_s)

    def _equations(
        self, state: FloatArray, forcing: Forcing, node: int
    ) -> tuple[FloatArray, FloatArray]:
        """CᵀAC (nsim, n, n) and what it is driven by (nsim, n), dry friction apart."""
        assert forcing.twist is not None, "`needs_twist` says so"
        u1, u2 = forcing.twist[:, node]
        theta = np.add.accumulate(state[0]).T  # on the tractor
        rate = (u2 + np.add.accumulate(state[1])).T
        ahead = forcing.ahead[min(node, len(forcing.ahead) - 1)]
        v = np.stack([ahead, forcing.left[node]], axis=-1)
        A = swing_matrix(theta, self._robot)
        load = pivot_torque(theta, v, self._robot) - swing_bias(theta, rate, self._robot)
        load = load + forcing.drive[:, None] * np.add.accumulate(A, axis=-1)[..., -1]
        if self._resisted:
            load = load + train_drag(theta, rate, u1, self._robot, self._forces, self._fading)[1]
        load = np.add.accumulate(load[:, ::-1], axis=-1)[:, ::-1]  # Cᵀ
        if self._sprung:
            load = load + hitch_torques(state[0].T, state[1].T, self._robot)
        return self._sum.T @ A @ self._sum, load


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(nsim,) of (n, nsim), added in the same order whatever the batch."""
    return np.asarray(np.add.accumulate(a * b)[-1])


def _sums(robot: RobotParameters) -> FloatArray:
    """C."""
    return np.tril(np.ones((len(robot.trailers),) * 2))


def longest_step_s(robot: RobotParameters) -> float:
    """Stable for springs and dampers however the trailers are turned; infinite without them."""
    sums = _sums(robot)
    stiffness, damping = (
        np.diag([getattr(hitch, name) for hitch in robot.hitches])
        for name in ("stiffness_n_m_rad", "damping_n_m_s_rad")
    )
    n, longest = len(sums), np.inf
    for turned in product((0.0, 0.5 * np.pi, np.pi), repeat=n - 1):
        inverse = np.linalg.inv(sums.T @ swing_matrix(np.array([0.0, *turned]), robot) @ sums)
        zero = np.zeros((n, n))
        linear = np.block([[zero, np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
        fastest = float(np.abs(np.linalg.eigvals(linear)).max())
        longest = min(longest, RK4_STABLE_RADIUS / fastest) if fastest > 0.0 else longest
    return float(longest)
