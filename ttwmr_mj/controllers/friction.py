"""Dry friction in the hitch, as a controller sees it.

Sliding, the hitch takes τ_c from the trailer, against the motion; that acts like an extra θ̈2, which
a controller can make up for. Stuck, the friction is whatever keeps the hitch locked: a controller
that counts on the sliding value would push too hard or, with the sign of a noisy rate, chatter. In
between, tanh(rate/ε) goes smoothly from one to the other: a stuck hitch counts as free, and breaks
away by the error that grows meanwhile.
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.observer import Seen, wheels_turn
from ttwmr_mj.controllers.options import FrictionOptions
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray


class HitchFriction:
    """What a controller believes of the hitch, and makes up for.

    Attributes:
        believed: the robot as the observer should predict it.
        smooth: the same without dry friction: what can be linearised.
    """

    def __init__(self, robot: RobotParameters, options: FrictionOptions) -> None:
        self.smooth = without_dry_friction(robot)
        self.believed = robot if options.dry == "model" else self.smooth
        self._scale_rad_s = options.smoothing_rad_s
        dry = self.believed.hitch.coulomb_friction_n_m
        self._size = dry / robot.swing_inertia_kg_m2

    def swing(self, seen: Seen) -> FloatArray:
        """(nsim,) θ̈2 that smoothed dry friction causes [rad/s²]."""
        slide = seen.body[:, 4] - wheels_turn(seen.wheels, self.believed) - seen.slip[:, 2]
        return np.asarray(-self._size * np.tanh(slide / self._scale_rad_s))


def without_dry_friction(robot: RobotParameters) -> RobotParameters:
    """The same robot with a hitch that never sticks."""
    hitch = robot.hitch.model_copy(update={"coulomb_friction_n_m": 0.0})
    return robot.model_copy(update={"hitch": hitch})
