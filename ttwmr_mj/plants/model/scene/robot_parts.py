"""Every number of the robot in an MjModel, by the names of its parts."""

import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.errors import cut
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.names import WHEELS

# What MuJoCo makes of the rest, places in its lists, and looks.
DERIVED = re.compile(
    r"\w*(id|adr|num)|user|plugin|group|rgba|castshadow|sameframe|simple|aabb|rbound"
    r"|invweight0|subtreemass|M0|acc0|length|length0|lengthrange"
)
OF_GEOMS = {"contype", "conaffinity", "margin"}  # a body's are those of all its geoms
# the laboratory's frames and camera find the robot by where a site is, whatever it looks like
OF_SITES = {"pos", "quat"}
TYPES = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "joint": mujoco.mjtObj.mjOBJ_JOINT,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
}
POSITIONS = {mujoco.mjtJoint.mjJNT_FREE: 7, mujoco.mjtJoint.mjJNT_BALL: 4}  # of others 1
VELOCITIES = {mujoco.mjtJoint.mjJNT_FREE: 6, mujoco.mjtJoint.mjJNT_BALL: 3}


class Part(NamedTuple):
    """A part by its kind and its name."""

    kind: str
    name: str

    def __str__(self) -> str:
        return f"{self.kind} '{cut(self.name)}'" if self.name else f"unnamed {self.kind}"

    def place(self, model: mujoco.MjModel) -> int:
        """Where it is among those of its kind; −1: the model has none of that name."""
        return int(mujoco.mj_name2id(model, TYPES[self.kind], self.name))


def robot_bodies(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Those that move with the tractor's free joint."""
    return np.flatnonzero(model.body_rootid == model.body("tractor").id)


def colliding(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(ngeom,) which geoms can touch anything."""
    return np.asarray((model.geom_contype != 0) | (model.geom_conaffinity != 0))


def robot_parts(model: mujoco.MjModel) -> list[Part]:
    """The robot's bodies and joints, what touches the ground, its drives and contact sensors."""
    bodies = robot_bodies(model)
    joints = np.flatnonzero(np.isin(model.jnt_bodyid, bodies))
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, bodies) & colliding(model))
    felt = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_CONTACT)
    return [
        *(Part("body", model.body(i).name) for i in bodies),
        *(Part("joint", model.joint(i).name) for i in joints),
        *(Part("geom", model.geom(i).name) for i in geoms),
        Part("site", "P"),
        *(Part("actuator", name) for name in WHEELS),
        *(Part("sensor", model.sensor(i).name) for i in felt),
    ]


def numbers(model: mujoco.MjModel, part: Part) -> dict[str, Any] | None:
    """What makes a part, if there is one: (n,) values, and the names of the parts it belongs to.

    They are called as in MuJoCo's arrays: mass, damping, friction, ….
    """
    if (place := part.place(model)) < 0:
        return None
    found = dict(_rows(model, "jnt" if part.kind == "joint" else part.kind, place))
    match part.kind:
        case "body":
            found = {name: value for name, value in found.items() if name not in OF_GEOMS}
            return found | {"parent": model.body(model.body_parentid[place]).name}
        case "joint":
            return found | _of_joint(model, place)
        case "geom":
            return found | {"body": model.body(model.geom_bodyid[place]).name}
        case "site":
            found = {name: value for name, value in found.items() if name in OF_SITES}
            return found | {"body": model.body(model.site_bodyid[place]).name}
        case "actuator":
            joint = int(model.actuator_trnid[place, 0])
            moves_joint = model.actuator_trntype[place] == mujoco.mjtTrn.mjTRN_JOINT
            return found | {"joint": model.joint(joint).name if moves_joint else ""}
    geom = int(model.sensor_objid[place])
    feels_geom = model.sensor_objtype[place] == mujoco.mjtObj.mjOBJ_GEOM
    return found | {"geom": model.geom(geom).name if feels_geom else ""}


def _of_joint(model: mujoco.MjModel, joint: int) -> dict[str, Any]:
    kind = mujoco.mjtJoint(model.jnt_type[joint])
    speeds, positions = model.jnt_dofadr[joint], model.jnt_qposadr[joint]
    moves = slice(speeds, speeds + VELOCITIES.get(kind, 1))
    stands = slice(positions, positions + POSITIONS.get(kind, 1))
    return {
        # limits and friction both have a solref
        **{f"dof {name}" if name.startswith("sol") else name: value
           for name, value in _rows(model, "dof", moves)},
        "ref": model.qpos0[stands],
        "springref": model.qpos_spring[stands],
        "body": model.body(model.jnt_bodyid[joint]).name,
    }  # fmt: skip


def _rows(
    model: mujoco.MjModel, kind: str, place: int | slice
) -> Iterator[tuple[str, NDArray[Any]]]:
    for name in _arrays(kind):
        yield name, np.atleast_1d(getattr(model, f"{kind}_{name}")[place])


@cache
def _arrays(kind: str) -> tuple[str, ...]:
    """The arrays of an MjModel about bodies, or joints, …, that say what they are."""
    split = (field.partition("_") for field in dir(mujoco.MjModel))
    return tuple(
        name for start, _, name in split if start == kind and name and not DERIVED.fullmatch(name)
    )
