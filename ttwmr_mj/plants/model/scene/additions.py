"""What a scene may not add: what moves with the robot, holds it or rules its contacts."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.errors import Fault
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.names import WHEELS
from ttwmr_mj.plants.model.scene.refusal import refusal
from ttwmr_mj.plants.model.scene.robot_parts import Part, robot_bodies, robot_parts

BODY_BITS = 16  # of each of the two bodies in an exclude's signature
LEAVE_OUT = "leave it out"


def additions(own: mujoco.MjModel, shipped: mujoco.MjModel) -> Iterator[Fault]:
    """What is in the user's scene beyond the shipped one, as far as the robot feels it."""
    known = set(robot_parts(shipped))
    for part in robot_parts(own):
        if part not in known and not _is_light(own, part):
            hint = "only what is massless and touches nothing may ride on it"
            yield refusal(f"{part} on the robot", hint=hint)
    on_robot = np.isin(np.arange(own.nbody), robot_bodies(own))
    for part in (*_holds(own, shipped, on_robot), *_contact_rules(own, on_robot)):
        yield refusal(f"{part} of the robot", hint=LEAVE_OUT)
    for geom in _rulers(own, on_robot, known):
        part = Part("geom", own.geom(geom).name)
        hint = "give it a priority below the robot's, whose friction is the scenario's"
        yield refusal(f"{part}: priority {own.geom_priority[geom]}", hint=hint)
    if own.nu != len(WHEELS):
        yield refusal(f"{own.nu} actuators", allowed="the two of the wheels", hint=LEAVE_OUT)


def _is_light(model: mujoco.MjModel, part: Part) -> bool:
    """Sensors, and bodies that carry a camera, say; their joints and geoms count by themselves."""
    if part.kind == "body":
        return bool(model.body_mass[part.place(model)] == 0.0)
    return part.kind == "sensor"


def _holds(
    own: mujoco.MjModel, shipped: mujoco.MjModel, on_robot: NDArray[np.bool_]
) -> Iterator[Part]:
    """Equality constraints and tendons that the robot feels."""
    body_of = {
        mujoco.mjtObj.mjOBJ_BODY: np.arange(own.nbody),
        mujoco.mjtObj.mjOBJ_SITE: own.site_bodyid,
        mujoco.mjtObj.mjOBJ_GEOM: own.geom_bodyid,
        mujoco.mjtObj.mjOBJ_JOINT: own.jnt_bodyid,
    }
    for i in range(own.neq):
        joined = own.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT  # without a type of its own
        kind = mujoco.mjtObj.mjOBJ_JOINT if joined else mujoco.mjtObj(own.eq_objtype[i])
        of = body_of.get(kind)
        ends = [int(end) for end in (own.eq_obj1id[i], own.eq_obj2id[i]) if end >= 0]
        if of is not None and on_robot[of[ends]].any():
            yield Part("equality", own.eq(i).name)
    wraps = {
        mujoco.mjtWrap.mjWRAP_JOINT: own.jnt_bodyid,
        mujoco.mjtWrap.mjWRAP_SITE: own.site_bodyid,
        mujoco.mjtWrap.mjWRAP_SPHERE: own.geom_bodyid,
        mujoco.mjtWrap.mjWRAP_CYLINDER: own.geom_bodyid,
    }
    ours = {shipped.tendon(i).name for i in range(shipped.ntendon)}
    for i in range(own.ntendon):
        path = range(own.tendon_adr[i], own.tendon_adr[i] + own.tendon_num[i])
        kinds = [(wraps.get(mujoco.mjtWrap(own.wrap_type[k])), own.wrap_objid[k]) for k in path]
        touches = any(of is not None and on_robot[of[at]] for of, at in kinds)
        if touches and own.tendon(i).name not in ours:
            yield Part("tendon", own.tendon(i).name)


def _contact_rules(model: mujoco.MjModel, on_robot: NDArray[np.bool_]) -> Iterator[Part]:
    """Rules of <contact> for pairs in which the robot is."""
    for i in range(model.npair):
        geoms = [int(model.pair_geom1[i]), int(model.pair_geom2[i])]
        if on_robot[model.geom_bodyid[geoms]].any():
            yield Part("contact pair", model.pair(i).name)
    for i in range(model.nexclude):
        one, other = divmod(int(model.exclude_signature[i]), 1 << BODY_BITS)
        if on_robot[[one, other]].any():
            yield Part("contact exclude", model.exclude(i).name)


def _rulers(
    model: mujoco.MjModel, on_robot: NDArray[np.bool_], known: set[Part]
) -> NDArray[np.intp]:
    """Geoms around the robot whose numbers would rule where it touches them."""
    names = [Part("geom", model.geom(i).name) for i in range(model.ngeom)]
    ours = np.array([name in known for name in names])
    touch = (model.geom_contype[:, None] & model.geom_conaffinity[ours]) | (
        model.geom_conaffinity[:, None] & model.geom_contype[ours]
    )
    rules = (touch != 0) & (model.geom_priority[:, None] >= model.geom_priority[ours])
    return np.flatnonzero(~on_robot[model.geom_bodyid] & rules.any(axis=1))
