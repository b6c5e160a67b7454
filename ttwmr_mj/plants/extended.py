"""The extended model as a plant: `dynamics.extended` integrated under wheel commands."""

import numpy as np

from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.train import with_hitches
from ttwmr_mj.dynamics.kinematics import workspace_rate
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.errors import InputError, at_most
from ttwmr_mj.plants.base import ModelPlant
from ttwmr_mj.plants.swing import RK4_STABLE_RADIUS
from ttwmr_mj.plants.train_swing import longest_step_s
from ttwmr_mj.state import THETA2, BoolArray, FloatArray, RobotState


class ExtendedPlant(ModelPlant):
    """A batch of robots that follow the extended model; each may have its own parameters."""

    def __init__(
        self, model: ExtendedModel, nsim: int, time_step_s: float, max_integration_step_s: float
    ) -> None:
        """Build the plant from the equations and their parameters; the rest as of its base.

        Raises:
            InputError: the integration would be unstable for this hitch.
        """
        self._model = model.softened(max_integration_step_s)
        longest_s = _longest_step_s(model)
        if max_integration_step_s > longest_s:
            raise InputError.at(
                "plant.analytic.max_step_s",
                "the hitch's spring and damper (robot.hitch.stiffness_n_m_rad, "
                "plant.analytic.extended.hitch_damping_n_m_s_rad) are too stiff for it",
                got=f"{max_integration_step_s:g}",
                allowed=at_most(longest_s),
                hint="lower it, or the spring's and damper's constants",
            )
        timing = time_step_s, max_integration_step_s, model.physics_step_s
        self._width = 3 + len(model.robot.trailers)
        super().__init__(model.robot.servo, nsim, *timing, trailers=self._width - THETA2)

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; the setpoints are those that drive like that."""
        self._state = np.vstack([initial.q.T, initial.q_rate[:, THETA2:].T])
        self._setpoint = self._model.wheels(workspace_rate(initial.q, initial.q_rate)[:, :2])
        self._setpoint_rate: FloatArray = np.zeros((self.nsim, 2))
        self._lead_s: FloatArray = np.zeros((self.nsim, 2))

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        rate = self._model.rate(self._state, self._setpoint, self._setpoint_rate, self._lead_s)
        return RobotState(
            q=self._state[: self._width].T.copy(), q_rate=rate[: self._width].T.copy()
        )

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


def _longest_step_s(model: ExtendedModel) -> float:
    """Stable for the hitches' springs and dampers."""
    if len(model.robot.trailers) > 1:
        return longest_step_s(
            with_hitches(model.robot, float(np.max(model.values["hitch_damping_n_m_s_rad"])))
        )
    return float(RK4_STABLE_RADIUS / max(float(np.max(_fastest(model))), np.finfo(float).tiny))


def _fastest(model: ExtendedModel) -> FloatArray:
    """Magnitude [1/s] of the fastest eigenvalue of J·φ̈ + c·φ̇ + k·φ = 0, the hitch alone."""
    inertia = model.swing_inertia_kg_m2
    stiffness = np.asarray(model.robot.hitch.stiffness_n_m_rad / inertia)
    half = np.asarray(0.5 * model.values["hitch_damping_n_m_s_rad"] / inertia)
    beyond = half**2 - stiffness
    real = half + np.sqrt(np.maximum(beyond, 0.0))
    return np.asarray(np.where(beyond < 0.0, np.sqrt(stiffness), real))
