"""The time-varying LQR of a train about any feasible reference.

Reference and gains are made as for one trailer: the reference by Gauss-Newton on the model with
smooth friction, the gains on the model without, and what friction does beyond that along the
reference is fed forward as an extra θ̈ of every trailer. About a circle all are the same in the
frame that turns, so the gains are constant but for the run's end.
"""

import numpy as np

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.controllers.shared.gauss_newton import fit, lqr
from ttwmr_mj.controllers.shared.observer import Observed, rolling_turn_rate
from ttwmr_mj.controllers.shared.planning import TrackingOptions
from ttwmr_mj.controllers.shared.riccati import apply
from ttwmr_mj.controllers.shared.train_observer import TrainObserver
from ttwmr_mj.controllers.shared.train_problem import TrainProblem
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S, NEAR_STANDSTILL_M_S
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.sampled_train import SLIP, SampledTrain
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, wrap


class TrainTracking:
    """Precomputed gains on the observer's state."""

    def __init__(self, options: TrackingOptions, task: Task) -> None:
        """Fit the reference and compute the gains."""
        period, smoothing = task.sampling_time_s, options.friction.smoothing_rad_s
        free = _without_dry_friction(task.robot)
        self._robot = robot = task.robot if options.friction.dry == "model" else free
        self._model = SampledTrain(robot, period, smoothing, task.ground)
        smooth = TrainProblem(robot, self._model, options.weights)
        self._state, self._command = fit(smooth, smooth.target(task.path_ahead))
        model = SampledTrain(free, period, smoothing, task.ground)
        problem = TrainProblem(free, model, options.weights)
        decay = np.full(problem.lasting, np.exp(-period / options.disturbance_time_s))
        self._gain = lqr(problem, self._state, self._command, decay).gain
        self._observer = TrainObserver(robot, self._model, options.observer, task.ahead)
        self._angles = slice(2, 3 + len(robot.trailers))
        self._rubbing = self._friction(self._state)

    def command(self, k: int, estimate: Estimate) -> Command:
        """ū + K·(x − x̄) within the servos' limits."""
        now = self._observer.update(estimate)
        state = np.concatenate([now.body, now.wheels], axis=1)
        miss = state - self._state[k]
        miss[:, self._angles] = wrap(miss[:, self._angles])
        beside = np.concatenate([now.slip, now.unexplained], axis=1)
        beside[:, SLIP:] += self._friction(state, now.slip[:, 2]) - self._rubbing[k]
        wish = self._command[k] + apply(self._gain[k], np.concatenate([miss, beside], axis=1))
        return self._possible(wish, now)

    def _friction(self, state: FloatArray, turn_slip: FloatArray | float = 0.0) -> FloatArray:
        """(..., n) θ̈ of dry friction at states."""
        n = self._model.trailers
        turn = rolling_turn_rate(state[..., -2:], self._robot) + turn_slip
        return self._model.friction(state[..., 3 : 3 + n], state[..., 3 + n : -2], turn)

    def _possible(self, wish: FloatArray, now: Observed) -> Command:
        """The command closest to the desired one (nsim, 2) [rad/s]; the observer is told."""
        wheels = self._model.within_limits(now.wheels, wish)
        self._observer.commanded(wheels)
        speed = twist_from_wheels(wheels, self._robot)[:, 0]
        cut = np.abs(wheels - wish).max(axis=1) > CUT_RAD_S
        slow = np.asarray(np.abs(speed) < NEAR_STANDSTILL_M_S)
        return Command(wheels, saturated=cut, near_singular=slow)


def _without_dry_friction(robot: RobotParameters) -> RobotParameters:
    hitches = [h.model_copy(update={"coulomb_friction_n_m": 0.0}) for h in robot.hitches]
    return robot.model_copy(update={"hitches": tuple(hitches)})
