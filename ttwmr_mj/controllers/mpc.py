"""Model predictive control: the next second, optimised again every period.

Minimises the stage cost of `tracking_problem` over a horizon on the sampled nonlinear model, from
the observer's state and with its disturbances assumed to last, under the servos' limits and with
the hitch's dry friction, smoothed, in the model. The terminal cost is the cost-to-go of the
time-varying LQR about the reference.

Every period: linearise along the last plan, make one Gauss-Newton step by the Riccati recursion,
roll its policy out from the estimated state, for a few lengths of the step and with commands
limited to what the servos can do, and keep the best. One step per period suffices, as the plan is
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

Time: a command that takes longer than a period comes too late on a real robot. The run counts these
deadline misses (`control_overruns` in metrics.json); the command is used all the same, so that
results do not depend on the machine's load.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.controllers.shared.gauss_newton import Rollout, fit, improved, lqr
from ttwmr_mj.controllers.shared.observer import Observed
from ttwmr_mj.controllers.shared.planning import PlanningLaw
from ttwmr_mj.controllers.shared.riccati import apply
from ttwmr_mj.controllers.shared.tracking_problem import Target, TrackingProblem
from ttwmr_mj.controllers.tvlqr import TvlqrOptions
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, unwrap_near

# Of the Gauss-Newton step; zero is the last plan. All 40 starts in `transition` are caught; with
# (1, 0) 85 %, with six lengths no more.
STEP_LENGTHS = np.array([1.0, 0.4, 0.1, 0.0])
PREDICTION_SUBSTEP_S = 0.017  # two in 33 ms: three quarters of the time of four, no start lost


class Mpc(PlanningLaw["MpcOptions"]):
    """Real-time Gauss-Newton over a receding horizon."""

    def start(self, task: Task) -> None:
        """Fit the reference and compute its cost to go."""
        super().start(task)
        smooth = self._friction.planning(self._period, PREDICTION_SUBSTEP_S)
        weights, learns = self._options.weights, self._learns
        self._problem = TrackingProblem(self._robot, smooth, weights, learns=learns)
        self._horizon: Rollout | None = None
        self._plan(task.path_ahead)

    def _plan(self, path: ReferencePath, passes: int = 0) -> None:
        problem = self._problem
        state, command = fit(problem, problem.target(path), self._planned, passes)
        self._target = Target(state, command, problem.centre(state))
        decay = self._options.decay(self._period, problem.lasting)
        self._lqr = lqr(problem, state, command, decay, self._planned)

    def command(self, k: int, estimate: Estimate) -> Command:
        """The first command of the improved plan."""
        now = self._observer.update(estimate)
        k = self._since_plan(k, now)
        disturbance = self._disturbance(now)
        end = min(k + self._options.horizon_samples, len(self._target.command))
        state, command = self._continued(k, end, disturbance)
        self._horizon = improved(
            self._problem,
            state,
            command,
            self._target.between(k, end),
            self._lqr.cost[end],
            start=self._on_the_branch(k, now),
            disturbance=disturbance,
            planned=self._planned,
            lengths=STEP_LENGTHS,
            cut=True,
        )
        return self._possible(self._horizon.command[0], now)

    def _on_the_branch(self, k: int, now: Observed) -> FloatArray:
        """(nsim, 7) the state, its angles within half a turn of the reference's."""
        state = np.concatenate([now.body, now.wheels], axis=1)
        state[:, 2:4] = unwrap_near(state[:, 2:4], self._target.state[k][:, 2:4])
        return state

    def _continued(
        self, k: int, end: int, disturbance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """States and commands of the last plan from now on, with the LQR law for the last period.

        The first plan of a run continues the reference.
        """
        if self._horizon is None:
            state, command, _ = self._target.between(k, end)
            each = np.zeros((self._nsim, 1))  # one for every simulation
            return state + each, command + each
        state, command = self._horizon.state[1:], self._horizon.command[1:]
        if k + len(command) < end:
            last = end - 1
            beside = (disturbance - self._planned)[:, : self._problem.lasting]
            miss = np.concatenate([state[-1] - self._target.state[last], beside], axis=1)
            wish = self._target.command[last] + apply(self._lqr.gain[last], miss)
            wish = self._problem.within_limits(state[-1], wish)
            after = self._problem.next_state(state[-1], wish, disturbance)
            state = np.concatenate([state, after[None]])
            command = np.concatenate([command, wish[None]])
        return state, command


class MpcOptions(TvlqrOptions):
    """Model predictive control; steers the trailer, even from large errors."""

    law = Mpc
    kind: Literal["mpc"] = "mpc"  # type: ignore[assignment]  # the tag of another law
    horizon_samples: int = Field(
        default=30,
        ge=2,
        le=60,
        description="prediction horizon in control periods; typically one second, 30",
    )
