"""The same path of the trailer's centre of oscillation where other forces act on the trailer.

On a slope, with balls that resist or with a spring or damper in the hitch, F can still go where it
should, but θ2 and P that carry it there are others. With θ̈2 = ((P'' − g_p)·n)/k + d (d: all but
gravity, `dynamics.floor.influence`),

    F'' − g_p + k·d·n = a·t,

so θ2 is the direction of the left-hand side. d depends on the motion in turn; it is small against
a, and found by repeating. Where F'' vanishes, between samples too, and a changes its sign,
θ2 would have to turn round. Where a spring or damper acts, all is solved at once (`hitched`).
"""

import numpy as np
from scipy.interpolate import make_interp_spline

from ttwmr_mj.dynamics.flatness import FlatMotion, dot, motion_from_flat, trailer_axes
from ttwmr_mj.dynamics.floor.influence import DRAG, GRAVITY, held_back_moving
from ttwmr_mj.references.shared.hitched import LEAST_SAMPLES, has_spring, hitch_push, hitched
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, wrap

ROUNDS = 25  # the error falls to c/|a| of it in each: a fifth at δ = 1e-4 m on a circle of 0.6 m
LATE = 5  # rounds, at whose end the way to the solution is behind and rounding may show
MOST_LEFT = 0.1  # of the first round's change; each leaves less than 1 / ROOM
ROUNDING_1_S2 = 1e-9  # times the step's square: no matter in second differences
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
    least = _least(path.flat_derivatives[:, :, 2])
    hold = np.abs(hitch_push(*_hitch_motion(path), robot)).max(axis=0)
    fits = least > ROOM * (np.hypot(*influence[:, GRAVITY].T) + influence[:, DRAG] + hold)
    signs = np.sign(dot(path.flat_derivatives[:, :, 2], trailer_axes(path.theta2_rad)[0]))
    fits = fits & (signs == signs[0]).all(axis=0)
    if not fits.any():
        return path
    influence = np.where(fits[:, None], influence, 0.0)
    drag = influence[:, DRAG]
    batch = np.broadcast_shapes(path.flat_derivatives.shape[1:2], fits.shape)
    flat = np.broadcast_to(path.flat_derivatives, (len(path.time_s), *batch, 5, 2))
    sign = np.broadcast_to(signs[:1], flat.shape[:2])[:1]
    gravity = np.zeros((*flat.shape[:2], 3, 2))
    gravity[:, :, 0] = influence[:, GRAVITY]
    fits = np.broadcast_to(fits, batch).copy()
    drag = np.broadcast_to(drag, batch)
    if has_spring(robot):
        aside = np.zeros((len(flat), *batch, 2))
        free = motion_from_flat(flat, sign, robot, gravity).theta2
        for i in np.flatnonzero(fits):
            one = slice(i, i + 1)
            given = flat[:, one], free[:, one], gravity[0, one, 0], drag[one]
            found = hitched(path.time_s, *given, robot)
            fits[i] = found is not None
            aside[:, one] = 0.0 if found is None else found
    else:
        aside, settled = _with_balls(path.time_s, flat, sign, robot, gravity, drag)
        fits &= settled
    if not fits.any():
        return path
    done = _reference(
        path, flat, motion_from_flat(flat, sign, robot, _pull(gravity, aside, path.time_s))
    )
    return done if fits.all() else _where(fits, done, path)


def _least(vectors: FloatArray) -> FloatArray:
    """Least length (batch,) of vectors (n, batch, 2), and of what lies straight between them."""
    start, way = vectors[:-1], np.diff(vectors, axis=0)
    length = np.maximum(dot(way, way), np.finfo(float).tiny)
    nearest = start + np.clip(-dot(start, way) / length, 0.0, 1.0)[..., None] * way
    return np.asarray(np.hypot(nearest[..., 0], nearest[..., 1]).min(axis=0))


def _with_balls(
    time_s: FloatArray,
    flat: FloatArray,
    sign: FloatArray,
    robot: RobotParameters,
    gravity: FloatArray,
    drag: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """(n, batch, 2) k·d·n of balls that resist [m/s²], and of whom (batch,) it was found.

    What is tried depends on its own rate. Over short steps rounding grows from round to round,
    so that longer ones are taken then, of the same motion.
    """
    aside, left, stride = np.zeros((*flat.shape[:2], 2)), np.flatnonzero(drag), 1
    while left.size and len(time_s) // stride >= LEAST_SAMPLES:
        times = time_s[::stride]
        some, pulled = flat[::stride, left], gravity[::stride, left]
        pull, found = pulled, [np.zeros((*some.shape[:2], 2))]
        for _ in range(ROUNDS):
            motion = motion_from_flat(some, sign[:, left], robot, pull)
            found.append(_aside(some, motion, robot, drag[left]))
            pull = _pull(pulled, found[-1], times)
        settled = _settle(found, float(times[1] - times[0]))
        for i in np.flatnonzero(settled):
            one = found[-1][:, i]
            aside[:, left[i]] = one if stride == 1 else make_interp_spline(times, one, 5)(time_s)
        left, stride = left[~settled], 2 * stride
    return aside, ~np.isin(np.arange(len(drag)), left)


def _settle(found: list[FloatArray], step_s: float) -> BoolArray:
    """(batch,) whose rounds (n, batch, 2) come closer to each other, or differ by rounding only."""
    first, before, last = (np.abs(found[i] - found[i - 1]).max(axis=(0, 2)) for i in (1, -LATE, -1))
    closer = last < np.minimum(before, MOST_LEFT * first)
    rounding = ROUNDING_1_S2 * step_s**2 * np.abs(found[-1]).max(axis=(0, 2))
    return np.asarray(closer | (last <= rounding))


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
    across = trailer_axes(theta2 - robot.lean_rad)[1]
    velocity = flat[:, :, 1] + (robot.swing_length_m * rate)[..., None] * across
    held = held_back_moving(drag, velocity, theta2, rate, robot)
    return np.asarray(held[..., None] * across)


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
