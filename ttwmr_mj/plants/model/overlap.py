"""Whether bodies of a robot overlap."""

import numpy as np

from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

LEAST_M = 1e-3  # less is a touch


def overlaps_m(
    robot: RobotParameters, options: ContactOptions, q: FloatArray
) -> dict[tuple[str, str], float]:
    """How deep bodies that can collide lie in each other.

    Args:
        robot: its bodies.
        options: how its contacts are solved.
        q: (1, 3 + n) x, y of P, θ1, θ2, ….

    Returns:
        Names of two bodies → depth [m]; what is hinged together may overlap.
    """
    # what else is in a scene of the user's own lies in no hull, and may fill its memory
    model = build_model(robot, options.model_copy(update={"model_path": None}))
    data, joints = mujoco.MjData(model), Joints(model)
    data.qpos[:] = joints.standing(np.array(model.qpos0)[None], q)[0]
    mujoco.mj_fwdPosition(model, data)
    found: dict[tuple[str, str], float] = {}
    for contact in data.contact:
        one, other = (_body(model, int(geom)) for geom in contact.geom)
        if "" not in (one, other) and contact.dist < -LEAST_M:
            found[one, other] = max(found.get((one, other), 0.0), -float(contact.dist))
    return found


def _body(model: mujoco.MjModel, geom: int) -> str:
    """The body of a hull, as people call it; empty for what stands or rolls."""
    name = model.geom(geom).name
    if not name.endswith("_hull"):
        return ""
    body = model.body(int(model.geom_bodyid[geom])).name
    return str(body.partition("/")[0])
