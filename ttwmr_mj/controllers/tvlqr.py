"""Time-varying linear-quadratic control along any reference that a free trailer can follow.

Before the run the reference is made exact for the sampled robot: Gauss-Newton steps (the same
Riccati recursion with its affine terms, and a line search) find the commands, held over a period,
whose trajectory on the sampled hybrid model, its hitch friction smoothed, stays closest to it. The
model without dry friction is linearised about that trajectory and the recursion run backwards, from
beyond the end, which gives the gains u_k = ū_k + K_k·(x_k − x̄_k). Why without: `friction`.

What the observer found of slip and of an unexplained θ̈2 enters as four more states that decay
slowly and that no input moves: the recursion then finds the command that makes up for them, and no
integral of the error is needed.

Stability: along the trajectory the closed loop of the linearised model is exponentially stable if
the pair (A_k, B_k) is uniformly controllable, with V = δxᵀP_k·δx as Lyapunov function (V decreases
by the stage cost, in which δx is observable through F and θ). It is controllable while P moves and
turns; at standstill it is not (a robot that stands cannot correct its position sideways), so a
reference that ends at rest ends with the errors it has there. For the nonlinear robot it holds
locally, while no servo saturates and the model is right between samples. Dry friction that the
robot's parameters name is cancelled while the hitch slides; stuck, it is a bounded disturbance.
Outside that region the gains, which stay the same, lose the robot; there model predictive control
leads it back (`recovery`; with recovery = "own" nothing does).
"""

from typing import Any, ClassVar, Literal

import numpy as np

from ttwmr_mj.controllers.base import Command, Law, Task
from ttwmr_mj.controllers.shared.optimal.gauss_newton import fit, lqr
from ttwmr_mj.controllers.shared.optimal.riccati import apply
from ttwmr_mj.controllers.shared.optimal.tracking_problem import UNKNOWN, TrackingProblem
from ttwmr_mj.controllers.shared.planning import PlanningLaw, TrackingOptions
from ttwmr_mj.controllers.shared.recovery import Recovery, RecoveryKind
from ttwmr_mj.controllers.shared.train_tracking import TrainGains
from ttwmr_mj.dynamics.floor.influence import DRY, VISCOUS
from ttwmr_mj.dynamics.sampled.one_trailer import SLIP
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import wrap


class Tvlqr(PlanningLaw["TvlqrOptions"]):
    """Precomputed gains on the observer's state."""

    def start(self, task: Task) -> None:
        """Fit the reference and compute the gains."""
        self._train: TrainGains | None = None
        if len(task.robot.trailers) > 1:
            self._train = TrainGains(self._options, task)
            return
        super().start(task)
        robot, weights, learns = self._robot, self._options.weights, self._learns
        smooth, free = self._friction.planning(self._period), self._friction.free(self._period)
        self._smooth = TrackingProblem(robot, smooth, weights, learns=learns)
        self._free = TrackingProblem(robot, free, weights, learns=learns)
        self._recovery: Recovery | None = None
        if self._options.recovery != "own":
            self._recovery = Recovery(robot, self._friction, self._period, self._nsim, learns)
        self._plan(task.path_ahead)

    def _plan(self, path: ReferencePath, passes: int = 0) -> None:
        self._state, self._command = fit(
            self._smooth, self._smooth.target(path), self._planned, passes
        )
        without = self._planned.copy()
        without[:, UNKNOWN + DRY : UNKNOWN + VISCOUS] = 0.0
        decay = self._options.decay(self._period, self._free.lasting)
        self._gain = lqr(self._free, self._state, self._command, decay, without).gain
        influence = self._influence_planned
        self._rubbing = self._friction.acceleration_along(self._state, influence)
        if self._recovery is not None:
            self._recovery.plan(path, self._planned, passes)

    def command(self, k: int, estimate: Estimate) -> Command:
        """ū + K·(x − x̄), or what leads back, within the servos' limits."""
        if self._train is not None:
            return self._train.command(k, estimate)
        now = self._observer.update(estimate)
        k = self._since_plan(k, now)
        viscous = self._influence_planned[:, VISCOUS]
        rubbing = self._friction.acceleration(now, viscous) - self._rubbing[k]
        miss = np.concatenate([now.body, now.wheels], axis=1) - self._state[k]
        miss[:, 2:4] = wrap(miss[:, 2:4])
        beside = self._disturbance(now) - self._planned
        beside[:, SLIP] += rubbing
        miss = np.concatenate([miss, beside[:, : self._free.lasting]], axis=1)
        wish = self._command[k] + apply(self._gain[k], miss)
        if self._recovery is not None:
            led, wheels = self._recovery.command(k, now, self._disturbance(now))
            wish[led] = wheels
        return self._possible(wish, now)


class TvlqrOptions(TrackingOptions):
    """Time-varying LQR along any feasible reference; steers the trailer."""

    law: ClassVar[type[Law[Any]]] = Tvlqr
    tows_trains: ClassVar[bool] = True
    kind: Literal["tvlqr"] = "tvlqr"
    recovery: RecoveryKind = "auto"
