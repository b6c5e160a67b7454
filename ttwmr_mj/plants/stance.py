"""How robots stand, from what a batch of MuJoCo's data says of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.footing import FLOWN_M, TIPPED_RAD, Footing
from ttwmr_mj.plants.model.joints import HEIGHT, X, Y
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.state import FloatArray

NEAR_M = 1e-4  # of the ground: a wheel is not off it
FOUND, SLIP = 0, (13, 14)  # of a contact sensor's readings: contacts, velocity along the tangents
WHEELS = 2
# columns of a reading: the tractor's seven positions, wheel after wheel what its contact sensor
# says of FOUND and SLIP, and where its centre is
POSITIONS, CONTACTS, CENTRES = slice(7), slice(7, 13), slice(13, 19)
TILT = slice(X, Y + 1)
# |x| and |y| of the quaternion of a robot that has not tipped over by far
PLAIN_TILT = np.sin(0.5 * TIPPED_RAD) / 2.0


class Stance:
    """Tells how robots stand, from what a batch of MuJoCo's data says of them.

    Reading is quick; what the readings say is computed later, of many at once.

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
        self._reliefs, self._wheels = reliefs, np.array(wheels)
        self._free = slice(free_qpos, free_qpos + 7)
        self._settled_m = settled_height_m
        self._near_m = wheel_radius_m + NEAR_M
        self._contacts = wheel_columns[:, [FOUND, *SLIP]].ravel()
        self.flat = all(relief.flat for relief in reliefs)
        lowest = min(relief.lowest_m for relief in reliefs)
        highest = max(relief.highest_m for relief in reliefs)
        # heights of P that are no more than FLOWN_M from where it stands, wherever it is
        self._plain_m = (
            float(settled_height_m.max()) + highest - FLOWN_M,
            float(settled_height_m.min()) + lowest + FLOWN_M,
        )

    def read(self, qpos: FloatArray, sensordata: FloatArray, xpos: FloatArray) -> FloatArray:
        """(nsim, 19) of the robots whose data these are (nsim, ...)."""
        centres = xpos[:, self._wheels].reshape(len(qpos), -1)
        return np.concatenate([qpos[:, self._free], sensordata[:, self._contacts], centres], axis=1)

    def stands(self, readings: FloatArray) -> bool:
        """Whether it is plain from readings (nsim, 19) that every robot stands."""
        height, (low, high) = readings[:, HEIGHT], self._plain_m
        tilt = np.abs(readings[:, TILT]).max()
        return bool(low < height.min() and height.max() < high and tilt < PLAIN_TILT)

    def footing(self, readings: FloatArray) -> Footing:
        """How the robots stood, from readings (..., nsim, 19)."""
        position = readings[..., POSITIONS]
        up = 1.0 - 2.0 * (position[..., X] ** 2 + position[..., Y] ** 2)
        height = position[..., HEIGHT] - self._settled_m
        centres = _of_wheels(readings[..., CENTRES])
        above = centres[..., 2]
        if not self.flat:
            height -= self._ground(position[..., None, :2])[..., 0]
            above = above - self._ground(centres[..., :2])
        found, *slip = np.moveaxis(_of_wheels(readings[..., CONTACTS]), -1, 0)
        touching = found > 0.0
        # a tyre that slides on a hard floor touches it at every other step, micrometres above it;
        # a wheel whose centre is under the ground has fallen through it, or beside it
        standing = touching | ((above > 0.0) & (above < self._near_m))
        speed = np.where(touching, np.hypot(*slip), 0.0)
        return Footing(
            tilt_rad=np.arccos(np.maximum(np.minimum(up, 1.0), -1.0)),
            height_m=height,
            wheels_on_floor=standing.sum(axis=-1, dtype=np.float64),
            wheel_slip_m_s=speed.max(axis=-1),
        )

    def _ground(self, places_m: FloatArray) -> FloatArray:
        """Heights (..., nsim, k) of each simulation's ground under places (..., nsim, k, 2)."""
        heights = [relief.at(places_m[..., i, :, :]) for i, relief in enumerate(self._reliefs)]
        return np.stack(heights, axis=-2)


def _of_wheels(columns: FloatArray) -> FloatArray:
    """(..., 6) as (..., 2, 3)."""
    return columns.reshape(*columns.shape[:-1], WHEELS, 3)
