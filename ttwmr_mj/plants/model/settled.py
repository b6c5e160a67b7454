"""How robots stand once they have sunk into their contacts."""

import copy
from collections.abc import Sequence

import numpy as np

from ttwmr_mj.errors import InputError, in_brief
from ttwmr_mj.plants.model.engine import Faults, batch, mujoco
from ttwmr_mj.plants.model.joints import HEIGHT, Joints, W, X, Y
from ttwmr_mj.plants.model.relief import take_off
from ttwmr_mj.state import FloatArray

SETTLE_S = 0.5  # the robot sinks into its soft contacts and comes to rest well before that
AT_A_TIME = 20  # steps: signals are answered in between, in a scene whose physics is slow too
# How many decimals of height [m] and tilt the robot stands with. Those beyond are what the solver's
# order of summation leaves; a mirrored robot must stand in exactly the same way.
SETTLED_DECIMALS = 15
# Softest contacts give way by 0.1 mm, a load off the axis tilts by less than 0.1 mrad.
MOST_MOVED_M, MOST_TILT_RAD, MOST_RATE = 1e-3, 1e-3, 0.01


def settled_qpos(
    models: Sequence[mujoco.MjModel], in_own_scene: Sequence[bool], threads: int, *, leans: bool
) -> FloatArray:
    """Generalized positions of robots standing in their contacts at the origin.

    They sink and tilt about their y axis; nothing else may differ from the model's own pose,
    `qpos0`, but for a load off the axis, which also tilts about x. Whatever the ground, a robot
    stands as if it were level and flat.

    Args:
        models: (nsim,) compiled ones with the same parts in the same places; some may be the same.
        in_own_scene: (nsim,) whether they are made from a scene of the user's own.
        threads: how many may be used.
        leans: whether a load is off the axis.

    Returns:
        (nsim, nq) positions, yaw 0.

    Raises:
        InputError: in a scene of the user's own physics fails, or the robot does not come to rest
            on its wheels. In the laboratory the run tells that.
    """
    first = {id(model): i for i, model in reversed(list(enumerate(models)))}
    place = {key: i for i, key in enumerate(first)}
    level = [copy.copy(models[i]) for i in first.values()]
    for model in level:
        model.opt.gravity[:2] = 0.0
        take_off(model)
    apart = batch.Batch(level[0], len(level), min(threads, len(level)))
    if len(level) > 1:
        apart.set_models(level)
    qpos, qvel, faults = apart.bind("qpos"), apart.bind("qvel"), Faults(apart)
    with faults.kept():
        apart.reset()
    standing = np.array(qpos)
    left = round(SETTLE_S / level[0].opt.timestep)
    while left:
        now = min(left, AT_A_TIME)
        with faults.kept():
            apart.step(nstep=now)
        left -= now
    joints = Joints(level[0])
    for row, i in enumerate(first.values()):
        if in_own_scene[i]:
            _refuse_failed(faults.of(row))
            _refuse_unsteady(joints, qpos[row] - standing[row], qvel[row])
    free = joints.free_qpos
    tilts = [free + Y, free + X] if leans else [free + Y]
    sunk = [free + HEIGHT, *tilts]
    standing[:, sunk] = np.round(qpos[:, sunk], SETTLED_DECIMALS)
    standing[:, free + W] = np.sqrt(1.0 - (standing[:, tilts] ** 2).sum(axis=1))
    return standing[[place[id(model)] for model in models]]


def _refuse_failed(fault: str) -> None:
    """What has failed says nothing of the floor."""
    if not fault:
        return
    hint = "keep what else is in it from lying deep in each other or moving that fast"
    if "memory" in fault:  # full of contacts
        hint = 'raise <size memory="…"/> in the scene or leave it out, or let fewer things touch'
    raise InputError.at(
        "plant.contact.model_path",
        f"MuJoCo fails within {SETTLE_S:g} s after the robot was put on the floor at the origin: "
        f"{in_brief(fault)}",
        allowed="a scene that it can simulate",
        hint=hint,
    )


def _refuse_unsteady(joints: Joints, moved: FloatArray, qvel: FloatArray) -> None:
    """Only on a level floor at height zero a robot stays where its wheels touch that floor."""
    free, free_rate = joints.free_qpos, joints.free_qvel
    away_m = moved[free : free + 3]
    tilt_rad = 2.0 * float(np.abs(moved[free + X : free + Y + 1]).max())
    rate = float(np.abs(qvel[free_rate : free_rate + 6]).max())
    steady = np.abs(away_m).max() < MOST_MOVED_M and tilt_rad < MOST_TILT_RAD and rate < MOST_RATE
    if not steady:  # neither is what is not finite
        side = "above" if away_m[HEIGHT] > 0 else "below"
        raise InputError.at(
            "plant.contact.model_path",
            f"{SETTLE_S:g} s after it was put on the floor at the origin, the robot is "
            f"{1e3 * abs(away_m[HEIGHT]):.3g} mm {side} its place, tilted by "
            f"{1e3 * tilt_rad:.3g} mrad and moves at up to {rate:.3g} m/s or rad/s",
            allowed=f"a scene in which it is at rest, within {1e3 * MOST_MOVED_M:g} mm and "
            f"{1e3 * MOST_TILT_RAD:g} mrad",
            hint="make the geom floor level, at height 0, and leave the origin free; slopes and "
            "bumps are set by ground",
        )
