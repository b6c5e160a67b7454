"""The outlines of a robot's chassis as seen from above."""

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.names import hitches
from ttwmr_mj.state import FloatArray

VISUAL_GROUP = 2
ROUND = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
CIRCLE: FloatArray = np.stack([np.cos(ROUND), np.sin(ROUND)], axis=-1)


def chassis(model: mujoco.MjModel) -> dict[str, int]:
    """Name → body of the tractor and of what hangs on hitches, front to back."""
    names = ("tractor", *hitches(Joints(model).trailers))
    bodies = [model.joint(name).bodyid[0] for name in names]
    return {model.body(body).name: int(body) for body in bodies}


def outline(model: mujoco.MjModel, body: int, margin_m: float) -> FloatArray:
    """(n, 2) corners, counter-clockwise, of the convex hull of a body and its wheels [m].

    In the body's frame, with a margin around it.
    """
    from scipy.spatial import ConvexHull

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    near = _carried(model, body)
    points = []
    for geom in np.flatnonzero(model.geom_group == VISUAL_GROUP).tolist():
        if model.geom_bodyid[geom] in near:
            signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
            box = model.geom_aabb[geom, :3] + signs * model.geom_aabb[geom, 3:]
            points.append(data.geom_xpos[geom] + box @ data.geom_xmat[geom].reshape(3, 3).T)
    local = (np.vstack(points) - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
    wide = (local[:, None, :2] + margin_m * CIRCLE).reshape(-1, 2)
    return np.asarray(wide[ConvexHull(wide).vertices])


def silhouettes(model: mujoco.MjModel, q: FloatArray) -> dict[str, FloatArray]:
    """The outlines of robots that stand level at q (n, 3 + trailers).

    Returns:
        (n, corners, 2) by chassis, front to back [m], world frame.
    """
    data = mujoco.MjData(model)
    corners = {body: outline(model, body, 1e-6) for body in chassis(model).values()}
    placed: dict[int, list[FloatArray]] = {body: [] for body in corners}
    for qpos in Joints(model).standing(np.array(model.qpos0), q):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        for body, local in corners.items():
            turn = data.xmat[body].reshape(3, 3)[:2, :2]
            placed[body].append(data.xpos[body, :2] + local @ turn.T)
    return {name: np.stack(placed[body]) for name, body in chassis(model).items()}


def _carried(model: mujoco.MjModel, chassis_body: int) -> set[int]:
    """A chassis with its wheels: the bodies under it but for the next chassis and its wheels."""
    others = set(chassis(model).values()) - {chassis_body}
    found = {chassis_body}
    for body in range(chassis_body + 1, model.nbody):  # MuJoCo numbers parents before children
        if model.body_parentid[body] in found and body not in others:
            found.add(body)
    return found
