"""Model predictive control: the next second, optimised again every period.

Minimises the stage cost of `tracking_problem` over a horizon on the sampled nonlinear model, from
the observer's state and with its disturbances assumed to last, under the servos' limits and with
the hitch's dry friction, smoothed, in the model. The terminal cost is the cost-to-go of the
time-varying LQR about the reference.

A train of several trailers is steered in the same way (`train_tracking`).

Every period makes one Gauss-Newton step from the last plan (`receding_horizon`). One suffices, as
the plan is warm-started and the error of one period is small.

Stability: locally, in the classical way. The final cost is a Lyapunov function of the linearised
loop under the LQR law, which is feasible near the reference; so the last plan continued by that law
costs less than the last plan by one stage cost, and the step kept costs no more than it, to first
order in what one period's surprise was (length zero is among the candidates): the cost to go
decreases along the loop. It assumes what the time-varying LQR assumes near the reference (P moves,
the reference is feasible with room to spare), and a hitch that slides or friction that is smooth on
the scale of one step: a hitch that sticks ends where friction lets go of the error. Far from the
reference there is no proof, but the nonlinear model and the limits are in the plan, which is what a
linear law lacks.

Time: a command that takes longer than a period comes too late on a real robot. The run counts them
(`control_overruns` in metrics.json); the command is used all the same, so that results do not
depend on the machine's load.
"""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.controllers.shared.optimal.receding_horizon import (
    PREDICTION_SUBSTEP_S,
    RecedingHorizon,
)
from ttwmr_mj.controllers.shared.optimal.tracking_problem import TrackingProblem
from ttwmr_mj.controllers.shared.planning import PlanningLaw, TrackingOptions
from ttwmr_mj.controllers.shared.train_tracking import TrainHorizon
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.sensing import Estimate


class Mpc(PlanningLaw["MpcOptions"]):
    """Real-time Gauss-Newton over a receding horizon."""

    def start(self, task: Task) -> None:
        """Fit the reference and compute its cost to go."""
        self._train: TrainHorizon | None = None
        if len(task.robot.trailers) > 1:
            self._train = TrainHorizon(self._options, task, self._options.horizon_samples)
            return
        super().start(task)
        smooth = self._friction.planning(self._period, PREDICTION_SUBSTEP_S)
        problem = TrackingProblem(self._robot, smooth, self._options.weights, learns=self._learns)
        self._decay = self._options.decay(self._period, problem.lasting)
        self._horizon = RecedingHorizon(problem, self._options.horizon_samples)
        self._plan(task.path_ahead)

    def _plan(self, path: ReferencePath, passes: int = 0) -> None:
        self._horizon.plan(path, self._planned, self._decay, passes)

    def command(self, k: int, estimate: Estimate) -> Command:
        """The first command of the improved plan."""
        if self._train is not None:
            return self._train.command(k, estimate)
        now = self._observer.update(estimate)
        k = self._since_plan(k, now)
        everyone = np.ones(self._nsim, dtype=np.bool_)
        return self._possible(self._horizon.command(k, now, self._disturbance(now), everyone), now)


class MpcOptions(TrackingOptions):
    """Model predictive control; steers the trailer, even from large errors."""

    law = Mpc
    tows_trains: ClassVar[bool] = True
    kind: Literal["mpc"] = "mpc"
    horizon_samples: int = Field(
        default=30,
        ge=2,
        le=60,
        description="prediction horizon in control periods; typically one second, 30",
    )
