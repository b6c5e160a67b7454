"""Dry friction in the hitch, as a controller sees it.

A sliding hitch exerts the torque τ_c on the trailer, against the motion; that acts like an extra
θ̈2, which a controller can compensate. In a stuck hitch the friction is whatever keeps it locked: a
controller that relies on the sliding value would push too hard or, with the sign of a noisy rate,
chatter. In between, s/√(s² + ε²) of the hitch rate s goes smoothly from one to the other: a stuck
hitch counts as free, and breaks away because of the error that grows meanwhile.

References, and mpc's predictions, are made on a model with this smooth friction (`planning`): they
are those of a robot with friction. Gains that are computed once are those of a free hitch: about
a hitch that does not turn, smooth friction is a strong damper, and gains that count on a damper
that a sliding hitch lacks are unstable. There, what friction does beyond what it does along the
reference is fed forward as an extra θ̈2 (`acceleration`).
"""

from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.shared.estimation.observer import Observed, rolling_turn_rate
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.influence import DRY, VISCOUS, influence_of
from ttwmr_mj.dynamics.sampled.one_trailer import SUBSTEP_S, SampledModel
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.state import FloatArray


class FrictionOptions(Config):
    """How a controller compensates the hitch's dry friction."""

    dry: Literal["ignored", "model"] = Field(
        default="model",
        description="dry friction of the hitch: ignored, or compensated with the value of "
        "robot.hitch",
    )
    smoothing_rad_s: float = Field(
        default=0.05,
        ge=1e-12,
        le=10,
        description="ε, the hitch rate above which friction is taken as nearly full; "
        "typically 0.05",
    )


class HitchFriction:
    """What a controller assumes about the hitch, and compensates.

    Attributes:
        believed: the robot as the controller takes it to be.
    """

    def __init__(
        self, robot: RobotParameters, options: FrictionOptions, ground: Ground | None = None
    ) -> None:
        dry = robot.hitch.coulomb_friction_n_m if options.dry == "model" else 0.0
        hitch = robot.hitch.model_copy(update={"coulomb_friction_n_m": dry})
        self.believed = robot.model_copy(update={"hitch": hitch})
        self._ground, self._scale_rad_s = ground or Ground(), options.smoothing_rad_s

    def planning(self, period_s: float, substep_s: float = SUBSTEP_S) -> SampledModel:
        """The sampled model with smooth friction: what can be differentiated."""
        return SampledModel(self.believed, period_s, substep_s, self._scale_rad_s, self._ground)

    def free(self, period_s: float) -> SampledModel:
        """The sampled model without dry friction."""
        hitch = self.believed.hitch.model_copy(update={"coulomb_friction_n_m": 0.0})
        robot = self.believed.model_copy(update={"hitch": hitch})
        return SampledModel(robot, period_s, ground=self._ground)

    def rate(self, now: Observed) -> FloatArray:
        """(nsim,) θ̇2 − θ̇1, the heading's slip included [rad/s]."""
        return now.body[:, 4] - rolling_turn_rate(now.wheels, self.believed) - now.slip[:, 2]

    def acceleration(self, now: Observed, viscous: FloatArray) -> FloatArray:
        """(nsim,) θ̈2 that smooth friction causes [rad/s²].

        Args:
            now: with what is known or learned of the hitch.
            viscous: (nsim,) or one; viscous friction that is counted elsewhere [1/s].
        """
        return self._acceleration(self.rate(now), now.influence, viscous)

    def acceleration_along(
        self, state: FloatArray, influence: FloatArray | None = None
    ) -> FloatArray:
        """(...) the same along states (..., 7) of a plan.

        The plan counts viscous friction; it was made with influences (..., 5), or those believed.
        """
        if influence is None:
            influence = influence_of(self.believed, self._ground)
        rate = state[..., 4] - rolling_turn_rate(state[..., 5:], self.believed)
        return self._acceleration(rate, influence, influence[..., VISCOUS])

    def _acceleration(
        self, rate: FloatArray, influence: FloatArray, viscous: FloatArray
    ) -> FloatArray:
        dry = -influence[..., DRY] * rate / np.hypot(rate, self._scale_rad_s)
        return np.asarray(dry - (influence[..., VISCOUS] - viscous) * rate)
