"""What the laws share that plan before the run, and again when they have learned something."""

from abc import abstractmethod
from typing import TypeVar

import numpy as np

from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.shared.observer import Observed
from ttwmr_mj.controllers.shared.steering import SteeringLaw, SteeringOptions
from ttwmr_mj.controllers.shared.tracking_problem import UNKNOWN
from ttwmr_mj.references.shared.carried import carried
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import FloatArray

FIRST_LESSON_S = 1.0  # a plan is made anew after this time, twice this time, four times, …
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
        first = round(FIRST_LESSON_S / self._period)
        self._lessons = {first * 2**i for i in range(16)} if self._learns else set()

    @abstractmethod
    def _plan(self, path: ReferencePath, passes: int = 0) -> None:
        """Plan along a path under the influences `_planned`."""

    def _since_plan(self, k: int, now: Observed) -> int:
        """Sample k, counted from the plan's start; plans anew first where it is time."""
        if k in self._lessons:
            self._planned_at, self._influence_planned = k, now.influence
            self._planned = self._as_disturbance(now.influence)
            self._plan(carried(self._path.after(k), self._robot, now.influence), PASSES)
        return k - self._planned_at

    def _disturbance(self, now: Observed) -> FloatArray:
        """(nsim, width) what is taken to last."""
        parts = [now.slip, now.unexplained[:, None]]
        return np.concatenate([*parts, now.influence] if self._learns else parts, axis=1)

    def _as_disturbance(self, influence: FloatArray) -> FloatArray:
        """(nsim, width) with what acts on the trailer, and nothing unknown."""
        unknown = np.zeros((len(influence), UNKNOWN))
        return np.concatenate([unknown, influence], axis=1) if self._learns else unknown
