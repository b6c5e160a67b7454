"""A step of the extended model with dry friction in its hitches.

Friction keeps its direction until a hitch turns round, where its rate, taken as linear in time,
passes zero; the rest of the step starts from there. A hitch that turns round or rests is stuck as
long as the friction that holds all of them at once stays within its limit in the middle of what is
left of the step; a stuck hitch does not turn. Each such event costs an error of second order in
the step, and in proportion to the friction, so that little friction does as little as it should:
a fit comes from there. (`plants.swing` and `plants.train_swing` stop every hitch that turns round.)

A hitch's rate is that of the swing rates, with the tractor's by its wheels' setpoints.
"""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np

from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.kinematics import Value
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.dynamics.train import solve
from ttwmr_mj.state import THETA1, THETA2, BoolArray, FloatArray

# Projected Gauss-Seidel on who sticks: the error falls to a half in a sweep for two hitches of
# Table I's trailer, to nine tenths for five. It ends before where nothing changes any more, to the
# last bit, so that who else is in the batch does not matter.
SWEEPS = 60
AT_REST_RAD_S = 1e-12  # well above the rounding of wheel speeds from stretch to stretch


class Hitched(Protocol):
    """The equations of motion, for states (3 + 2n, nsim): x, y, θ1, θ2, … and the swing rates."""

    @property
    def values(self) -> dict[str, Value]:
        """Name of `ExtendedParameters` → number or (nsim,)."""

    def rows(self, which: BoolArray) -> Self:
        """The same of some simulations."""

    def rate(
        self, state: FloatArray, wheels: FloatArray, wheels_rate: FloatArray, lead_s: FloatArray
    ) -> FloatArray:
        """The state's rates without dry friction."""

    def twist(self, wheels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(u1, u2) (nsim,) of wheels (nsim, 2)."""

    def yielding(self, state: FloatArray) -> FloatArray:
        """(nsim or 1, n, n) each hitch's acceleration [rad/s²] per torque [N·m] in each."""


def dry_step(model: Hitched, state: FloatArray, stretch: Stretches) -> FloatArray:
    """The state (3 + 2n, nsim) after one stretch of each simulation (nsim,)."""
    count = (len(state) - 3) // 2
    return _step(model, state, stretch, np.zeros((state.shape[1], count), np.bool_), count)


def _step(
    model: Hitched, state: FloatArray, stretch: Stretches, turning: BoolArray, turns: int
) -> FloatArray:
    """The same, of hitches some of which (nsim, n) are turning round, and that may so often."""
    torque, stuck = _held(model, state, stretch, turning)
    state = _stopped(model, state, stretch, 0.0, stuck)
    end = _glide(model, state, stretch, torque, stuck)
    was, now = _sliding(model, state, stretch, 0.0), _sliding(model, end, stretch, 1.0)
    # friction is against the motion: who goes along with it has turned round
    turned = ~stuck & (now * np.sign(torque) > AT_REST_RAD_S)
    who = np.asarray(turned.any(axis=1))
    if not (turns and who.any()):
        return end
    fraction = np.where(turned, was / np.where(turned, was - now, 1.0), 1.0)[who]
    first = np.clip(fraction.min(axis=1), 0.0, 1.0)
    model, stretch = model.rows(who), stretch.where(who)
    part = stretch._replace(duration_s=first * stretch.duration_s)
    state = _glide(model, state[:, who], part, torque[who], stuck[who])
    rest = stretch._replace(
        duration_s=(1.0 - first) * stretch.duration_s,
        speed_rad_s=stretch.speed_rad_s + part.duration_s[:, None] * stretch.rate_rad_s2,
    )
    turning = turned[who] & (fraction <= first[:, None])
    end[:, who] = _step(model, state, rest, turning, turns - 1)
    return end


def _sliding(model: Hitched, state: FloatArray, stretch: Stretches, share: float) -> FloatArray:
    """(nsim, n) rates of the hitches [rad/s] after a share of the stretch."""
    turn = _turn(model, stretch, share)
    return np.diff(_swing_rates(state), axis=1, prepend=turn[:, None])


def _turn(model: Hitched, stretch: Stretches, share: float) -> FloatArray:
    """(nsim,) θ̇1 after a share of the stretch."""
    passed = share * stretch.duration_s[:, None]
    return model.twist(stretch.speed_rad_s + passed * stretch.rate_rad_s2)[1]


def _swing_rates(state: FloatArray) -> FloatArray:
    """(nsim, n)."""
    return state[(len(state) + 3) // 2 :].T


def _free(model: Hitched, rates: FloatArray, stretch: Stretches) -> FloatArray:
    """(nsim, n) accelerations of the hitches, of the state's rates."""
    turning = model.twist(stretch.rate_rad_s2)[1]
    return np.diff(_swing_rates(rates), axis=1, prepend=turning[:, None])


def _held(
    model: Hitched, state: FloatArray, stretch: Stretches, turning: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Dry friction's torque (nsim, n) on each hitch, and who is held by it."""
    sliding = _sliding(model, state, stretch, 0.0)
    friction = np.reshape(model.values["hitch_coulomb_friction_n_m"], (-1, 1))
    limit = np.broadcast_to(friction, sliding.shape)
    resting = (turning | (np.abs(sliding) <= AT_REST_RAD_S)) & (limit > 0.0)
    torque = np.where(resting, 0.0, -limit * np.sign(sliding))
    if not resting.any():
        return torque, resting
    middle, wheels = _rigidly(model, state, stretch)
    free = _free(model, model.rate(middle, wheels, *stretch[2:]), stretch)
    yielding = np.broadcast_to(model.yielding(middle), (*free.shape, free.shape[1]))
    for _ in range(SWEEPS):
        last = torque.copy()
        for i in range(free.shape[1]):
            swing = free[:, i] + _along(yielding[:, i] * torque)
            better = torque[:, i] - swing / yielding[:, i, i]
            better = np.minimum(np.maximum(better, -limit[:, i]), limit[:, i])
            torque[:, i] = np.where(resting[:, i], better, torque[:, i])
        if np.array_equal(last, torque):
            break
    return torque, resting & (np.abs(torque) < limit)


def _rigidly(
    model: Hitched, state: FloatArray, stretch: Stretches
) -> tuple[FloatArray, FloatArray]:
    """State and wheels (nsim, 2) in the middle of the stretch, if hitches kept their rates.

    At the start of a run the load is zero, and it grows within the step.
    """
    half_s, turn = 0.5 * stretch.duration_s, _turn(model, stretch, 0.0)
    later = _turn(model, stretch, 0.5)
    middle = state.copy()
    middle[THETA1 : (len(state) + 3) // 2] += half_s * 0.5 * (turn + later)
    middle[(len(state) + 3) // 2 :] += later - turn
    return middle, stretch.speed_rad_s + half_s[:, None] * stretch.rate_rad_s2


def _glide(
    model: Hitched, state: FloatArray, stretch: Stretches, torque: FloatArray, stuck: BoolArray
) -> FloatArray:
    """The state after a stretch in which friction (nsim, n) does not turn; who sticks rests."""
    duration_s, start, rate, lead_s = stretch
    change, count = duration_s[:, None] * rate, torque.shape[1]
    apart, one = ~(stuck[:, :, None] & stuck[:, None, :]), np.eye(count)
    sliding = np.where(stuck, 0.0, torque)

    def slope(share: float, now: FloatArray) -> FloatArray:
        rates = model.rate(now, start + share * change, rate, lead_s)
        yielding = model.yielding(now)
        slower = _along(yielding * sliding[:, None, :])
        if stuck.any():
            left = np.where(stuck, -slower - _free(model, rates, stretch), 0.0)
            holding = solve(np.where(apart, one, yielding), left)
            slower = slower + _along(yielding * holding[:, None, :])
        rates[-count:] += np.add.accumulate(slower, axis=1).T
        return rates

    end = _stopped(model, runge_kutta(slope, state, duration_s), stretch, 1.0, stuck)
    hitches = np.diff(end[THETA1 : THETA2 + count], axis=0)
    hitches = np.where(stuck.T, np.diff(state[THETA1 : THETA2 + count], axis=0), hitches)
    turned = end[THETA1] + np.add.accumulate(hitches)
    end[THETA2 : THETA2 + count] = np.where(_any(stuck, duration_s), turned, end[THETA2:-count])
    return end


def _stopped(
    model: Hitched, state: FloatArray, stretch: Stretches, share: float, who: BoolArray
) -> FloatArray:
    """The state after a share of the stretch with some hitches (nsim, n) exactly at rest."""
    turn, state, count = _turn(model, stretch, share), state.copy(), who.shape[1]
    sliding = np.where(who, 0.0, _sliding(model, state, stretch, share))
    slower = turn + np.add.accumulate(sliding.T)
    state[-count:] = np.where(_any(who, stretch.duration_s), slower, state[-count:])
    return state


def _any(who: BoolArray, duration_s: FloatArray) -> BoolArray:
    """(nsim,) whether a stretch lasts in which any hitch is one of them: others are not rounded."""
    return np.asarray(who.any(axis=1) & (duration_s > 0.0))


def _along(terms: FloatArray) -> FloatArray:
    """(...) of terms (..., n), added in the same order whatever the batch."""
    return np.asarray(np.add.accumulate(terms, axis=-1)[..., -1])
