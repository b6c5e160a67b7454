"""The next samples, optimised again every period: what `mpc` does always and others in need.

A plan of a fixed number of samples, warm-started with the last one: linearise along it, make one
Gauss-Newton step by the Riccati recursion, roll its policy out from the estimated state, for a few
lengths of the step and with commands limited to what the servos can do, and keep the best. Beyond
the horizon the cost-to-go of the time-varying LQR about the reference counts.

Simulations may come and go from sample to sample: each has a plan of its own, which none of the
others touches.
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.shared.estimation.observer import Observed
from ttwmr_mj.controllers.shared.optimal.gauss_newton import fit, improved, lqr
from ttwmr_mj.controllers.shared.optimal.riccati import apply
from ttwmr_mj.controllers.shared.optimal.tracking_problem import Problem, Target
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import BoolArray, FloatArray, unwrap_near, wrap

# Of the Gauss-Newton step; zero is the last plan. All 40 starts in `transition` are caught; with
# (1, 0) 85 %, with six lengths no more.
STEP_LENGTHS = np.array([1.0, 0.4, 0.1, 0.0])
PREDICTION_SUBSTEP_S = 0.017  # two in 33 ms: three quarters of the time of four, no start lost


class RecedingHorizon:
    """Plans of a batch about one reference."""

    def __init__(self, problem: Problem, samples: int, steps: int = 1) -> None:
        """No plans yet.

        Args:
            problem: model and stage cost.
            samples: the horizon's length.
            steps: of Gauss-Newton in a period.
        """
        self._problem, self._samples, self._steps = problem, samples, steps
        self._who: BoolArray | None = None  # whose plans these are
        self._state: FloatArray = np.empty(0)  # (n + 1, m, states) of them
        self._command: FloatArray = np.empty(0)  # (n, m, 2)

    def plan(
        self, path: ReferencePath, planned: FloatArray, decay: FloatArray, passes: int = 0
    ) -> None:
        """Fit the reference and compute its cost to go.

        Args:
            path: the reference.
            planned: (1 or nsim, width) disturbance that it is made for.
            decay: (lasting,) factors by which disturbances fall in a period.
            passes: of Gauss-Newton, as of `fit`.
        """
        problem, self._planned = self._problem, planned
        state, command = fit(problem, problem.target(path), planned, passes)
        self._target = Target(state, command, problem.centre(state))
        self._lqr = lqr(problem, state, command, decay, planned)

    def cost_to_go(self, k: int, now: Observed) -> FloatArray:
        """(nsim,) ½·δxᵀP_k·δx, what the LQR expects the way to the reference to cost."""
        miss = np.concatenate([now.body, now.wheels], axis=1) - self._target.state[k]
        angles, states = self._problem.angles, self._problem.states
        miss[:, angles] = wrap(miss[:, angles])
        cost: FloatArray = apply(self._lqr.cost[k, :, :states, :states], miss)
        return np.asarray(0.5 * (miss * cost).sum(axis=1))

    def command(self, k: int, now: Observed, disturbance: FloatArray, who: BoolArray) -> FloatArray:
        """(m, 2) first commands of the improved plans of those who are asked for, m of them.

        To be called at each sample, even where nobody is asked for: plans end when their
        simulation is left out.

        Args:
            k: sample since the plan's start; from one call to the next it grows by one, but for
                simulations that begin anew.
            now: of all simulations.
            disturbance: (nsim, width) which lasts.
            who: (nsim,) whose plans continue if they were asked for at the last sample, or begin
                with the reference.
        """
        if not who.any():
            self._who = None
            return np.empty((0, 2))
        end = min(k + self._samples, len(self._target.command))
        disturbance, planned = disturbance[who], _of(self._planned, who)
        target = Target(*(_of(values, who, 1) for values in self._target.between(k, end)))
        state, command = self._continued(k, end, who, disturbance)
        start = self._on_the_branch(target, now, who)
        angles = self._problem.angles
        turns = np.rint((start - state[0])[:, angles] / (2.0 * np.pi))
        state[:, :, angles] += 2.0 * np.pi * turns  # where a trailer has turned over since
        for _ in range(self._steps):
            state, command, _ = improved(
                self._problem,
                state,
                command,
                target,
                _of(self._lqr.cost[end], who),
                start=start,
                disturbance=disturbance,
                planned=planned,
                lengths=STEP_LENGTHS,
                cut=True,
            )
        self._who, self._state, self._command = who.copy(), state, command
        return np.asarray(command[0])

    def _on_the_branch(self, target: Target, now: Observed, who: BoolArray) -> FloatArray:
        """(m, states) states, their angles within half a turn of the reference's."""
        state = np.concatenate([now.body, now.wheels], axis=1)[who]
        angles = self._problem.angles
        state[:, angles] = unwrap_near(state[:, angles], target.state[0][:, angles])
        return state

    def _continued(
        self, k: int, end: int, who: BoolArray, disturbance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """States and commands of the last plans from now on, the LQR law for the last period."""
        reference = self._target.between(k, end)
        each = np.zeros((who.sum(), 1))  # one for every simulation
        state = _of(reference.state, who, 1) + each
        command = _of(reference.command, who, 1) + each
        if self._who is None or not (on := who & self._who).any():
            return state, command
        new, old = on[who], on[self._who]
        last_state, last_command = self._state[1:, old], self._command[1:, old]
        if k + len(last_command) < end:
            after = self._lqr_step(end - 1, last_state[-1], on, disturbance[new])
            last_state, last_command = (
                np.concatenate([values, more[None]])
                for values, more in zip((last_state, last_command), after, strict=True)
            )
        state[:, new], command[:, new] = last_state, last_command
        return state, command

    def _lqr_step(
        self, k: int, state: FloatArray, who: BoolArray, disturbance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """States (m, states) after one period of the LQR law, and its commands (m, 2)."""
        beside = (disturbance - _of(self._planned, who))[:, : self._problem.lasting]
        miss = np.concatenate([state - _of(self._target.state[k], who), beside], axis=1)
        wish = _of(self._target.command[k], who) + apply(_of(self._lqr.gain[k], who), miss)
        wish = self._problem.within_limits(state, wish)
        return self._problem.next_state(state, wish, disturbance), wish


def _of(values: FloatArray, who: BoolArray, axis: int = 0) -> FloatArray:
    """Rows of some simulations along an axis, which is one long where all have the same."""
    return values if values.shape[axis] == 1 else np.compress(who, values, axis=axis)
