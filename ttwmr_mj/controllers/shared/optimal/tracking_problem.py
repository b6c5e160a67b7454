"""Tracking a feasible reference as a least-squares problem on the sampled hybrid model.

State (7): x, y, θ1, θ2, θ̇2 and the servos' setpoints (right, left). Input (2): the next command.
Stage cost ½|r|² with the residuals

    r = ((F − F_ref)/position, (θ1 − θ1_ref)/angle, (θ2 − θ2_ref)/angle, (Δω − Δω_ref)/change),

where F is the trailer's centre of oscillation, Δω the change of the command, and position, angle
and change are scales: an error of one scale costs as much as any other. The angles' scale is wide;
they are there to keep the robot on the reference's branch, F and the commands say the rest.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from pydantic import Field

from ttwmr_mj.dynamics.flatness import point_behind
from ttwmr_mj.dynamics.floor.influence import DRY, INFLUENCES
from ttwmr_mj.dynamics.kinematics import arcs_between, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.sampled.one_trailer import BODY, SLIP, SampledModel
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.state import FloatArray, wrap

STATES, INPUTS, RESIDUALS = 7, 2, 6
UNKNOWN = SLIP + 1  # slip, and the unexplained θ̈2
# Where the law learns, what acts on the trailer is part of the disturbance, and differentiated but
# for the hitch's friction, which is stiff (`friction`).
LEARNED, SMOOTH = UNKNOWN + INFLUENCES, UNKNOWN + DRY
STEP = 1e-5  # of the central differences: error of order 1e-10


class TrackingWeights(Config):
    """Scales of the tracking errors: an error of one scale costs 1, whichever error it is."""

    position_scale_m: float = Field(
        default=0.01,
        ge=1e-12,
        le=10,
        description="error of the trailer's centre of oscillation that costs 1; typically 0.01",
    )
    angle_scale_rad: float = Field(
        default=0.2, ge=1e-12, le=100, description="error of θ1 or θ2 that costs 1; typically 0.2"
    )
    change_scale_rad_s: float = Field(
        default=0.5,
        ge=1e-12,
        le=1e3,
        description="change of a wheel command in one period that costs 1; typically 0.5",
    )


class Target(NamedTuple):
    """A reference as states and commands at its samples."""

    state: FloatArray  # (n, batch, 7)
    command: FloatArray  # (n − 1, batch, 2), mean wheel speeds of each period
    centre: FloatArray  # (n, batch, 2) F

    def between(self, start: int, end: int) -> Target:
        """From one sample to another, both included."""
        state, centre = (values[start : end + 1] for values in (self.state, self.centre))
        return Target(state, self.command[start:end], centre)


class Linear(NamedTuple):
    """The problem to first order along a trajectory; leading axes (n, batch)."""

    A: FloatArray  # (..., 7, 7)
    B: FloatArray  # (..., 7, 2)
    D: FloatArray  # (..., 7, lasting) by slip, unexplained θ̈2 and, where it is learned, gravity, c


class Problem(Protocol):
    """What Gauss-Newton needs to know, of one trailer or of a train.

    Attributes:
        states, residuals: numbers of a state and of a residual.
        angles: where the angles are in a state.
        width, lasting: numbers of a disturbance, and of those that the linear problem knows.
        residual_by_command: (residuals, 2) derivative of r by the command, everywhere.
    """

    states: int
    residuals: int
    angles: slice
    width: int
    lasting: int
    residual_by_command: FloatArray

    def target(self, reference: ReferencePath) -> Target:
        """The reference's states, and the commands that follow it best without feedback."""

    def centre(self, state: FloatArray) -> FloatArray:
        """(..., 2) F of states."""

    def next_state(
        self, state: FloatArray, command: FloatArray, disturbance: FloatArray
    ) -> FloatArray:
        """(..., states) one period later, under a constant disturbance (..., width)."""

    def within_limits(self, state: FloatArray, wish: FloatArray) -> FloatArray:
        """(..., 2) desired speeds, clipped to what the servos reach from a state in one period."""

    def residual(
        self, state: FloatArray, command: FloatArray, target: Target, k: int | slice
    ) -> FloatArray:
        """(..., residuals) r at samples k of the target."""

    def residual_by_state(self, state: FloatArray) -> FloatArray:
        """(..., residuals, states) derivative of r by the state."""

    def linearise(self, state: FloatArray, command: FloatArray, disturbance: FloatArray) -> Linear:
        """Derivatives of the next state, all samples at once."""


class TrackingProblem:
    """Dynamics, residuals and their derivatives.

    Attributes:
        states, residuals: numbers of a state and of a residual.
        angles: where the angles are in a state.
        residual_by_command: (6, 2) derivative of r by the command, everywhere.
        width: numbers of a disturbance: slip (3), unexplained θ̈2 and, with a law that learns, the
            five of `dynamics.floor.influence`.
        lasting: how many of these the linear problem knows.
    """

    states, residuals, angles = STATES, RESIDUALS, slice(2, 4)

    def __init__(
        self,
        robot: RobotParameters,
        model: SampledModel,
        weights: TrackingWeights,
        *,
        learns: bool = False,
    ) -> None:
        self.width, self.lasting = (LEARNED, SMOOTH) if learns else (UNKNOWN, UNKNOWN)
        self._robot, self._model, self._length = robot, model, robot.swing_length_m
        position, angle = 1.0 / weights.position_scale_m, 1.0 / weights.angle_scale_rad
        change = 1.0 / weights.change_scale_rad_s
        self._scale = np.array([position, position, angle, angle, change, change])
        self.residual_by_command = np.zeros((RESIDUALS, INPUTS))
        self.residual_by_command[[4, 5], [0, 1]] = change

    def target(self, reference: ReferencePath) -> Target:
        """The reference's states, and the commands that follow it best without feedback."""
        q, rate = reference.q, reference.q_rate
        motion = arcs_between(q[:, :, :2], q[:, :, 2]) / self._model.period_s
        command = wheels_from_twist(motion, self._robot)
        first = wheels_from_twist(workspace_rate(q[0], rate[0])[..., :2], self._robot)
        wheels = np.concatenate([first[None], command])
        state = np.concatenate([q, rate[..., 3:], wheels], axis=-1)
        return Target(state, command, self.centre(state))

    def centre(self, state: FloatArray) -> FloatArray:
        """(..., 2) F of states (..., 7)."""
        return point_behind(state, self._length, self._robot.lean_rad)

    def next_state(
        self, state: FloatArray, command: FloatArray, disturbance: FloatArray
    ) -> FloatArray:
        """(..., 7) states one period later, under a constant disturbance (..., width)."""
        slip, unexplained = disturbance[..., :SLIP], disturbance[..., SLIP]
        body, wheels = self._model.advance(
            state[..., :BODY],
            state[..., BODY:],
            command,
            slip=slip,
            unexplained=unexplained,
            influence=disturbance[..., UNKNOWN:] if self.width > UNKNOWN else None,
        )
        return np.concatenate([body, wheels], axis=-1)

    def within_limits(self, state: FloatArray, wish: FloatArray) -> FloatArray:
        """(..., 2) desired speeds, clipped to what the servos reach from a state in one period."""
        return self._model.within_limits(state[..., BODY:], wish)

    def residual(
        self, state: FloatArray, command: FloatArray, target: Target, k: int | slice
    ) -> FloatArray:
        """(..., 6) r at samples k of the target."""
        aim = target.state[k]
        miss = np.concatenate(
            [
                self.centre(state) - target.centre[k],
                wrap(state[..., 2:4] - aim[..., 2:4]),
                (command - state[..., BODY:]) - (target.command[k] - aim[..., BODY:]),
            ],
            axis=-1,
        )
        return np.asarray(self._scale * miss)

    def residual_by_state(self, state: FloatArray) -> FloatArray:
        """(..., 6, 7) derivative of r by the state."""
        J = np.zeros((*state.shape[:-1], RESIDUALS, STATES))
        J[..., [0, 1, 2, 3], [0, 1, 2, 3]] = 1.0
        J[..., 0, 3] = self._length * np.sin(state[..., 3])
        J[..., 1, 3] = -self._length * np.cos(state[..., 3])
        J[..., [4, 5], [5, 6]] = -1.0
        return np.asarray(self._scale[:, None] * J)

    def linearise(self, state: FloatArray, command: FloatArray, disturbance: FloatArray) -> Linear:
        """Derivatives of the next state, by central differences, all samples at once.

        Args:
            state: (..., 7).
            command: (..., 2).
            disturbance: (..., width), or what broadcasts to it.
        """
        disturbance = np.broadcast_to(disturbance, (*state.shape[:-1], self.width))
        given = np.concatenate([state, command, disturbance], axis=-1)
        count = STATES + INPUTS + self.lasting
        steps = STEP * np.eye(count, given.shape[-1])
        moved = given[..., None, :] + np.concatenate([steps, -steps])
        after = self.next_state(*np.split(moved, [STATES, STATES + INPUTS], axis=-1))
        slope = (after[..., :count, :] - after[..., count:, :]) / (2.0 * STEP)
        slope = np.swapaxes(slope, -1, -2)
        return Linear(*np.split(slope, [STATES, STATES + INPUTS], axis=-1))
