"""The robot as a camera draws it: of each body, all parts of one colour are one mesh.

OpenGL in software takes as long to begin a part as to draw it, and a robot has more than thirty.
What faces the floor is left out, and thin posts have fewer sides.
"""

from collections import defaultdict
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.mjcf import build_model, build_spec
from ttwmr_mj.plants.model.outline import VISUAL_GROUP, chassis
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

# how far the sides of a cylinder are from round; a twelfth of the lab camera's pixel
SAGITTA_M = 0.00025
FEWEST_SIDES, MOST_SIDES = 8, 28  # the most as MuJoCo's own cylinders
DOWNWARD = -1.0 + 1e-9  # z of a normal that points straight down
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

Triangles = NDArray[np.intp]


class Surface(NamedTuple):
    """Flat or round faces, in the frame of a part or of its body."""

    points_m: FloatArray  # (n, 3)
    normals: FloatArray  # (n, 3) of unit length, one per point: edges are sharp
    triangles: Triangles  # (m, 3) indices of points, counter-clockwise as seen from outside


def build_drawn_model(robot: RobotParameters, options: ContactOptions) -> mujoco.MjModel:
    """The laboratory with this robot in it, for drawing; bodies and joints as of `build_model`.

    Raises:
        InputError: as of `build_model`.
    """
    plain = build_model(robot, options)
    spec = build_spec(robot, options)
    spec.compile()  # numbers its parts, of which a scene of one's own may have some without a name
    parts = {part.id: part for part in spec.geoms}
    light = [i for i, part in parts.items() if part.mass == 0.0]  # others make up their body
    for geoms in _alike(plain, light):
        _merge(spec, plain, geoms, parts)
    return spec.compile()


def _alike(model: mujoco.MjModel, parts: list[int]) -> list[list[int]]:
    """Those of the parts that can be merged, together those of one body, material and colour."""
    found = defaultdict(list)
    for i in parts:
        seen = model.geom_group[i] == VISUAL_GROUP
        if seen and mujoco.mjtGeom(model.geom_type[i]) in SURFACES:
            look = model.geom_matid[i], model.geom_rgba[i].tobytes()
            found[int(model.geom_bodyid[i]), *look].append(i)
    return [geoms for geoms in found.values() if len(geoms) > 1]


def _merge(
    spec: mujoco.MjSpec, plain: mujoco.MjModel, geoms: list[int], parts: dict[int, Any]
) -> None:
    """Put one mesh in the place of some of a body's geoms; parts are the editable ones of all."""
    body = int(plain.geom_bodyid[geoms[0]])
    upright = body in chassis(plain).values()
    surfaces = [_in_body(plain, i, upright=upright) for i in geoms]
    first = np.cumsum([0, *(len(surface.points_m) for surface in surfaces)])
    name = f"drawn_{geoms[0]}"
    mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    mesh.uservert = np.concatenate([surface.points_m for surface in surfaces]).ravel()
    mesh.usernormal = np.concatenate([surface.normals for surface in surfaces]).ravel()
    triangles = [s.triangles + start for s, start in zip(surfaces, first, strict=False)]
    mesh.userface = mesh.userfacenormal = np.concatenate(triangles).ravel()
    merged = [parts[i] for i in geoms]
    merged[0].parent.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=merged[0].material,
        rgba=merged[0].rgba,
        group=VISUAL_GROUP,
        contype=0,
        conaffinity=0,
        mass=0.0,
    )
    for part in merged:
        spec.delete(part)


def _in_body(model: mujoco.MjModel, geom: int, *, upright: bool) -> Surface:
    """A part's faces in the frame of its body; of one that stays upright, none from below."""
    turn: FloatArray = np.empty((3, 3))
    mujoco.mju_quat2Mat(turn.ravel(), model.geom_quat[geom])
    make = SURFACES[mujoco.mjtGeom(model.geom_type[geom])]
    points, normals, triangles = make(model.geom_size[geom])
    normals = normals @ turn.T
    if upright:
        triangles = triangles[normals[triangles[:, 0], 2] > DOWNWARD]
    return Surface(points @ turn.T + model.geom_pos[geom], normals, triangles)


def _box(half_m: FloatArray) -> Surface:
    """Six sides."""
    points, normals = [], []
    for axis, turns in enumerate((1, -1, 1)):  # x and z of a face turn from y the other way
        for side in (-1, 1):
            face = np.insert(SQUARE[:: side * turns], axis, side, axis=1)
            points.append(face * half_m)
            normals.append(np.tile(side * np.eye(3)[axis], (4, 1)))
    sides = 4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Surface(np.concatenate(points), np.concatenate(normals), sides.reshape(-1, 3))


def _cylinder(size_m: FloatArray) -> Surface:
    """A round side about z and two flat ends."""
    radius, half = size_m[:2]
    n = _sides(radius)
    angle = 2.0 * np.pi * np.arange(n) / n
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    up = np.array([0.0, 0.0, 1.0])
    low, high = radius * out - half * up, radius * out + half * up
    i, after = np.arange(n), np.roll(np.arange(n), -1)
    side = [np.column_stack([i, after, n + after]), np.column_stack([i, n + after, n + i])]
    fan = np.column_stack([np.zeros(n - 2, dtype=np.intp), i[1:-1], i[2:]])
    ends = [3 * n + fan, 2 * n + fan[:, ::-1]]
    return Surface(
        np.concatenate([low, high, low, high]),
        np.concatenate([out, out, np.tile(-up, (n, 1)), np.tile(up, (n, 1))]),
        np.concatenate([*side, *ends]),
    )


def _sides(radius_m: float) -> int:
    """Of the polygon that is drawn for a circle."""
    if radius_m <= SAGITTA_M:
        return FEWEST_SIDES
    count = np.ceil(np.pi / np.arccos(1.0 - SAGITTA_M / radius_m))
    return int(np.clip(count, FEWEST_SIDES, MOST_SIDES))


SURFACES: dict[mujoco.mjtGeom, Callable[[FloatArray], Surface]] = {
    mujoco.mjtGeom.mjGEOM_BOX: _box,
    mujoco.mjtGeom.mjGEOM_CYLINDER: _cylinder,
}
