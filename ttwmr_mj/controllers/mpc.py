"""Model predictive control: the coming second, optimised anew every period.

Minimises the stage cost of `tracking_problem` over a horizon on the sampled nonlinear model, from
the observer's state and with its disturbances taken to last, under the servos' limits and with the
hitch's dry friction, smoothed, in the model. The cost beyond the horizon is the cost to go of the
time-varying LQR about the reference.

Every period: linearise along the last plan, make one Gauss-Newton step by the Riccati recursion,
roll its policy out from where the robot really is, for a few lengths of the step and with commands
cut to the servos' limits, and keep the best. One step a period suffices, as the plan is
warm-started and the error of one period is small.

Stability: locally, in the classical way. The final cost is a Lyapunov function of the linearised
loop under the LQR law, which is feasible near the reference; so the last plan continued by that law
costs less than the last plan by one stage cost, and the step kept costs no more than it, to first
order in what one period's surprise was (length zero is among the candidates): the cost to go
decreases along the loop. It assumes what the time-varying LQR assumes near the reference (P moves,
the reference is feasible with room to spare), and a hitch that slides or friction that is smooth on
the scale of one step: a hitch that sticks ends where friction lets go of the error. Far from the
reference there is no proof, but the nonlinear model and the limits are in the plan, which is what a
linear law lacks.

Time: a command that takes longer than a period comes too late on a real robot. The run counts such
overruns (`control_overruns` in metrics.json); the command is used all the same, so that results do
not depend on the machine's load.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.controllers.shared.friction import HitchFriction
from ttwmr_mj.controllers.shared.limits import possible_command
from ttwmr_mj.controllers.shared.observer import Observer, Seen
from ttwmr_mj.controllers.shared.riccati import backward
from ttwmr_mj.controllers.shared.tracking_problem import STATES, Target, TrackingProblem
from ttwmr_mj.controllers.tvlqr import TvlqrOptions, apply, fit, with_disturbances
from ttwmr_mj.dynamics.sampled import BODY, SampledModel
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, wrap

STEP_LENGTHS = np.array([1.0, 0.4, 0.1, 0.0])  # of the Gauss-Newton step; zero is the last plan
PREDICTION_SUBSTEP_S = 0.017  # coarser than the observer's: only differences matter


class MpcOptions(TvlqrOptions):
    """Model predictive control; steers the trailer, recovers from far."""

    kind: Literal["mpc"] = "mpc"  # type: ignore[assignment]  # the tag of another law
    horizon_samples: int = Field(default=30, ge=2, le=60, description="control periods ahead")

    def make(self, folder: Path) -> Controller:
        """The law."""
        del folder
        return Mpc(self)


class _Plan(NamedTuple):
    """States (h + 1, nsim, 7), commands (h, nsim, 2) and gains (h, nsim, 2, 7) about them."""

    state: FloatArray
    command: FloatArray
    gain: FloatArray


class Mpc(Controller):
    """Real-time Gauss-Newton over a receding horizon."""

    def __init__(self, options: MpcOptions) -> None:
        self._options = options

    def start(self, task: Task) -> None:
        """Fit the reference and compute its cost to go."""
        period = task.sampling_time_s
        friction = HitchFriction(task.robot, self._options.friction)
        self._model = SampledModel(friction.believed, period)
        self._observer = Observer(task.robot, self._model, self._options.observer)
        smooth = friction.planning(period, PREDICTION_SUBSTEP_S)
        self._problem = TrackingProblem(task.robot, smooth, self._options.weights)
        state, command = fit(self._problem, self._problem.target(task.path))
        self._target = Target(state, command, self._problem.centre(state))
        decay = np.exp(-period / self._options.disturbance_time_s)
        linear = self._problem.linearise(state[:-1], command)
        self._lqr = with_disturbances(self._problem, linear, state, decay)
        self._horizon = min(self._options.horizon_samples, len(command))
        self._nsim, self._period, self._robot = task.nsim, period, task.robot
        self._plan: _Plan | None = None

    def command(self, k: int, estimate: Estimate) -> Command:
        """The first command of the improved plan."""
        seen = self._observer.update(estimate)
        disturbance = np.column_stack([seen.slip, seen.swing])
        plan = self._improved(k, self._now(seen, k), disturbance)
        command = possible_command(plan.command[0], seen.wheels, self._model, self._robot)
        self._plan = plan
        self._observer.commanded(command.wheel_speed_rad_s)
        return command

    def _now(self, seen: Seen, k: int) -> FloatArray:
        """(nsim, 7) the state, its angles on the reference's branch."""
        state = np.concatenate([seen.body, seen.wheels], axis=1)
        aim = self._target.state[k][:, 2:4]
        state[:, 2:4] = aim + wrap(state[:, 2:4] - aim)
        return state

    def _improved(self, k: int, now: FloatArray, disturbance: FloatArray) -> _Plan:
        """Last period's plan, one Gauss-Newton step better, for the horizon from sample k on."""
        steps = min(self._horizon, len(self._target.command) - k)
        window = slice(k, k + steps)
        state, command = self._continued(k, steps, disturbance)
        linear = self._problem.linearise(
            state[:-1], command, np.broadcast_to(disturbance, (steps, *disturbance.shape))
        )
        residual = self._problem.residual(state[:-1], command, self._target, window)
        hessian = np.broadcast_to(
            self._lqr.cost[k + steps][:, :STATES], (self._nsim, STATES, STATES + 4)
        )
        beyond = np.concatenate([state[-1] - self._target.state[k + steps], disturbance], axis=1)
        policy = backward(
            linear.A,
            linear.B,
            self._problem.residual_by_state(state[:-1]),
            self._problem.residual_by_command(),
            residual,
            hessian[:, :, :STATES],
            apply(hessian, beyond),
        )
        about = _Plan(state, command, policy.gain)
        states, commands, costs = self._roll_out(
            k, now, about, policy.feedforward, STEP_LENGTHS, disturbance
        )
        best, each = np.argmin(costs, axis=0), np.arange(self._nsim)
        return _Plan(states[:, best, each], commands[:, best, each], policy.gain)

    def _continued(
        self, k: int, steps: int, disturbance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """States and commands of the last plan from now on, with the LQR law for the last period.

        The first plan of a run continues the reference.
        """
        if self._plan is None:
            aim = self._target.state[k : k + steps + 1]
            return self._batched(aim), self._batched(self._target.command[k : k + steps])
        state, command = self._plan.state[1:], self._plan.command[1:]
        if len(command) < steps:
            end = k + steps - 1
            miss = np.concatenate([state[-1] - self._target.state[end], disturbance], axis=1)
            wish = self._target.command[end] + apply(self._lqr.gain[end], miss)
            wish = self._model.within_limits(state[-1][:, BODY:], wish)
            after = self._problem.next_state(state[-1], wish, disturbance)
            state = np.concatenate([state, after[None]])
            command = np.concatenate([command, wish[None]])
        return state, command

    def _batched(self, values: FloatArray) -> FloatArray:
        """(n, nsim, m) of values (n, batch, m)."""
        return np.broadcast_to(values, (values.shape[0], self._nsim, values.shape[2]))

    def _roll_out(
        self,
        k: int,
        now: FloatArray,
        about: _Plan,
        feedforward: FloatArray,
        lengths: FloatArray,
        disturbance: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Follow a policy about a plan, cut to the limits, with several lengths of feedforward.

        Returns:
            states (h + 1, lengths, nsim, 7), commands (h, lengths, nsim, 2) and costs
            (lengths, nsim).
        """
        steps = len(about.command)
        count = (lengths.size, self._nsim)
        state = np.broadcast_to(now, (*count, STATES))
        states, commands = np.empty((steps + 1, *count, STATES)), np.empty((steps, *count, 2))
        pushes = lengths[:, None, None] * feedforward[:, None]
        constant = np.broadcast_to(disturbance, (*count, disturbance.shape[1]))
        states[0], cost = state, np.zeros(count)
        for j in range(steps):
            wish = about.command[j] + pushes[j] + apply(about.gain[j], state - about.state[j])
            commands[j] = self._model.within_limits(state[..., BODY:], wish)
            state = states[j + 1] = self._problem.next_state(state, commands[j], constant)
        window = slice(k, k + steps)
        aims = Target(*(values[:, None] for values in self._target))
        residual = self._problem.residual(states[:-1], commands, aims, window)
        cost = 0.5 * (residual**2).sum(axis=(0, -1))
        hessian = self._lqr.cost[k + steps]
        beyond = np.concatenate([state - self._target.state[k + steps], constant], axis=-1)
        return states, commands, cost + 0.5 * (beyond * apply(hessian, beyond)).sum(axis=-1)
