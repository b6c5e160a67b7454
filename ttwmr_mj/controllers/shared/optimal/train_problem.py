"""Tracking a feasible reference with a train, as `tracking_problem` does with one trailer.

State (5 + 2n): x, y, θ1, θ2, …, θ̇2, … and the servos' setpoints (right, left). The residuals are

    ((F − F_ref)/position, (θ1 − θ1_ref)/angle, …, (Δω − Δω_ref)/change),

F the last trailer's centre of oscillation. A disturbance is slip (3) and an unexplained θ̈ of every
trailer.
"""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.shared.optimal.tracking_problem import INPUTS, STEP, Linear, Target
from ttwmr_mj.controllers.shared.optimal.tracking_problem import TrackingWeights as Weights
from ttwmr_mj.dynamics.flatness import trailer_axes, trailer_point
from ttwmr_mj.dynamics.kinematics import arcs_between, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.sampled.train import SLIP, SampledTrain
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, wrap


class TrainProblem:
    """Dynamics, residuals and their derivatives.

    Attributes:
        states, residuals: numbers of a state and of a residual.
        angles: where the angles are in a state.
        width, lasting: numbers of a disturbance, all of which the linear problem knows.
        residual_by_command: (residuals, 2) derivative of r by the command, everywhere.
    """

    def __init__(self, robot: RobotParameters, model: SampledTrain, weights: Weights) -> None:
        self._robot, self._model = robot, model
        n = model.trailers
        self._body = 3 + 2 * n
        self.states, self.residuals, self.width = self._body + INPUTS, 5 + n, SLIP + n
        self.lasting = self.width
        self.angles = slice(2, 3 + n)
        reach = [trailer.next_hitch_offset_m or 0.0 for trailer in robot.trailers]
        self._lengths = [*reach[:-1], robot.trailers[-1].swing_length_m]
        change = 1.0 / weights.change_scale_rad_s
        position, angle = 1.0 / weights.position_scale_m, 1.0 / weights.angle_scale_rad
        self._scale = np.array([position, position, *[angle] * (1 + n), change, change])
        self.residual_by_command = np.zeros((self.residuals, INPUTS))
        self.residual_by_command[-INPUTS:] = change * np.eye(INPUTS)

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
        """(..., 2) F of states."""
        last = self._robot.trailers[-1]
        return trailer_point(state, self._robot, last.swing_length_m, last.lean_rad)

    def next_state(
        self, state: FloatArray, command: FloatArray, disturbance: FloatArray
    ) -> FloatArray:
        """(..., states) one period later, under a constant disturbance (..., width)."""
        body, wheels = state[..., : self._body], state[..., self._body :]
        slip, unexplained = disturbance[..., :SLIP], disturbance[..., SLIP:]
        after = self._model.advance(body, wheels, command, slip, unexplained)
        return np.concatenate(after, axis=-1)

    def within_limits(self, state: FloatArray, wish: FloatArray) -> FloatArray:
        """(..., 2) desired speeds, clipped to what the servos reach from a state in one period."""
        return self._model.within_limits(state[..., self._body :], wish)

    def residual(
        self, state: FloatArray, command: FloatArray, target: Target, k: int | slice
    ) -> FloatArray:
        """(..., residuals) r at samples k of the target."""
        aim = target.state[k]
        change = command - state[..., self._body :]
        wanted = target.command[k] - aim[..., self._body :]
        off = wrap(state[..., self.angles] - aim[..., self.angles])
        miss = [self.centre(state) - target.centre[k], off, change - wanted]
        return np.asarray(self._scale * np.concatenate(miss, axis=-1))

    def residual_by_state(self, state: FloatArray) -> FloatArray:
        """(..., residuals, states) derivative of r by the state."""
        J = np.zeros((*state.shape[:-1], self.residuals, self.states))
        angles = np.arange(2, 3 + self._model.trailers)
        J[..., [0, 1], [0, 1]] = 1.0
        J[..., angles, angles] = 1.0
        leans = [*[0.0] * (len(self._lengths) - 1), self._robot.trailers[-1].lean_rad]
        for i, (length, lean) in enumerate(zip(self._lengths, leans, strict=True), start=3):
            J[..., :2, i] = -length * trailer_axes(state[..., i] - lean)[1]
        J[..., [-2, -1], [-2, -1]] = -1.0
        return np.asarray(self._scale[:, None] * J)

    def linearise(self, state: FloatArray, command: FloatArray, disturbance: FloatArray) -> Linear:
        """Derivatives of the next state, by central differences, all samples at once."""
        disturbance = np.broadcast_to(disturbance, (*state.shape[:-1], self.width))
        given = np.concatenate([state, command, disturbance], axis=-1)
        count, parts = given.shape[-1], [self.states, self.states + INPUTS]
        moved = given[..., None, :] + STEP * np.concatenate([np.eye(count), -np.eye(count)])
        after = self.next_state(*np.split(moved, parts, axis=-1))
        slope = (after[..., :count, :] - after[..., count:, :]) / (2.0 * STEP)
        return Linear(*np.split(np.swapaxes(slope, -1, -2), parts, axis=-1))
