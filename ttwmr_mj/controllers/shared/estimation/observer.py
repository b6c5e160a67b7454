"""Where the robot is now: from the measurement, however old and noisy, and the commands since.

The sampled hybrid model predicts, the measurement corrects what was predicted *for its own time*,
and the commands issued since are replayed. Beside the robot's state the observer learns what the
model leaves out, taken as slowly varying: slip, to which the tyres' creep adds up (of P ahead and
to the left, and of the heading), and an unexplained θ̈2 (hitch friction unlike the model's, a
trailer unlike Table I). With a `learning.Learner` it also finds out what acts on the trailer, and
how sure it is of that; the gains for the trailer are then the learner's.

Gains are those of a steady Kalman filter, and scalar chains suffice for it: x, y and θ1 with their
slip, and (θ2, θ̇2, unexplained θ̈2). Coupling between the chains, the trailer's swing under P's
acceleration, is in the prediction, which is common to all. The error of each chain converges as
the eigenvalues of A − L·C·A say (all inside the unit circle, by the Riccati equation's theorem, as
each chain is observable and driven by noise), while the model is right between samples.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from ttwmr_mj.controllers.shared.estimation.learning import Learner
from ttwmr_mj.controllers.shared.estimation.steady_kalman import ObserverOptions, chain_gains
from ttwmr_mj.dynamics.floor.influence import DRAG
from ttwmr_mj.dynamics.kinematics import (
    to_body,
    twist_from_wheels,
    wheels_from_twist,
    workspace_rate,
)
from ttwmr_mj.dynamics.latency import LatencyFinder
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import THETA1, THETA2, BoolArray, FloatArray, RobotState, wrap

MAX_DELAY = 32  # periods, about a second at 33 ms; an older measurement is ignored
# A camera's tracker finds its own latency; till then what is wrong with it looks like forces.
LEARN_AFTER_S = 0.7
PUSH = 1.5  # standard deviations: a greater surprise is a push, which does not last; 13 % of noise


class Observed(NamedTuple):
    """The observer's estimate at a sample."""

    body: FloatArray  # (nsim, 5) x, y, θ1, θ2, θ̇2
    wheels: FloatArray  # (nsim, 2) the servos' setpoints (right, left) [rad/s]
    slip: FloatArray  # (nsim, 3) of P ahead and to the left [m/s], of the heading [rad/s]
    unexplained: FloatArray  # (nsim,) θ̈2 that the model does not explain [rad/s²]
    influence: FloatArray  # (nsim, 5) what acts on the trailer, known or found out

    def where(self, who: BoolArray, other: Observed) -> Observed:
        """This for some of the simulations (nsim,), the other for the rest."""
        if who.all():
            return self
        return Observed(*(np.where(who, a.T, b.T).T for a, b in zip(self, other, strict=True)))


class Observer:
    """Filters and predicts, a batch at a time. Call `update` and `commanded` in turn."""

    def __init__(
        self,
        robot: RobotParameters,
        model: SampledModel,
        options: ObserverOptions,
        learner: Learner | None = None,
        ahead: int = 0,
        latency: LatencyFinder | None = None,
    ) -> None:
        """Set up; what is told is the state so many periods ahead, when the next command acts."""
        self._ahead, self.latency = ahead, latency
        self._updates, self._patience = 0, 0
        self._robot, self._model, self.learner = robot, model, learner
        self._gain = chain_gains(options, model.period_s)
        rate, angle = options.rate_std_rad_s, options.angle_std_rad
        self._push_rad, self._push_rad_s = PUSH * (angle + model.period_s * rate), PUSH * rate
        self._past: deque[Observed] = deque(maxlen=MAX_DELAY + 1)
        self._commands: deque[FloatArray] = deque(maxlen=MAX_DELAY)

    def update(self, estimate: Estimate) -> Observed:
        """The state now, after this sample's estimate."""
        past = self._past
        self._updates += 1
        if not past:
            past.append(self._first(estimate.state))
            if estimate.measurement_age_s is not None:
                self._patience = round(LEARN_AFTER_S / self._model.period_s)
            if self.latency is not None:
                self.latency.roll(past[0].wheels)
            for _ in range(self._ahead):  # until the first command, servos hold their speed
                self.commanded(past[0].wheels)
        # what is measured now precedes the state that the next command acts on
        delay = np.rint(self._age_s(estimate) / self._model.period_s).astype(np.int64)
        delay += self._ahead
        usable = estimate.valid & (delay < len(past))
        if usable.any():
            for back in range(int(delay[usable].max()), -1, -1):
                due = usable & (delay == back)
                if due.any():
                    past[-1 - back] = self._corrected(past[-1 - back], estimate.state, due)
                if back:  # not for who was corrected since: that would be lost
                    replayed = self._predicted(past[-1 - back], self._commands[-back])
                    past[-back] = replayed.where(usable & (delay >= back), past[-back])
        return past[-1]

    def commanded(self, wheels: FloatArray) -> Observed:
        """Take note of the command for the coming period; returns the state expected after it."""
        now = self._past[-1]
        if self.learner is not None and self._updates > self._patience:
            velocity = self._model.velocity(now.body, now.wheels, now.slip)
            change_rad_s = np.abs(wheels - now.wheels).max(axis=1)
            self.learner.predict(now.body, velocity, self.hitch_rate(now), change_rad_s)
        if self.latency is not None:
            self.latency.commanded(wheels)
        self._past.append(self._predicted(now, wheels))
        self._commands.append(wheels)
        return self._past[-1]

    def _age_s(self, estimate: Estimate) -> FloatArray:
        """(nsim,) age of the estimate, with the latency that was found out."""
        if self.latency is None:
            return estimate.age_s
        now_s = (self.latency.periods - self._ahead) * self._model.period_s
        stamp_s = now_s - estimate.age_s
        self.latency.measured(stamp_s, estimate.state.q, estimate.valid)
        self._start_again(self.latency.changed)
        return np.maximum(estimate.age_s + self.latency.extra_s, 0.0)

    def _start_again(self, who: BoolArray) -> None:
        """Unlearn what seemed to act on the trailer while measurements were put at wrong times."""
        if self.learner is None or not who.any():
            return
        self.learner.restart(who)
        for i, was in enumerate(self._past):
            known = np.broadcast_to(self._model.influence, was.influence.shape)
            fresh = was._replace(unexplained=np.zeros_like(was.unexplained), influence=known)
            self._past[i] = fresh.where(who, was)

    def hitch_rate(self, now: Observed) -> FloatArray:
        """(nsim,) θ̇2 − θ̇1, the heading's slip included [rad/s]."""
        return now.body[:, 4] - rolling_turn_rate(now.wheels, self._robot) - now.slip[:, 2]

    def _first(self, state: RobotState) -> Observed:
        twist = workspace_rate(state.q, state.q_rate)[..., :2]
        return Observed(
            body=np.concatenate([state.q, state.q_rate[:, THETA2:]], axis=1),
            wheels=wheels_from_twist(twist, self._robot),
            slip=np.zeros((state.nsim, 3)),
            unexplained=np.zeros(state.nsim),
            influence=np.tile(self._model.influence, (state.nsim, 1)),
        )

    def _predicted(self, now: Observed, command: FloatArray) -> Observed:
        body, wheels = self._model.advance(
            now.body,
            now.wheels,
            command,
            slip=now.slip,
            unexplained=now.unexplained,
            influence=None if self.learner is None else now.influence,
        )
        if self.learner is None:
            return now._replace(body=body, wheels=wheels)
        faded = now.unexplained * self.learner.fade
        return now._replace(body=body, wheels=wheels, unexplained=faded)

    def _corrected(self, now: Observed, measured: RobotState, due: BoolArray) -> Observed:
        """Correct the simulations that are due."""
        body, slip = now.body.copy(), now.slip.copy()
        q_rate = np.empty_like(measured.q_rate)
        q_rate[:, :2] = self._model.velocity(body, now.wheels, slip)
        q_rate[:, THETA1] = rolling_turn_rate(now.wheels, self._robot) + slip[:, 2]
        q_rate[:, THETA2] = body[:, 4]
        # innovations, (nsim, 4) like q and its rate
        miss, drift = measured.q - body[:, :4], measured.q_rate - q_rate
        miss[:, THETA1:] = wrap(miss[:, THETA1:])
        miss, drift = miss * due[:, None], drift * due[:, None]
        value, slope, change = self._gain
        body[:, :4] += value[0] * miss + value[1] * drift
        slopes = slope[0] * miss + slope[1] * drift
        ahead, left = to_body(now.body[:, THETA1], slopes[:, 0], slopes[:, 1])
        slip += np.stack([ahead, left, slopes[:, THETA1]], axis=1)
        body[:, 4] += slopes[:, THETA2]
        # cut, not left out: an unexplained θ̈2 that is wrong must be able to come back
        cut = np.clip(miss[:, THETA2], -self._push_rad, self._push_rad)
        cut_rate = np.clip(drift[:, THETA2], -self._push_rad_s, self._push_rad_s)
        if self.learner is None or self._updates <= self._patience:
            more = change[0, THETA2] * cut + change[1, THETA2] * cut_rate
            return Observed(body, now.wheels, slip, now.unexplained + more, now.influence)
        gain = self.learner.gain(due)
        seen = np.stack([miss[:, THETA2], drift[:, THETA2]], axis=1)
        body[:, 3:] = now.body[:, 3:] + (gain[:, :2] @ seen[..., None])[..., 0]
        slowly = (gain[:, 2:] @ np.stack([cut, cut_rate], axis=1)[..., None])[..., 0]
        influence = now.influence + slowly[:, 1:]
        influence[:, DRAG:] = np.maximum(influence[:, DRAG:], 0.0)  # nothing drives the trailer
        return Observed(body, now.wheels, slip, now.unexplained + slowly[:, 0], influence)


def rolling_turn_rate(wheels: FloatArray, robot: RobotParameters) -> FloatArray:
    """(...) turn rate u2 of rolling wheels (Eq. 9) [rad/s]."""
    return twist_from_wheels(wheels, robot)[..., 1]
