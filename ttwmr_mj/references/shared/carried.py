"""The same path of the trailer's centre of oscillation where other forces act on the trailer.

On a slope, with balls that resist or with a spring or damper in the hitch, F can still go where it
should, but θ2 and P that carry it there are others. With θ̈2 = ((P'' − g_p)·n)/k + d (d: all but
gravity, `dynamics.floor.influence`),

    F'' − g_p + k·d·n = a·t,

so θ2 is the direction of the left-hand side. d depends on the motion in turn; it is small against
a, and found by repeating. That of the hitch is found first, by itself (`hitched`).
"""

import numpy as np

from ttwmr_mj.dynamics.flatness import (
    FlatMotion,
    dot,
    motion_from_flat,
    trailer_axes,
    velocity_behind,
)
from ttwmr_mj.dynamics.floor.influence import DRAG, GRAVITY, held_back
from ttwmr_mj.references.shared.hitched import has_spring, hitch_push, hitched
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, wrap

ROUNDS = 25  # the error falls to c/|a| of it in each: a fifth at δ = 1e-4 m on a circle of 0.6 m
ROOM = 1.2  # |F''| over what acts on the trailer; with less θ2 would have no firm direction


def carried(path: ReferencePath, robot: RobotParameters, influence: FloatArray) -> ReferencePath:
    """The reference under these influences, whatever those that it was made for.

    It is left unchanged where F could not be carried along its path, each simulation for itself.
    Derivatives of P from the third on, and of θ1 from the second on, are taken by differences.

    Args:
        path: what it gives of F is used, if it does.
        robot: whose trailer is carried.
        influence: (5,) or (nsim, 5); of friction in the hitch nothing is made here, as its spring
            and damper are the robot's.
    """
    influence = np.atleast_2d(influence)
    if path.flat_derivatives is None:
        return path
    least = np.hypot(*np.moveaxis(path.flat_derivatives[:, :, 2], -1, 0)).min(axis=0)
    hold = np.abs(hitch_push(*_hitch_motion(path), robot)).max(axis=0)
    fits = least > ROOM * (np.hypot(*influence[:, GRAVITY].T) + influence[:, DRAG] + hold)
    if not fits.any():
        return path
    influence = np.where(fits[:, None], influence, 0.0)
    drag = influence[:, DRAG]
    batch = np.broadcast_shapes(path.flat_derivatives.shape[1:2], fits.shape)
    flat = np.broadcast_to(path.flat_derivatives, (len(path.time_s), *batch, 5, 2))
    sign = np.sign(dot(flat[:1, :, 2], trailer_axes(path.theta2_rad[:1])[0]))
    gravity = np.zeros((*flat.shape[:2], 3, 2))
    gravity[:, :, 0] = influence[:, GRAVITY]
    hitch = np.zeros((1, 1, 2))
    if has_spring(robot):
        free = motion_from_flat(flat, sign, robot, gravity).theta2
        found = hitched(path.time_s, flat, free, influence[:, GRAVITY], robot)
        if found is None:
            return path
        hitch = found
    pull = _pull(gravity, np.broadcast_to(hitch, (len(flat), *batch, 2)), path.time_s)
    for _ in range(ROUNDS if drag.any() else 0):
        aside = hitch + _aside(flat, motion_from_flat(flat, sign, robot, pull), robot, drag)
        pull = _pull(gravity, aside, path.time_s)
    done = _reference(path, flat, motion_from_flat(flat, sign, robot, pull))
    return done if fits.all() else _where(fits, done, path)


def _hitch_motion(path: ReferencePath) -> tuple[FloatArray, FloatArray]:
    """φ and its rate (n, batch), of the first hitch."""
    phi = wrap(path.theta2_rad - path.theta1_rad)
    return phi, path.theta_rate[..., 1] - path.theta_rate[..., 0]


def _pull(gravity: FloatArray, aside: FloatArray, time_s: FloatArray) -> FloatArray:
    """(n, batch, 3, 2) what accelerates F beside the hitch's pin, and two derivatives."""
    pull = gravity.copy()
    for order in range(3):
        pull[:, :, order] -= aside
        aside = np.gradient(aside, time_s, axis=0, edge_order=2)
    return pull


def _where(who: BoolArray, one: ReferencePath, other: ReferencePath) -> ReferencePath:
    """One reference for some simulations (batch,), the other for the rest."""

    def mixed(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.where(who.reshape(1, -1, *[1] * (a.ndim - 2)), a, b)

    return ReferencePath(
        time_s=one.time_s,
        derivatives=mixed(one.derivatives, other.derivatives),
        theta=mixed(one.theta, other.theta),
        theta_rate=mixed(one.theta_rate, other.theta_rate),
        theta_acceleration=mixed(one.theta_acceleration, other.theta_acceleration),
        flat_derivatives=one.flat_derivatives,
    )


def _aside(
    flat: FloatArray, motion: FlatMotion, robot: RobotParameters, drag: FloatArray
) -> FloatArray:
    """(n, batch, 2) k·d·n [m/s²]."""
    theta2, rate = motion.theta2[..., 0], motion.theta2[..., 1]
    t, n = trailer_axes(theta2)
    velocity = flat[:, :, 1] + (robot.swing_length_m * rate)[..., None] * n
    com = velocity_behind(velocity, theta2, rate, robot.trailer.com_offset_m)
    held = held_back(drag, dot(com, t), dot(com, n), rate, robot)
    return np.asarray(held[..., None] * n)


def _reference(path: ReferencePath, flat: FloatArray, motion: FlatMotion) -> ReferencePath:
    derivatives, rates = [*np.moveaxis(motion.position, 2, 0)], motion.theta1[..., 1]
    for _ in range(2):
        derivatives.append(np.gradient(derivatives[-1], path.time_s, axis=0))
    theta1 = np.stack([motion.theta1[..., 0], rates, np.gradient(rates, path.time_s, axis=0)])
    theta = np.stack([theta1, np.moveaxis(motion.theta2[..., :3], -1, 0)], axis=-1)
    turns = np.unwrap(theta[0], axis=0)
    # on the branch of the reference it was
    turns += path.theta[:1] + wrap(turns[:1] - path.theta[:1]) - turns[:1]
    return ReferencePath(
        time_s=path.time_s,
        derivatives=np.stack(derivatives, axis=2),
        theta=turns,
        theta_rate=theta[1],
        theta_acceleration=theta[2],
        flat_derivatives=flat,
    )
