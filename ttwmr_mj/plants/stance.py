"""How robots stand, from what a batch of MuJoCo's data says of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.footing import FLOWN_M, TIPPED_RAD, Footing
from ttwmr_mj.plants.model.joints import HEIGHT, Joints, W, X, Y, Z
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.state import FloatArray

NEAR_M = 1e-4  # of the ground: a wheel is not off it
LOAD = 0  # of a contact sensor's readings: the force along the normal
WHEELS = 2
# columns of a reading: the tractor's seven positions and six velocities, of the wheels their
# speeds, their loads, and where their centres are
POSITIONS, VELOCITIES, SPEEDS = slice(7), slice(7, 13), slice(13, 15)
LOADS, CENTRES = slice(15, 17), slice(17, 23)
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
        joints: Joints,
        settled_height_m: FloatArray,
        wheels: Sequence[int],
        wheel_radius_m: FloatArray,
        wheel_columns: NDArray[np.intp],
    ) -> None:
        """Take where to look.

        Args:
            reliefs: ground of each simulation.
            joints: where qpos and qvel hold the tractor and its wheels.
            settled_height_m: (nsim,) of P at rest.
            wheels: bodies of the tractor's wheels.
            wheel_radius_m: (nsim, 2).
            wheel_columns: (2, 15) columns of sensordata with their contacts' readings.
        """
        self._reliefs, self._wheels = reliefs, np.array(wheels)
        self._free = slice(joints.free_qpos, joints.free_qpos + 7)
        self._moving = slice(joints.free_qvel, joints.free_qvel + 6)
        self._turning = joints.wheel_qvel
        self._settled_m = settled_height_m
        self._radius_m = wheel_radius_m
        self._loads = wheel_columns[:, LOAD]
        self.flat = all(relief.flat for relief in reliefs)
        lowest = min(relief.lowest_m for relief in reliefs)
        highest = max(relief.highest_m for relief in reliefs)
        # heights of P that are no more than FLOWN_M from where it stands, wherever it is
        self._plain_m = (
            float(settled_height_m.max()) + highest - FLOWN_M,
            float(settled_height_m.min()) + lowest + FLOWN_M,
        )

    def read(
        self, qpos: FloatArray, qvel: FloatArray, sensordata: FloatArray, xpos: FloatArray
    ) -> FloatArray:
        """(nsim, 23) of the robots whose data these are (nsim, ...)."""
        read = (qpos[:, self._free], qvel[:, self._moving], qvel[:, self._turning])
        centres = xpos[:, self._wheels].reshape(len(qpos), -1)
        return np.concatenate([*read, sensordata[:, self._loads], centres], axis=1)

    def stands(self, readings: FloatArray) -> bool:
        """Whether it is plain from readings (nsim, 23) that every robot stands."""
        height, (low, high) = readings[:, HEIGHT], self._plain_m
        tilt = np.abs(readings[:, TILT]).max()
        return bool(low < height.min() and height.max() < high and tilt < PLAIN_TILT)

    def footing(self, readings: FloatArray) -> Footing:
        """How the robots stood, from readings (..., nsim, 23)."""
        position = readings[..., POSITIONS]
        up = 1.0 - 2.0 * (position[..., X] ** 2 + position[..., Y] ** 2)
        height = position[..., HEIGHT] - self._settled_m
        centres = readings[..., CENTRES].reshape(*height.shape, WHEELS, 3)
        above = centres[..., 2]
        if not self.flat:
            height -= self._ground(position[..., None, :2])[..., 0]
            above = above - self._ground(centres[..., :2])
        # a tyre that slides on a hard floor touches it at every other step, micrometres above it;
        # a wheel whose centre is under the ground has fallen through it, or beside it
        near = (above > 0.0) & (above < self._radius_m + NEAR_M)
        standing = near | (readings[..., LOADS] > 0.0)
        slip = np.where(standing, self._surface_speed_m_s(readings, centres), 0.0)
        return Footing(
            tilt_rad=np.arccos(np.maximum(np.minimum(up, 1.0), -1.0)),
            height_m=height,
            wheels_on_floor=standing.sum(axis=-1, dtype=np.float64),
            wheel_slip_m_s=slip.max(axis=-1),
        )

    def _surface_speed_m_s(self, readings: FloatArray, centres: FloatArray) -> FloatArray:
        """Speeds (..., nsim, 2) along the ground of each wheel's lowest point.

        A contact sensor knows them only at the steps at which a sliding tyre touches.
        """
        position, velocity = readings[..., None, POSITIONS], readings[..., None, VELOCITIES]
        quaternion = position[..., W : Z + 1]
        turning = _rotated(velocity[..., 3:], quaternion)  # MuJoCo gives it in the body's axes
        axle = _rotated(np.array([0.0, 1.0, 0.0]), quaternion)
        spin = turning + readings[..., SPEEDS, None] * axle
        up = np.array([0.0, 0.0, 1.0]) - axle[..., 2:] * axle
        up /= np.linalg.norm(up, axis=-1, keepdims=True)
        surface = velocity[..., :3] + np.cross(turning, centres - position[..., :3])
        surface -= np.cross(spin, self._radius_m[..., None] * up)
        return np.hypot(surface[..., 0], surface[..., 1])

    def _ground(self, places_m: FloatArray) -> FloatArray:
        """Heights (..., nsim, k) of each simulation's ground under places (..., nsim, k, 2)."""
        heights = [relief.at(places_m[..., i, :, :]) for i, relief in enumerate(self._reliefs)]
        return np.stack(heights, axis=-2)


def _rotated(vector: FloatArray, quaternion: FloatArray) -> FloatArray:
    """Vectors (..., 3) turned by unit quaternions (..., 4), w first."""
    w, axis = quaternion[..., :1], quaternion[..., 1:]
    across = np.cross(axis, vector)
    return np.asarray(vector + 2.0 * (w * across + np.cross(axis, across)))
