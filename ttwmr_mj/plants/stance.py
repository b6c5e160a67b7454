"""How robots stand, from what a batch of MuJoCo's data says of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.footing import FLOWN_M, TIPPED_RAD, Footing
from ttwmr_mj.plants.model.joints import HEIGHT, Joints, W, X, Y, Z
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.state import FloatArray

NEAR_M = 1e-4  # of the ground: a wheel is not off it
LOAD, NORMAL_Z = 0, 8  # of a contact sensor's readings: force, and height of its unit normal
WHEELS = 2
# columns of a reading: the tractor's seven positions and six velocities, of the wheels their
# speeds, their loads, and the heights of the normals that these act along, down into the ground
POSITIONS, VELOCITIES, SPEEDS = slice(7), slice(7, 13), slice(13, 15)
LOADS, NORMALS = slice(15, 17), slice(17, 19)
STEEPEST = 0.5  # height of a normal: what is steeper than 60° is a wall, and carries nobody
TILT = slice(X, Y + 1)
# |x| and |y| of the quaternion of a robot that has not tipped over by far
PLAIN_TILT = np.sin(0.5 * TIPPED_RAD) / 2.0


class Tyres(NamedTuple):
    """Of the tractor's wheels (right, left); in a stance, of every simulation (nsim, 2)."""

    radius_m: FloatArray  # (2,)
    half_width_m: FloatArray  # (2,)
    is_cylinder: NDArray[np.bool_]  # (2,), or an ellipsoid
    centre_m: FloatArray  # (2, 3) in the tractor's axes, from P

    def depth_m(self, axle_z: FloatArray) -> FloatArray:
        """How far the lowest points are below the centres, of unit axles of such a height."""
        disc = self.radius_m * np.sqrt(np.maximum(1.0 - axle_z**2, 0.0))
        edge = self.half_width_m * np.abs(axle_z)
        return np.where(self.is_cylinder, disc + edge, np.hypot(disc, edge))


class Stance:
    """Tells how robots stand, from what a batch of MuJoCo's data says of them.

    Reading is quick; what the readings say is computed later, of many at once. Places and speeds
    follow from the joints: all else in MuJoCo's data is of the beginning of the last step.
    """

    def __init__(
        self,
        reliefs: Sequence[Relief],
        joints: Joints,
        settled_height_m: FloatArray,
        tyres: Sequence[Tyres],
        wheel_columns: NDArray[np.intp],
    ) -> None:
        """Take where to look.

        Args:
            reliefs: ground of each simulation.
            joints: where qpos and qvel hold the tractor and its wheels.
            settled_height_m: (nsim,) of P at rest.
            tyres: of each simulation.
            wheel_columns: (2, 15) columns of sensordata with their contacts' readings.
        """
        self._reliefs = reliefs
        self._free = slice(joints.free_qpos, joints.free_qpos + 7)
        self._moving = slice(joints.free_qvel, joints.free_qvel + 6)
        self._turning = joints.wheel_qvel
        self._settled_m = settled_height_m
        self._tyres = Tyres(*map(np.array, zip(*tyres, strict=True)))
        self._contacts = wheel_columns[:, [LOAD, NORMAL_Z]].T.ravel()
        self._plain = all(relief.plain for relief in reliefs)
        lowest = min(relief.lowest_m for relief in reliefs)
        highest = max(relief.highest_m for relief in reliefs)
        # heights of P that are no more than FLOWN_M from where it stands, wherever it is
        self._plain_m = (
            float(settled_height_m.max()) + highest - FLOWN_M,
            float(settled_height_m.min()) + lowest + FLOWN_M,
        )

    def read(self, qpos: FloatArray, qvel: FloatArray, sensordata: FloatArray) -> FloatArray:
        """(nsim, 19) of the robots whose data these are (nsim, ...)."""
        read = (qpos[:, self._free], qvel[:, self._moving], qvel[:, self._turning])
        return np.concatenate([*read, sensordata[:, self._contacts]], axis=1)

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
        quaternion = position[..., None, W : Z + 1]
        axle = _rotated(np.array([0.0, 1.0, 0.0]), quaternion)
        arm = _rotated(self._tyres.centre_m, quaternion)
        lowest = position[..., None, :3] + arm
        lowest[..., 2] -= self._tyres.depth_m(axle[..., 2])
        above = lowest[..., 2]
        if not self._plain:
            height -= self._ground(position[..., None, :2])[..., 0]
            above = above - self._ground(lowest[..., :2])
        # a tyre that slides on a hard floor touches it at every other step, micrometres above it;
        # one that is far under the ground has fallen through it, or beside it
        near = (above > -self._tyres.radius_m) & (above < NEAR_M)
        carried = (readings[..., LOADS] > 0.0) & (readings[..., NORMALS] < -STEEPEST)
        standing = near | carried
        slip = np.where(standing, self._surface_speed_m_s(readings, axle, arm), 0.0)
        return Footing(
            tilt_rad=np.arccos(np.maximum(np.minimum(up, 1.0), -1.0)),
            height_m=height,
            wheels_on_floor=standing.sum(axis=-1, dtype=np.float64),
            wheel_slip_m_s=slip.max(axis=-1),
        )

    def _surface_speed_m_s(
        self, readings: FloatArray, axle: FloatArray, arm: FloatArray
    ) -> FloatArray:
        """Speeds (..., nsim, 2) along the ground of each wheel's lowest point.

        A contact sensor knows them only at the steps at which a sliding tyre touches.
        """
        position, velocity = readings[..., None, POSITIONS], readings[..., None, VELOCITIES]
        # MuJoCo gives it in the body's axes
        turning = _rotated(velocity[..., 3:], position[..., W : Z + 1])
        spin = turning + readings[..., SPEEDS, None] * axle
        up = np.array([0.0, 0.0, 1.0]) - axle[..., 2:] * axle
        up /= np.linalg.norm(up, axis=-1, keepdims=True)
        surface = velocity[..., :3] + np.cross(turning, arm)
        surface -= np.cross(spin, self._tyres.radius_m[..., None] * up)
        return np.hypot(surface[..., 0], surface[..., 1])

    def _ground(self, places_m: FloatArray) -> FloatArray:
        """Heights (..., nsim, k) of each simulation's ground under places (..., nsim, k, 2)."""
        heights = [relief.under(places_m[..., i, :, :]) for i, relief in enumerate(self._reliefs)]
        return np.stack(heights, axis=-2)


def _rotated(vector: FloatArray, quaternion: FloatArray) -> FloatArray:
    """Vectors (..., 3) turned by unit quaternions (..., 4), w first."""
    w, axis = quaternion[..., :1], quaternion[..., 1:]
    across = np.cross(axis, vector)
    return np.asarray(vector + 2.0 * (w * across + np.cross(axis, across)))
