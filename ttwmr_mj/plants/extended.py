"""The extended model as a plant: `dynamics.extended` integrated under wheel commands."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.plants.bodiless import BodilessPlant
from ttwmr_mj.plants.extended_steps import Clock, Stretch, cut, rates, rolling_setpoint, step
from ttwmr_mj.state import BoolArray, FloatArray, RobotState


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
            time_step_s: duration of one step of `advance`. Each step is driven at the setpoint of
                its end, as MuJoCo does, so the wheels lead a ramp by half a step.
            max_integration_step_s: upper bound of the Runge-Kutta step.
        """
        self.nsim = nsim
        self.time_step_s = time_step_s
        self._model = model
        self._clock = Clock(time_step_s, max_integration_step_s)
        self.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0, nsim))

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; the setpoints are those that drive like that."""
        self._q, self._swing_rate = np.array(initial.q), np.array(initial.q_rate[:, 3])
        self._setpoint = rolling_setpoint(self._model, initial)
        self._setpoint_rate = np.zeros((self.nsim, 2))
        self._lead_s: FloatArray = np.zeros((self.nsim, 2))

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        now = self._q, self._swing_rate, self._setpoint, self._setpoint_rate, self._lead_s
        return RobotState(q=self._q.copy(), q_rate=rates(self._model, *now)[0])

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) setpoints of the wheels (right, left)."""
        return np.array(self._setpoint)

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        return np.asarray(~np.isfinite(self._q.sum(axis=1) + self._swing_rate))

    def advance(self, wheel_command_rad_s: FloatArray, steps: int) -> None:
        """Hold commanded wheel speeds for a number of steps; the servo's limits apply."""
        duration_s, command = steps * self.time_step_s, wheel_command_rad_s[None]
        servo = self._model.robot.servo
        stretches, _ = cut(self._setpoint, command, duration_s, self._clock, servo)
        for parts in zip(*stretches, strict=True):
            stretch = Stretch(*parts)
            self._q, self._swing_rate = step(self._model, self._q, self._swing_rate, stretch)
        self._setpoint = stretch.setpoint_rad_s + stretch.change_rad_s
        self._setpoint_rate, self._lead_s = stretch.rate_rad_s2, stretch.lead_s
