"""The extended model as a plant: `dynamics.extended` integrated under wheel commands."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.dynamics.servo import cut, ramp
from ttwmr_mj.plants.bodiless import BodilessPlant
from ttwmr_mj.plants.extended_steps import rolling_setpoint, step
from ttwmr_mj.state import THETA2, BoolArray, FloatArray, RobotState


class ExtendedPlant(BodilessPlant):
    """A batch of robots that follow the extended model; each may have its own parameters.

    Attributes:
        nsim: simulations in the batch.
        time_step_s: the step in which commands are held.
    """

    def __init__(
        self, model: ExtendedModel, nsim: int, time_step_s: float, max_integration_step_s: float
    ) -> None:
        """Build the plant, at rest at the origin.

        Args:
            model: the equations and their parameters.
            nsim: simulations in the batch.
            time_step_s: duration of one step of `advance`.
            max_integration_step_s: upper bound of the Runge-Kutta step.
        """
        self.nsim = nsim
        self.time_step_s = time_step_s
        self._model = model
        self._max_step_s = max_integration_step_s
        self.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0, nsim))

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; the setpoints are those that drive like that."""
        self._state = np.vstack([initial.q.T, initial.q_rate[:, THETA2]])
        self._setpoint = rolling_setpoint(self._model, initial)
        self._setpoint_rate: FloatArray = np.zeros((self.nsim, 2))
        self._lead_s: FloatArray = np.zeros((self.nsim, 2))

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        rate = self._model.rate(self._state, self._setpoint, self._setpoint_rate, self._lead_s)
        return RobotState(q=self._state[:-1].T.copy(), q_rate=rate[:-1].T.copy())

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) setpoints of the wheels (right, left)."""
        return np.array(self._setpoint)

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        return np.asarray(~np.isfinite(self._state.sum(axis=0)))

    def advance(self, wheel_command_rad_s: FloatArray, steps: int) -> None:
        """Hold commanded wheel speeds for a number of steps; the servo's limits apply."""
        servo, duration_s = self._model.robot.servo, steps * self.time_step_s
        stretches = cut(
            self._setpoint,
            wheel_command_rad_s,
            servo,
            duration_s,
            self._max_step_s,
            self._model.physics_step_s,
        ).lasting
        for k in range(len(stretches.duration_s)):
            self._state = step(self._model, self._state, stretches.where(k))
        self._setpoint = ramp(self._setpoint, wheel_command_rad_s, servo, np.array([duration_s]))[
            :, 0
        ]
        self._setpoint_rate, self._lead_s = stretches.rate_rad_s2[-1], stretches.lead_s[-1]
