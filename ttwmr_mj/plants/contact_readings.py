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
    position_m: FloatArray  # contact points
    slip_m_s: FloatArray  # velocity of the robot's surface over the floor


def contact_columns(model: mujoco.MjModel, names: tuple[str, ...]) -> NDArray[np.intp]:
    """(contacts, 15) columns of sensordata that hold each contact's readings."""
    starts = [int(model.sensor(contact_sensor(name)).adr[0]) for name in names]
    return np.array(starts)[:, None] + np.arange(15)


def read_contacts(readings: FloatArray) -> WheelContacts:
    """Contact sensor readings (..., 15) as forces, points and slip in the world frame.

    The sensor speaks in the contact frame (normal, tangent, their cross product), whose normal
    points from the robot to the floor, of the force *on the floor* and of the floor's velocity
    relative to the robot: both change sign here.
    """
    force, position, normal, tangent, velocity = np.split(readings, 5, axis=-1)
    frame = np.stack([normal, tangent, np.cross(normal, tangent)], axis=-2)
    return WheelContacts(
        force_n=-np.einsum("...i,...ij->...j", force, frame),
        position_m=np.array(position),
        slip_m_s=-np.einsum("...i,...ij->...j", velocity, frame),
    )
