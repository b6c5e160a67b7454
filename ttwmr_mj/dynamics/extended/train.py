"""The extended model (`dynamics.extended.one_trailer`) with several trailers.

What is taken off the motion of the ideal robot is the same. The trailers obey the equations of
`dynamics.train`; the rolling balls add to first moments b and inertias A, and gravity does not pull
them. Where P is faster than the wheels' setpoints say by δ, along the tractor's heading t1, that
comes at once with the wheels' acceleration and gives the trailers a kick κ,

    Σ_j A_ij·cos Δ_ij·κ_j = b_i·δ·t1·n_i

The state is x, y, θ1, θ2, …, and the swing rates θ̇_i − κ_i. Every hitch has the damping and the dry
friction of the parameters. The robot is one for all simulations.
"""

from __future__ import annotations

from functools import lru_cache, reduce
from typing import NamedTuple

import numpy as np

from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel, Motion
from ttwmr_mj.dynamics.floor.balls import Forces, held_back, slowing, train_drag
from ttwmr_mj.dynamics.hybrid import sideways
from ttwmr_mj.dynamics.kinematics import Value, to_world
from ttwmr_mj.dynamics.train import (
    Constants,
    accelerations_of,
    apart,
    constants,
    links,
    on_trailers,
    solve,
)
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray


class _Chain(NamedTuple):
    """A robot's trailers, (n,) each: what they are without their balls, and what 1 kg adds."""

    along_kg_m: FloatArray  # first moments along the trailers and to their left
    aside_kg_m: FloatArray
    inertia_kg_m2: FloatArray
    reach_m: FloatArray
    ball_along_m: FloatArray
    ball_inertia_m2: FloatArray


class ExtendedTrain(ExtendedModel):
    """The equations of motion of two trailers or more; attributes as of `ExtendedModel`."""

    __slots__ = ()

    def rate(
        self, state: FloatArray, wheels: FloatArray, wheels_rate: FloatArray, lead_s: FloatArray
    ) -> FloatArray:
        """The state's rates (3 + 2n, nsim), without dry friction; arguments as of the base."""
        theta1, (theta, swing_rate) = state[THETA1], self._trailers(state)
        angle = theta - theta1[:, None]
        pull = self.ground.pull(theta1)
        ideal = Motion(*self.twist(wheels), *self.twist(wheels_rate), angle, swing_rate, pull)
        push = self._push(ideal, self._accelerations(ideal))
        u1, u2 = self.twist(wheels + lead_s * wheels_rate + self._shortfall(push, wheels_rate))
        faster = (u1 - ideal.u1)[:, None]
        train = self._carried
        matrix, moment = self._matrix(angle, train), train.moment_kg_m
        one, zero = np.ones((1, 1)), np.zeros((1, 1))
        kick = solve(matrix, moment * sideways(angle - train.lean_rad, one, zero))
        rates = swing_rate + faster * kick
        turning = self._accelerations(ideal._replace(u1=u1, u2=u2, trailer_rate=rates))
        # less the kick's own change with the angles
        rising = -moment * np.cos(angle - train.lean_rad) * (rates - u2[:, None])
        spread = rates[:, :, None] - rates[:, None, :]
        turned = train.size_kg_m2 * np.sin(apart(angle, train)) * spread
        rising += np.add.accumulate(turned * kick[:, None, :], axis=-1)[..., -1]
        turning = turning - faster * solve(matrix, rising)
        velocity = to_world(theta1, u1, -self.values["slip_time_s"] * u1 * u2)
        return np.concatenate([np.stack([*velocity, u2]), rates.T, turning.T])

    def yielding(self, state: FloatArray) -> FloatArray:
        """See the base class."""
        angle = self._trailers(state)[0] - state[THETA1][:, None]
        inverse = np.linalg.inv(self._matrix(angle, self._carried))
        between = np.eye(self._count) - np.eye(self._count, k=-1)  # of rates: the hitches' own
        return np.asarray(between @ inverse @ between.T)

    def _trailers(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angles and swing rates, (nsim, n) each."""
        last = THETA2 + len(self.robot.trailers)
        return state[THETA2:last].T, state[last:].T

    @property
    def _carried(self) -> Constants:
        """What `dynamics.train` takes, with the rolling balls: (nsim or 1, n, …)."""
        chain, balls = _chain(self.robot), np.reshape(self._balls, (-1, 1))
        along = chain.along_kg_m + balls * chain.ball_along_m
        moment = np.hypot(along, chain.aside_kg_m)
        lean = np.arctan2(chain.aside_kg_m, along)
        inertia = chain.inertia_kg_m2 + balls * chain.ball_inertia_m2
        above = np.triu(chain.reach_m[:, None] * moment[:, None, :], 1)
        size = above + above.swapaxes(1, 2) + inertia[:, :, None] * np.eye(inertia.shape[1])
        turned = np.triu(np.repeat(lean[:, None, :], lean.shape[1], axis=1), 1)
        return Constants(moment, lean, size, turned - turned.swapaxes(1, 2))

    @staticmethod
    def _matrix(angle: FloatArray, train: Constants) -> FloatArray:
        return np.asarray(train.size_kg_m2 * np.cos(apart(angle, train)))

    @property
    def _drags(self) -> tuple[Forces, ...]:
        """What holds back the balls of every trailer."""
        lever, weight = self.values["rolling_resistance_m"], self.ground.normal_gravity_m_s2
        return tuple(held_back(self.robot, lever, weight, i) for i in range(self._count))

    @property
    def _count(self) -> int:
        return len(self.robot.trailers)

    def _torques(self, motion: Motion) -> FloatArray:
        """(nsim, n) torques of springs and dampers on the trailer behind each hitch [N·m]."""
        hitches = np.diff(motion.hitch, axis=1, prepend=0.0)
        rates = np.diff(motion.trailer_rate, axis=1, prepend=motion.u2[:, None])
        stiffness = np.array([hitch.stiffness_n_m_rad for hitch in self.robot.hitches])
        damping = np.reshape(self.values["hitch_damping_n_m_s_rad"], (-1, 1))
        return np.asarray(-stiffness * hitches - damping * rates)

    def _accelerations(self, motion: Motion) -> FloatArray:
        """(nsim, n) θ̈2, θ̈3, … under springs, dampers and rolling balls."""
        acceleration = np.stack(self._p_acceleration(motion), axis=-1)
        own = constants(self.robot)
        pull = (np.reshape(part, (-1, 1)) for part in motion.pull)
        torque = -own.moment_kg_m * sideways(motion.hitch - own.lean_rad, *pull)
        torque = torque + on_trailers(self._torques(motion))
        torque = torque + self._dragged(motion)[1]
        rates = motion.trailer_rate
        return accelerations_of(self._carried, motion.hitch, rates, acceleration, torque)

    def _dragged(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Force of all balls on P along the tractor (nsim,), torques on the trailers (nsim, n)."""
        rest = self.robot, self._drags, self.fading_m_s
        return train_drag(motion.hitch, motion.trailer_rate, motion.u1, *rest)

    @property
    def _slowing(self) -> Value:
        """Of the trailer whose balls slow each other most."""
        trailers = zip(self._drags, self.robot.trailers, strict=True)
        each = [slowing(f, one.com_offset_m, one.swing_inertia_kg_m2) for f, one in trailers]
        return np.asarray(reduce(np.maximum, each))

    def _push(self, motion: Motion, swing: FloatArray) -> FloatArray:
        """(nsim, 2) force of each wheel on the floor (right, left) [N]."""
        own = constants(self.robot)
        swung = motion.hitch - own.lean_rad
        turning = np.sin(swung) * swing + np.cos(swung) * motion.trailer_rate**2
        towed = _along(own.moment_kg_m * turning) - self._dragged(motion)[0]
        return self._on_wheels(motion, towed, self._torques(motion)[:, 0])


def extended_model(robot: RobotParameters) -> type[ExtendedModel]:
    """The model for as many trailers as the robot has."""
    return ExtendedTrain if len(robot.trailers) > 1 else ExtendedModel


def with_hitches(robot: RobotParameters, damping_n_m_s_rad: float) -> RobotParameters:
    """The robot with this damping in every hitch."""
    update = {"damping_n_m_s_rad": damping_n_m_s_rad}
    hitches = tuple(hitch.model_copy(update=update) for hitch in robot.hitches)
    return robot.model_copy(update={"hitches": hitches})


@lru_cache(maxsize=16)
def _chain(robot: RobotParameters) -> _Chain:
    chain, trailers = links(robot), robot.trailers
    moment, lean, inertia, reach = (np.array(part) for part in zip(*chain, strict=True))
    behind = np.arange(len(trailers))[::-1]  # as many, each with balls
    length = np.array([trailer.com_offset_m for trailer in trailers])
    lever = length**2 + robot.casters.trailer_half_spacing_m**2
    return _Chain(
        moment * np.cos(lean),
        moment * np.sin(lean),
        inertia,
        reach,
        length + behind * reach,
        lever + behind * reach**2,
    )


def _along(terms: FloatArray) -> FloatArray:
    """(...) of terms (..., n), added in the same order whatever the batch."""
    return np.asarray(np.add.accumulate(terms, axis=-1)[..., -1])
