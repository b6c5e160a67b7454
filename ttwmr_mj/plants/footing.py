"""How a robot stands on the ground."""

from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import BoolArray, FloatArray

TIPPED_RAD = 1.0  # no wheel of a robot so far tilted carries it any longer
FLOWN_M = 0.3  # over or under the ground: whatever threw or dropped it, it is not driving


class Footing(NamedTuple):
    """Of each simulation (..., nsim)."""

    tilt_rad: FloatArray  # of the tractor's deck against the floor's plane
    height_m: FloatArray  # of P over where it stands at rest, above the ground under it
    wheels_on_floor: FloatArray  # how many of the tractor's two are within 0.1 mm of the ground
    wheel_slip_m_s: FloatArray  # the faster of the wheels' surfaces over the ground

    @property
    def gone(self) -> BoolArray:
        """Who stands no longer (..., nsim)."""
        return np.asarray((self.tilt_rad > TIPPED_RAD) | (np.abs(self.height_m) > FLOWN_M))
