"""Time-varying linear-quadratic control along any reference that a free trailer can follow.

Before the run the reference is made exact for the sampled robot: Gauss-Newton steps (the same
Riccati recursion with its affine terms, and a line search) find the commands, held over a period,
whose trajectory on the sampled hybrid model, its hitch friction smoothed, stays closest to it. The
model without dry friction is linearised about that trajectory and the recursion run backwards, from
beyond the end, which gives the gains u_k = ū_k + K_k·(x_k − x̄_k). Why without: `friction`.

What the observer found of creep and of an unexplained θ̈2 enters as four more states that decay
slowly and that no input moves: the recursion then finds the command that makes up for them, and no
integral of the error is needed.

Stability: along the trajectory the closed loop of the linearised model is exponentially stable if
the pair (A_k, B_k) is uniformly controllable, with V = δxᵀP_k·δx as Lyapunov function (V decreases
by the stage cost, in which δx is observable through F and θ). It is controllable while P moves and
turns; at standstill it is not (a robot that stands cannot correct its position sideways), so a
reference that ends at rest ends with the errors it has there. For the nonlinear robot it holds
locally, while no servo saturates and the model is right between samples. Dry friction that the
robot's parameters name is cancelled while the hitch slides; stuck, it is a bounded disturbance.
What lies outside is not caught: the gains go on pulling at the reference (`mpc` looks for a way).
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, Controller, ControllerOptions, Task, undefined_theta2
from ttwmr_mj.controllers.shared.friction import FrictionOptions, HitchFriction
from ttwmr_mj.controllers.shared.limits import possible_command
from ttwmr_mj.controllers.shared.observer import Observer, ObserverOptions, Seen
from ttwmr_mj.controllers.shared.riccati import Policy, backward
from ttwmr_mj.controllers.shared.tracking_problem import (
    DISTURBANCES,
    INPUTS,
    RESIDUALS,
    STATES,
    Linear,
    Target,
    TrackingProblem,
    TrackingWeights,
)
from ttwmr_mj.dynamics.sampled import SampledModel
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, wrap

FITTING_PASSES = 30
FITTED = 1e-3  # a pass that lowers the cost by a smaller share is the last
STEP_LENGTHS = np.array([1.0, 0.5, 0.2, 0.05, 0.0])  # of a Gauss-Newton step


class TvlqrOptions(ControllerOptions):
    """Time-varying LQR along any feasible reference; steers the trailer."""

    kind: Literal["tvlqr"] = "tvlqr"
    weights: TrackingWeights = TrackingWeights()
    disturbance_time_s: float = Field(
        default=10.0, gt=0, le=1e4, description="how long a disturbance is taken to last"
    )
    friction: FrictionOptions = FrictionOptions()
    observer: ObserverOptions = ObserverOptions()

    def make(self, folder: Path) -> Controller:
        """The law."""
        del folder
        return Tvlqr(self)

    def path_faults(self, reference: Reference, path: ReferencePath) -> list[Fault]:
        """Steering the trailer needs θ2 everywhere."""
        undefined = ~np.isfinite(path.theta).all(axis=(1, 2))
        if not undefined.any():
            return []
        return [
            undefined_theta2(
                reference,
                f"at {path.time_s[undefined][0]:g} s; controller.kind = {self.kind!r} steers the "
                "trailer and needs θ2 everywhere",
                "a circle with theta2 = 'outward', 'flat_circle' and 'planned' have it",
            )
        ]


class Tvlqr(Controller):
    """Precomputed gains on the observer's state."""

    def __init__(self, options: TvlqrOptions) -> None:
        self._options = options

    def start(self, task: Task) -> None:
        """Fit the reference and compute the gains."""
        self._friction = friction = HitchFriction(task.robot, self._options.friction)
        self._model = SampledModel(friction.believed, task.sampling_time_s)
        self._observer = Observer(task.robot, self._model, self._options.observer)
        smooth = friction.planning(task.sampling_time_s)
        problem = TrackingProblem(task.robot, smooth, self._options.weights)
        decay = np.exp(-task.sampling_time_s / self._options.disturbance_time_s)
        target = problem.target(task.path)
        self._state, self._command = fit(problem, target)
        free = TrackingProblem(
            task.robot, friction.free(task.sampling_time_s), self._options.weights
        )
        linear = free.linearise(self._state[:-1], self._command)
        self._gain = with_disturbances(free, linear, self._state, decay).gain
        self._swing = friction.swing_along(self._state)
        self._robot = task.robot

    def command(self, k: int, estimate: Estimate) -> Command:
        """ū + K·(x − x̄), within the servos' limits."""
        seen = self._observer.update(estimate)
        swing = seen.swing + self._friction.swing(seen) - self._swing[k]
        miss = error(seen, self._state[k], swing)
        wish = self._command[k] + apply(self._gain[k], miss)
        command = possible_command(wish, seen.wheels, self._model, self._robot)
        self._observer.commanded(command.wheel_speed_rad_s)
        return command


def error(seen: Seen, aim: FloatArray, swing: FloatArray) -> FloatArray:
    """(nsim, 11) state minus the aim (batch, 7), angles on the circle, then the disturbances."""
    miss = np.concatenate([seen.body, seen.wheels], axis=1) - aim
    miss[:, 2:4] = wrap(miss[:, 2:4])
    return np.concatenate([miss, seen.slip, swing[:, None]], axis=1)


def apply(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """(batch, m) product of matrices (batch, m, n) with vectors (batch, n)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


def fit(problem: TrackingProblem, target: Target) -> tuple[FloatArray, FloatArray]:
    """States (n, batch, 7) and commands (n − 1, batch, 2) of the sampled model near the target.

    Gauss-Newton with a line search, until the cost falls by less than a share of FITTED, but no
    more than FITTING_PASSES times.
    """
    state, command = target.state, target.command
    samples = slice(0, len(command))
    by_input = problem.residual_by_command()
    cost = np.full(state.shape[1], np.inf)
    for _ in range(FITTING_PASSES):
        linear = problem.linearise(state[:-1], command)
        residual = problem.residual(state[:-1], command, target, samples)
        by_state = problem.residual_by_state(state[:-1])
        final = np.zeros_like(linear.A[0])
        policy = backward(linear.A, linear.B, by_state, by_input, residual, final)
        states, commands = _rollouts(problem, policy, state, command)
        aims = Target(*(values[:, None] for values in target))
        costs = (problem.residual(states[:-1], commands, aims, samples) ** 2).sum(axis=(0, -1))
        best, each = np.argmin(costs, axis=0), np.arange(state.shape[1])
        last, cost = cost, costs[best, each]
        state, command = states[:, best, each], commands[:, best, each]
        if not (cost < (1.0 - FITTED) * last).any():
            break
    return state, command


def _rollouts(
    problem: TrackingProblem, policy: Policy, state: FloatArray, command: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The sampled model under a policy about (state, command), from the same start.

    Returns:
        states (n, lengths, batch, 7) and commands (n − 1, lengths, batch, 2), one for every length
        of the policy's feedforward.
    """
    count = (STEP_LENGTHS.size, state.shape[1])
    now = np.broadcast_to(state[0], (*count, STATES))
    states, commands = np.empty((len(state), *count, STATES)), np.empty((len(command), *count, 2))
    states[0] = now
    for k in range(len(command)):
        push = STEP_LENGTHS[:, None, None] * policy.feedforward[k]
        commands[k] = command[k] + push + apply(policy.gain[k], now - state[k])
        now = states[k + 1] = problem.next_state(now, commands[k])
    return states, commands


def with_disturbances(
    problem: TrackingProblem, linear: Linear, state: FloatArray, decay: float
) -> Policy:
    """Gains (n, batch, 2, 11) on the state and on disturbances that decay by a factor a period."""
    n, batch = linear.A.shape[:2]
    size = STATES + DISTURBANCES
    A, B = np.zeros((n, batch, size, size)), np.zeros((n, batch, size, INPUTS))
    A[..., :STATES, :STATES], A[..., :STATES, STATES:] = linear.A, linear.D
    A[..., STATES:, STATES:] = decay * np.eye(DISTURBANCES)
    B[..., :STATES, :] = linear.B
    by_state = np.zeros((n, batch, RESIDUALS, size))
    by_state[..., :STATES] = problem.residual_by_state(state[:-1])
    final = np.zeros((batch, size, size))
    return backward(A, B, by_state, problem.residual_by_command(), None, final)
