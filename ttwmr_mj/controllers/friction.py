"""Dry friction in the hitch, as a controller sees it.

Sliding, the hitch takes τ_c from the trailer, against the motion; that acts like an extra θ̈2, which
a controller can make up for. Stuck, the friction is whatever keeps the hitch locked: a controller
that counts on the sliding value would push too hard or, with the sign of a noisy rate, chatter. In
between, s/√(s² + ε²) of the hitch rate s goes smoothly from one to the other: a stuck hitch counts
as free, and breaks away by the error that grows meanwhile.

A law that plans (`planning`) has this smooth friction in its model, so that references, gains and
predictions are those of a robot with friction; a law that feeds forward adds `swing` to θ̈2.
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.observer import Seen, wheels_turn
from ttwmr_mj.controllers.options import FrictionOptions
from ttwmr_mj.dynamics.sampled import SUBSTEP_S, SampledModel
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray


class HitchFriction:
    """What a controller believes of the hitch, and makes up for.

    Attributes:
        believed: the robot as the controller takes it to be.
    """

    def __init__(self, robot: RobotParameters, options: FrictionOptions) -> None:
        share = options.believed_share if options.dry == "model" else 0.0
        dry = share * robot.hitch.coulomb_friction_n_m
        hitch = robot.hitch.model_copy(update={"coulomb_friction_n_m": dry})
        self.believed = robot.model_copy(update={"hitch": hitch})
        self._scale_rad_s = options.smoothing_rad_s
        self._size = dry / robot.swing_inertia_kg_m2

    def planning(self, period_s: float, substep_s: float = SUBSTEP_S) -> SampledModel:
        """The sampled model with smooth friction: what can be linearised."""
        return SampledModel(self.believed, period_s, substep_s, self._scale_rad_s)

    def swing(self, seen: Seen) -> FloatArray:
        """(nsim,) θ̈2 that smoothed dry friction causes [rad/s²]."""
        slide = seen.body[:, 4] - wheels_turn(seen.wheels, self.believed) - seen.slip[:, 2]
        return np.asarray(-self._size * slide / np.hypot(slide, self._scale_rad_s))
