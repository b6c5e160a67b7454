"""The extended model as a plant: `dynamics.extended` integrated under wheel commands."""

import numpy as np

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.dynamics.kinematics import workspace_rate
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.plants.base import ModelPlant
from ttwmr_mj.state import THETA2, BoolArray, FloatArray, RobotState


class ExtendedPlant(ModelPlant):
    """A batch of robots that follow the extended model; each may have its own parameters."""

    def __init__(
        self, model: ExtendedModel, nsim: int, time_step_s: float, max_integration_step_s: float
    ) -> None:
        """Build the plant from the equations and their parameters; the rest as of its base."""
        self._model = model
        timing = time_step_s, max_integration_step_s, model.physics_step_s
        super().__init__(model.robot.servo, nsim, *timing)

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; the setpoints are those that drive like that."""
        self._state = np.vstack([initial.q.T, initial.q_rate[:, THETA2]])
        self._setpoint = self._model.wheels(workspace_rate(initial.q, initial.q_rate)[:, :2])
        self._setpoint_rate: FloatArray = np.zeros((self.nsim, 2))
        self._lead_s: FloatArray = np.zeros((self.nsim, 2))

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        rate = self._model.rate(self._state, self._setpoint, self._setpoint_rate, self._lead_s)
        return RobotState(q=self._state[:-1].T.copy(), q_rate=rate[:-1].T.copy())

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        return np.asarray(~np.isfinite(self._state.sum(axis=0)))

    def follow(self, stretches: Stretches, end_rad_s: FloatArray) -> None:
        """See the base class."""
        for k in range(len(stretches.duration_s)):
            self._state = self._model.step(self._state, stretches.where(k))
        # the last that lasted in each simulation: those beyond are others'
        last = len(stretches.duration_s) - 1 - (stretches.duration_s[::-1] > 0.0).argmax(axis=0)
        each = np.arange(self.nsim)
        self._setpoint_rate = stretches.rate_rad_s2[last, each]
        self._lead_s = stretches.lead_s[last, each]
        self._setpoint = end_rad_s
