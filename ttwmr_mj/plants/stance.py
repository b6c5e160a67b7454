"""How robots stand, from what a batch of MuJoCo's data says of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.footing import Footing
from ttwmr_mj.plants.joints import HEIGHT, X, Y
from ttwmr_mj.plants.relief import Relief
from ttwmr_mj.state import FloatArray

NEAR_M = 1e-4  # of the ground: a wheel is not off it
FOUND, SLIP = 0, (13, 14)  # of a contact sensor's readings: contacts, velocity along the tangents


class Stance:
    """Tells how robots stand, from what a batch of MuJoCo's data says of them.

    Attributes:
        flat: whether every ground is only the floor.
    """

    def __init__(
        self,
        reliefs: Sequence[Relief],
        free_qpos: int,
        settled_height_m: FloatArray,
        wheels: Sequence[int],
        wheel_radius_m: FloatArray,
        wheel_columns: NDArray[np.intp],
    ) -> None:
        """Take where to look.

        Args:
            reliefs: ground of each simulation.
            free_qpos: where the tractor's seven positions start in qpos.
            settled_height_m: (nsim,) of P at rest.
            wheels: bodies of the tractor's wheels.
            wheel_radius_m: (nsim, 2).
            wheel_columns: (2, 15) columns of sensordata with their contacts' readings.
        """
        self._reliefs, self._free, self._wheels = reliefs, free_qpos, np.array(wheels)
        self._settled_m = settled_height_m
        self._near_m = wheel_radius_m + NEAR_M
        self._found, self._slip = wheel_columns[:, FOUND], wheel_columns[:, SLIP]
        self.flat = all(relief.flat for relief in reliefs)

    def footing(self, qpos: FloatArray, sensordata: FloatArray, xpos: FloatArray) -> Footing:
        """How the robots stand whose data these are (nsim, ...)."""
        free = self._free
        up = 1.0 - 2.0 * (qpos[:, free + X] ** 2 + qpos[:, free + Y] ** 2)
        height = qpos[:, free + HEIGHT] - self._settled_m
        centres = xpos[:, self._wheels]
        above = centres[..., 2]
        if not self.flat:
            height -= self._ground(qpos[:, free : free + 2])
            above = above - self._ground(centres[..., :2])
        touching = sensordata[:, self._found] > 0.0
        # a tyre that slides on a hard floor touches it at every other step, micrometres above it
        standing = touching | (above < self._near_m)
        slip = sensordata[:, self._slip]
        speed = np.where(touching, np.hypot(slip[..., 0], slip[..., 1]), 0.0)
        return Footing(
            tilt_rad=np.arccos(np.maximum(np.minimum(up, 1.0), -1.0)),
            height_m=height,
            wheels_on_floor=standing.sum(axis=1, dtype=np.float64),
            wheel_slip_m_s=np.maximum(speed[:, 0], speed[:, 1]),
        )

    def _ground(self, places_m: FloatArray) -> FloatArray:
        """Heights of each simulation's ground under places (nsim, ..., 2)."""
        each = zip(self._reliefs, places_m, strict=True)
        return np.array([relief.at(places) for relief, places in each])
