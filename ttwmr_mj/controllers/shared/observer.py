"""Where the robot is now: the measurement, however old and noisy, and the commands since.

The sampled hybrid model predicts, the measurement corrects what was predicted *for its own time*,
and the commands issued since are replayed. Beside the robot's state the observer learns what the
model leaves out, taken as slowly varying: the tyres' creep (of P ahead and to the left, and of the
heading) and an extra θ̈2 (hitch friction unlike the model's, a trailer unlike Table I).

Gains are those of a steady Kalman filter, and scalar chains suffice for it: position and creep,
heading and its creep, and (θ2, θ̇2, extra θ̈2). Coupling between the chains, the swing under P's
acceleration, is in the prediction, which is common to all. The error of each chain converges as
the eigenvalues of A − L·C·A say (all inside the unit circle, by the Riccati equation's theorem, as
each chain is observable and driven by noise), while the model is right between samples.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scipy.linalg import solve_discrete_are

from ttwmr_mj.dynamics.kinematics import twist_from_wheels, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.sampled import SampledModel
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import THETA1, THETA2, FloatArray, RobotState, wrap

MAX_DELAY = 32  # periods; a measurement older than that is ignored
MODEL_POSITION_STD_M = 2e-5  # prediction error of one period, beside creep
MODEL_ANGLE_STD_RAD = 1e-4
MODEL_RATE_STD_RAD_S = 3e-3
JOLT = 1.5  # standard deviations: what surprises more is a push, which does not last


class ObserverOptions(Config):
    """What the observer believes of its measurements and of the model's gaps.

    Standard deviations per sample, and of random walks per square root of a second. The defaults
    are those of an overhead camera; they cost little where the measurement is better than that.
    """

    position_std_m: float = Field(default=2e-4, gt=0, le=1, description="of a measured x or y")
    angle_std_rad: float = Field(default=1e-3, gt=0, le=1, description="of a measured angle")
    velocity_std_m_s: float = Field(default=0.01, gt=0, le=10, description="of ẋ, ẏ")
    rate_std_rad_s: float = Field(default=0.05, gt=0, le=100, description="of θ̇1, θ̇2")
    creep_walk_m_s: float = Field(
        default=2e-3, gt=0, le=10, description="how fast the tyres' creep may change, per √s"
    )
    turn_creep_walk_rad_s: float = Field(
        default=5e-3, gt=0, le=10, description="the same for the heading, per √s"
    )
    swing_walk_rad_s2: float = Field(
        default=0.05, gt=0, le=100, description="how fast an unknown θ̈2 may change, per √s"
    )


@dataclass(frozen=True, slots=True)
class Seen:
    """What the observer believes at a sample.

    Attributes:
        body: (nsim, 5) x, y, θ1, θ2, θ̇2.
        wheels: (nsim, 2) the servos' setpoints (right, left) [rad/s].
        slip: (nsim, 3) creep ahead and to the left [m/s] and of the heading [rad/s].
        swing: (nsim,) θ̈2 that the model does not explain [rad/s²].
    """

    body: FloatArray
    wheels: FloatArray
    slip: FloatArray
    swing: FloatArray


class Observer:
    """Filters and predicts, a batch at a time. Call `update` and `commanded` in turn."""

    def __init__(self, robot: RobotParameters, model: SampledModel, options: ObserverOptions):
        self._robot, self._model = robot, model
        T = model.period_s
        creep = np.array([[1.0, T], [0.0, 1.0]])
        swing = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
        position, angle = options.position_std_m, options.angle_std_rad
        velocity, rate = options.velocity_std_m_s, options.rate_std_rad_s
        root = np.sqrt(T)
        self._jolt_rad_s, self._jolt_rad = JOLT * rate, JOLT * (angle + T * rate)
        self._position_gain = kalman_gain(
            creep, (MODEL_POSITION_STD_M, options.creep_walk_m_s * root), (position, velocity)
        )
        self._heading_gain = kalman_gain(
            creep, (MODEL_ANGLE_STD_RAD, options.turn_creep_walk_rad_s * root), (angle, rate)
        )
        self._swing_gain = kalman_gain(
            swing,
            (MODEL_ANGLE_STD_RAD, MODEL_RATE_STD_RAD_S, options.swing_walk_rad_s2 * root),
            (angle, rate),
        )
        self._past: deque[Seen] = deque(maxlen=MAX_DELAY + 1)
        self._commands: deque[FloatArray] = deque(maxlen=MAX_DELAY)

    def update(self, estimate: Estimate) -> Seen:
        """The state now, after this sample's estimate."""
        if not self._past:
            self._past.append(self._first(estimate.state))
        delay = np.rint(estimate.age_s / self._model.period_s).astype(np.int64)
        usable = estimate.valid & (delay < len(self._past))
        if usable.any():
            oldest = int(delay[usable].max())
            for back in range(oldest, -1, -1):
                due = usable & (delay == back)
                if due.any():
                    self._past[-1 - back] = self._corrected(
                        self._past[-1 - back], estimate.state, due
                    )
                if back:
                    self._past[-back] = self._predicted(
                        self._past[-1 - back], self._commands[-back]
                    )
        return self._past[-1]

    def commanded(self, wheels: FloatArray) -> Seen:
        """Take note of the command for the coming period; returns the state expected after it."""
        self._past.append(self._predicted(self._past[-1], wheels))
        self._commands.append(wheels)
        return self._past[-1]

    def _first(self, state: RobotState) -> Seen:
        twist = workspace_rate(state.q, state.q_rate)[..., :2]
        return Seen(
            body=np.concatenate([state.q, state.q_rate[:, THETA2:]], axis=1),
            wheels=wheels_from_twist(twist, self._robot),
            slip=np.zeros((state.nsim, 3)),
            swing=np.zeros(state.nsim),
        )

    def _predicted(self, seen: Seen, command: FloatArray) -> Seen:
        body, wheels = self._model.advance(
            seen.body, seen.wheels, command, slip=seen.slip, swing=seen.swing
        )
        return Seen(body, wheels, seen.slip, seen.swing)

    def _corrected(self, seen: Seen, measured: RobotState, due: np.ndarray) -> Seen:
        """Correct the simulations that are due."""
        body, slip, swing = seen.body.copy(), seen.slip.copy(), seen.swing.copy()
        velocity = self._model.velocity(body, seen.wheels, slip)
        turn = wheels_turn(seen.wheels, self._robot) + slip[:, 2]
        place = (measured.q[:, :2] - body[:, :2]) * due[:, None]
        moving = (measured.q_rate[:, :2] - velocity) * due[:, None]
        heading = wrap(measured.q[:, THETA1] - body[:, 2]) * due
        turning = (measured.q_rate[:, THETA1] - turn) * due
        trailer = wrap(measured.q[:, THETA2] - body[:, 3]) * due
        swinging = (measured.q_rate[:, THETA2] - body[:, 4]) * due
        gain = self._position_gain
        cos, sin = np.cos(body[:, 2]), np.sin(body[:, 2])
        creep = gain[1, 0] * place + gain[1, 1] * moving
        body[:, :2] += gain[0, 0] * place + gain[0, 1] * moving
        slip[:, 0] += cos * creep[:, 0] + sin * creep[:, 1]
        slip[:, 1] += cos * creep[:, 1] - sin * creep[:, 0]
        gain = self._heading_gain
        body[:, 2] += gain[0, 0] * heading + gain[0, 1] * turning
        slip[:, 2] += gain[1, 0] * heading + gain[1, 1] * turning
        gain = self._swing_gain
        body[:, 3] += gain[0, 0] * trailer + gain[0, 1] * swinging
        body[:, 4] += gain[1, 0] * trailer + gain[1, 1] * swinging
        # cut, not left out: an unknown θ̈2 that is wrong must be able to come back
        trailer = np.clip(trailer, -self._jolt_rad, self._jolt_rad)
        swinging = np.clip(swinging, -self._jolt_rad_s, self._jolt_rad_s)
        swing += gain[2, 0] * trailer + gain[2, 1] * swinging
        return Seen(body, seen.wheels, slip, swing)


def wheels_turn(wheels: FloatArray, robot: RobotParameters) -> FloatArray:
    """(...) turn rate u2 of rolling wheels (Eq. 9) [rad/s]."""
    return twist_from_wheels(wheels, robot)[..., 1]


def kalman_gain(
    A: FloatArray, process_std: tuple[float, ...], measurement_std: tuple[float, ...]
) -> FloatArray:
    """(n, m) steady gain on the innovation of the first m states, all measured directly."""
    n, m = len(process_std), len(measurement_std)
    C = np.eye(m, n)
    Q, R = np.diag(np.square(process_std)), np.diag(np.square(measurement_std))
    P = solve_discrete_are(A.T, C.T, Q, R)
    return np.asarray(P @ C.T @ np.linalg.inv(C @ P @ C.T + R))
