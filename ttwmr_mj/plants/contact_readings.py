"""What MuJoCo's contact sensors say of wheels and balls."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.names import contact_sensor
from ttwmr_mj.state import FloatArray


class WheelContacts(NamedTuple):
    """What the floor does to each wheel and ball (..., 3 + 2n, 3), as ordered by `names.contacts`.

    World frame.
    """

    force_n: FloatArray  # of the floor on the robot; zero without contact
    position_m: FloatArray  # contact points; of several contacts the strongest's
    slip_m_s: FloatArray  # velocity of the robot's surface over the floor, there


READINGS = 15  # of one contact: force, position, normal, tangent and velocity


def contact_columns(model: mujoco.MjModel, names: tuple[str, ...]) -> NDArray[np.intp]:
    """(bodies, contacts, 15) columns of sensordata that hold the contacts of each wheel or ball."""
    sensors = [model.sensor(contact_sensor(name)) for name in names]
    starts = np.array([int(sensor.adr[0]) for sensor in sensors])
    return starts[:, None, None] + np.arange(int(sensors[0].dim[0])).reshape(1, -1, READINGS)


def joined(readings: FloatArray) -> FloatArray:
    """Readings (..., 15) of the strongest contact with the force of all (..., contacts, 15).

    The strongest alone can be far from what the floor does: on terrain MuJoCo may squeeze a tyre
    between two contacts of opposite normals.
    """
    first, others = readings[..., 0, :].copy(), readings[..., 1:, :]
    if others.any():
        more = np.einsum("...ci,...cij->...j", others[..., :3], _frame(others))
        first[..., :3] += np.einsum("...ij,...j->...i", _frame(first), more)
    return first


def _frame(readings: FloatArray) -> FloatArray:
    """(..., 3, 3) axes of the contact frame, in rows."""
    normal, tangent = readings[..., 6:9], readings[..., 9:12]
    return np.stack([normal, tangent, np.cross(normal, tangent)], axis=-2)


def read_contacts(readings: FloatArray) -> WheelContacts:
    """Contact sensor readings (..., 15) as forces, points and slip in the world frame.

    The sensor speaks in the contact frame (normal, tangent, their cross product), whose normal
    points from the robot to the floor, of the force *on the floor* and of the floor's velocity
    relative to the robot: both change sign here.
    """
    force, position, _, _, velocity = np.split(readings, 5, axis=-1)
    frame = _frame(readings)
    return WheelContacts(
        force_n=-np.einsum("...i,...ij->...j", force, frame),
        position_m=np.array(position),
        slip_m_s=-np.einsum("...i,...ij->...j", velocity, frame),
    )
