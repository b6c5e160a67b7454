"""What follows a feasible reference with a train: observer, friction, and two laws about a plan.

Both are those of one trailer. The reference is fitted by Gauss-Newton on the model with smooth
friction. `TrainGains`: gains on the model without, and what friction does beyond that along the
reference is fed forward as an extra θ̈ of every trailer. About a circle all are the same in the
frame that turns, so the gains are constant but for the run's end. `TrainHorizon`: the next samples
optimised again every period, friction, smooth, in the model.
"""

from abc import ABC, abstractmethod

import numpy as np

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.controllers.shared.estimation.observer import Observed, rolling_turn_rate
from ttwmr_mj.controllers.shared.estimation.train_observer import TrainObserver
from ttwmr_mj.controllers.shared.optimal.gauss_newton import fit, lqr
from ttwmr_mj.controllers.shared.optimal.receding_horizon import (
    PREDICTION_SUBSTEP_S,
    RecedingHorizon,
)
from ttwmr_mj.controllers.shared.optimal.riccati import apply
from ttwmr_mj.controllers.shared.optimal.train_problem import TrainProblem
from ttwmr_mj.controllers.shared.planning import TrackingOptions
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S, NEAR_STANDSTILL_M_S
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.sampled.train import SLIP, SUBSTEP_S, SampledTrain
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, wrap


class TrainTracking(ABC):
    """A law on the observer's state of a train."""

    def __init__(self, options: TrackingOptions, task: Task) -> None:
        """Set up the believed train and its observer."""
        self._options, self._task = options, task
        period, free = task.sampling_time_s, _without_dry_friction(task.robot)
        self._free, self._robot = free, task.robot if options.friction.dry == "model" else free
        self._model = self._sampled(self._robot)
        self._observer = TrainObserver(self._robot, self._model, options.observer, task.ahead)
        self._decay = np.full(
            SLIP + len(task.robot.trailers), np.exp(-period / options.disturbance_time_s)
        )

    def command(self, k: int, estimate: Estimate) -> Command:
        """What is wanted at sample k, within the servos' limits."""
        now = self._observer.update(estimate)
        return self._possible(self._wish(k, now), now)

    @abstractmethod
    def _wish(self, k: int, now: Observed) -> FloatArray:
        """(nsim, 2) wheel speeds [rad/s]."""

    def _sampled(self, robot: RobotParameters, substep_s: float = SUBSTEP_S) -> SampledTrain:
        task, smoothing = self._task, self._options.friction.smoothing_rad_s
        return SampledTrain(robot, task.sampling_time_s, smoothing, task.ground, substep_s)

    def _possible(self, wish: FloatArray, now: Observed) -> Command:
        """The command closest to the desired one (nsim, 2) [rad/s]; the observer is told."""
        wheels = self._model.within_limits(now.wheels, wish)
        # a wish at a limit counts as cut: who optimises within the limits asks for no more
        outward = wish + np.copysign(CUT_RAD_S, wish - now.wheels)
        cut = np.abs(self._model.within_limits(now.wheels, outward) - outward).max(axis=1) > 0.0
        self._observer.commanded(wheels)
        speed = twist_from_wheels(wheels, self._robot)[:, 0]
        slow = np.asarray(np.abs(speed) < NEAR_STANDSTILL_M_S)
        return Command(wheels, saturated=np.asarray(cut), near_singular=slow)


class TrainGains(TrainTracking):
    """Precomputed gains."""

    def __init__(self, options: TrackingOptions, task: Task) -> None:
        """Fit the reference and compute the gains."""
        super().__init__(options, task)
        smooth = TrainProblem(self._robot, self._model, options.weights)
        self._state, self._command = fit(smooth, smooth.target(task.path_ahead))
        self._problem = TrainProblem(self._free, self._sampled(self._free), options.weights)
        self._gain = lqr(self._problem, self._state, self._command, self._decay).gain
        self._rubbing = self._friction(self._state)

    def _wish(self, k: int, now: Observed) -> FloatArray:
        """ū + K·(x − x̄)."""
        state, angles = np.concatenate([now.body, now.wheels], axis=1), self._problem.angles
        miss = state - self._state[k]
        miss[:, angles] = wrap(miss[:, angles])
        beside = np.concatenate([now.slip, now.unexplained], axis=1)
        beside[:, SLIP:] += self._friction(state, now.slip[:, 2]) - self._rubbing[k]
        wish = self._command[k] + apply(self._gain[k], np.concatenate([miss, beside], axis=1))
        return np.asarray(wish)

    def _friction(self, state: FloatArray, turn_slip: FloatArray | float = 0.0) -> FloatArray:
        """(..., n) θ̈ of dry friction at states."""
        n = self._model.trailers
        turn = rolling_turn_rate(state[..., -2:], self._robot) + turn_slip
        return self._model.friction(state[..., 3 : 3 + n], state[..., 3 + n : -2], turn)


class TrainHorizon(TrainTracking):
    """The next samples, optimised again every period."""

    def __init__(self, options: TrackingOptions, task: Task, samples: int) -> None:
        """Fit the reference and compute its cost to go; the horizon is of some samples."""
        super().__init__(options, task)
        model = self._sampled(self._robot, PREDICTION_SUBSTEP_S)
        problem = TrainProblem(self._robot, model, options.weights)
        self._horizon = RecedingHorizon(problem, samples)
        self._horizon.plan(task.path_ahead, np.zeros((1, problem.width)), self._decay)
        self._everyone = np.ones(task.nsim, dtype=np.bool_)

    def _wish(self, k: int, now: Observed) -> FloatArray:
        """The first command of the improved plan."""
        disturbance = np.concatenate([now.slip, now.unexplained], axis=1)
        return self._horizon.command(k, now, disturbance, self._everyone)


def _without_dry_friction(robot: RobotParameters) -> RobotParameters:
    hitches = [h.model_copy(update={"coulomb_friction_n_m": 0.0}) for h in robot.hitches]
    return robot.model_copy(update={"hitches": tuple(hitches)})
