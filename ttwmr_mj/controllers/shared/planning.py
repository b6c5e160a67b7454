"""What the laws share that plan before the run, and again when they have learned something."""

from abc import abstractmethod
from typing import TypeVar

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Task, undefined_theta2
from ttwmr_mj.controllers.shared.estimation.observer import Observed
from ttwmr_mj.controllers.shared.optimal.gauss_newton import DISTURBANCE_TIME_S, decay
from ttwmr_mj.controllers.shared.optimal.tracking_problem import UNKNOWN, TrackingWeights
from ttwmr_mj.controllers.shared.steering import SteeringLaw, SteeringOptions
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.carried import carried
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.state import FloatArray

# A plan is made anew after 1, 2, 4 and 8 s, and every 8 s from then on; it reaches as far as it is
# used and 5 s more, by when gains no longer know of its end (they forget in a second).
FIRST_LESSON_S, LESSON_EVERY_S, BEYOND_S = 1.0, 8.0, 5.0
PASSES = 2  # of Gauss-Newton on a plan that starts from one nearly as good

OptionsT = TypeVar("OptionsT", bound=SteeringOptions)


class PlanningLaw(SteeringLaw[OptionsT]):
    """A law about a plan: the reference, made exact for the sampled robot."""

    def start(self, task: Task) -> None:
        """Nothing learned yet: the plan is made for what is believed."""
        super().start(task)
        self._path, self._planned_at = task.path_ahead, 0
        self._learns = self._observer.learner is not None
        self._influence_planned: FloatArray = self._model.influence[None]
        self._planned: FloatArray = self._as_disturbance(self._influence_planned)
        first, self._every, beyond = (
            max(1, round(s / self._period)) for s in (FIRST_LESSON_S, LESSON_EVERY_S, BEYOND_S)
        )
        self._early = {first, 2 * first, 4 * first}
        self._reach = self._every + beyond

    @abstractmethod
    def _plan(self, path: ReferencePath, passes: int = 0) -> None:
        """Plan along a path under the influences `_planned`."""

    def _since_plan(self, k: int, now: Observed) -> int:
        """Sample k, counted from the plan's start; plans anew first where it is time."""
        if self._learns and (k in self._early or (k > 0 and k % self._every == 0)):
            self._planned_at, self._influence_planned = k, now.influence
            self._planned = self._as_disturbance(now.influence)
            ahead = self._path.after(k).until(self._reach + 1)
            self._plan(carried(ahead, self._robot, now.influence), PASSES)
        return k - self._planned_at

    def _disturbance(self, now: Observed) -> FloatArray:
        """(nsim, width) what is taken to last."""
        parts = [now.slip, now.unexplained[:, None]]
        return np.concatenate([*parts, now.influence] if self._learns else parts, axis=1)

    def _as_disturbance(self, influence: FloatArray) -> FloatArray:
        """(nsim, width) with what acts on the trailer, and nothing unknown."""
        unknown = np.zeros((len(influence), UNKNOWN))
        return np.concatenate([unknown, influence], axis=1) if self._learns else unknown


class TrackingOptions(SteeringOptions):
    """Options of laws that weigh tracking errors along any feasible reference."""

    weights: TrackingWeights = TrackingWeights()
    disturbance_time_s: float = Field(
        default=DISTURBANCE_TIME_S,
        ge=1e-12,
        le=1e4,
        description="time constant with which slip and an unexplained θ̈2 are assumed to "
        "decay; typically 10",
    )

    def decay(self, period_s: float, lasting: int) -> FloatArray:
        """(lasting,) factors by which disturbances fall in a period; what is learned lasts."""
        return decay(self.disturbance_time_s, period_s, lasting)

    def path_faults(self, reference: Reference, path: ReferencePath) -> list[Fault]:
        """Steering the trailer needs θ2 everywhere."""
        undefined = ~np.isfinite(path.theta).all(axis=(1, 2))
        if not undefined.any():
            return []
        return [
            undefined_theta2(
                reference,
                f"at {path.time_s[undefined][0]:g} s; controller.kind = {self.kind!r} steers the "
                "trailer and needs θ2 everywhere",
                "a circle with theta2 = 'outward', 'flat_circle' and 'planned' have it",
            )
        ]
