"""The observer of a train: a chain (θ, θ̇, unexplained θ̈) of `observer` for every trailer.

How the trailers swing each other is in the prediction; all chains have the gains of the first.
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.shared.estimation.observer import (
    PUSH,
    Observed,
    Observer,
    rolling_turn_rate,
)
from ttwmr_mj.controllers.shared.estimation.steady_kalman import ObserverOptions
from ttwmr_mj.dynamics.kinematics import to_body, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.sampled.train import SampledTrain
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, BoolArray, FloatArray, RobotState, wrap


class TrainObserver(Observer):
    """Filters and predicts; of `Observed`, bodies are (nsim, 3 + 2n), unexplained θ̈ (nsim, n)."""

    def __init__(
        self, robot: RobotParameters, model: SampledTrain, options: ObserverOptions, ahead: int
    ) -> None:
        super().__init__(robot, model, options, None, ahead)  # type: ignore[arg-type]
        self._train, self._width = model, THETA2 + model.trailers
        slow = model.period_s * options.rate_std_rad_s
        self._push = PUSH * np.array([options.angle_std_rad + slow, options.rate_std_rad_s])

    def _first(self, state: RobotState) -> Observed:
        twist = workspace_rate(state.q, state.q_rate)[..., :2]
        return Observed(
            body=np.concatenate([state.q, state.q_rate[:, THETA2:]], axis=1),
            wheels=wheels_from_twist(twist, self._robot),
            slip=np.zeros((state.nsim, 3)),
            unexplained=np.zeros((state.nsim, self._train.trailers)),
            influence=np.zeros((state.nsim, 0)),
        )

    def _predicted(self, now: Observed, command: FloatArray) -> Observed:
        body, wheels = self._train.advance(now.body, now.wheels, command, now.slip, now.unexplained)
        return now._replace(body=body, wheels=wheels)

    def _corrected(self, now: Observed, measured: RobotState, due: BoolArray) -> Observed:
        """Correct the simulations that are due."""
        body, slip, width = now.body.copy(), now.slip.copy(), self._width
        q_rate = np.empty_like(measured.q_rate)
        q_rate[:, :2] = self._train.velocity(body, now.wheels, slip)
        q_rate[:, THETA1] = rolling_turn_rate(now.wheels, self._robot) + slip[:, 2]
        q_rate[:, THETA2:] = body[:, width:]
        miss, drift = measured.q - body[:, :width], measured.q_rate - q_rate
        miss[:, THETA1:] = wrap(miss[:, THETA1:])
        miss, drift = miss * due[:, None], drift * due[:, None]
        # x, y, θ1, and the chain of θ2 once for every trailer
        value, slope, change = self._gain[..., [0, 1, 2, *[THETA2] * (width - THETA2)]]
        body[:, :width] += value[0] * miss + value[1] * drift
        slopes = slope[0] * miss + slope[1] * drift
        ahead, left = to_body(now.body[:, THETA1], slopes[:, 0], slopes[:, 1])
        slip += np.stack([ahead, left, slopes[:, THETA1]], axis=1)
        body[:, width:] += slopes[:, THETA2:]
        # cut, as of one trailer: a push does not last
        cut = np.clip(miss[:, THETA2:], -self._push[0], self._push[0])
        cut_rate = np.clip(drift[:, THETA2:], -self._push[1], self._push[1])
        more = change[0, THETA2:] * cut + change[1, THETA2:] * cut_rate
        return Observed(body, now.wheels, slip, now.unexplained + more, now.influence)
