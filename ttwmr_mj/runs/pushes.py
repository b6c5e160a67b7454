"""Forces that disturb the robot: when and whither, where that is left to chance."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ttwmr_mj.runs.build import generators
from ttwmr_mj.scenario.schema import PushOptions, Scenario
from ttwmr_mj.state import FloatArray


class Push(NamedTuple):
    """A push as it happens to each simulation."""

    on: str  # "tractor" or "trailer"
    start_s: FloatArray  # (nsim,)
    duration_s: float
    force_n: FloatArray  # (nsim, 2) x, y in the world

    @classmethod
    def of_scenario(cls, scenario: Scenario, nsim: int = 1) -> tuple[Push, ...]:
        """A scenario's pushes as its seed draws them, whatever the batch."""
        rng = generators(scenario.seed, ("pushes",))["pushes"]
        return cls.drawn(scenario.plant.pushes, rng.spawn(nsim))

    @classmethod
    def drawn(
        cls, pushes: tuple[PushOptions, ...], rngs: list[np.random.Generator]
    ) -> tuple[Push, ...]:
        """Pushes of simulations with these generators, in order."""
        chance = np.array([rng.random((len(pushes), 2)) for rng in rngs])
        return tuple(cls._of(push, *chance[:, i].T) for i, push in enumerate(pushes))

    @classmethod
    def _of(cls, push: PushOptions, delay: FloatArray, turn: FloatArray) -> Push:
        """One push with shares (nsim,) of the time it may wait and of a whole turn."""
        start_s = push.start_s + push.random_within_s * delay
        angle = 2.0 * np.pi * turn * push.random_direction
        (x, y), cos, sin = push.force_n, np.cos(angle), np.sin(angle)
        force = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return cls(push.on, start_s, push.duration_s, force)

    def at(self, time_s: float) -> FloatArray:
        """(nsim, 2) force in the control period that starts now; zero where it does not act."""
        # a hair early, so that a start at a sample belongs to its period
        begun = self.start_s - 1e-9 <= time_s
        acts = begun & (time_s < self.start_s + self.duration_s - 1e-9)
        return np.asarray(self.force_n * acts[:, None])

    def told(self) -> dict[str, Any]:
        """For the manifest: of the first simulation, as a scenario without chance says it."""
        start_s, force_n = float(self.start_s[0]), self.force_n[0].tolist()
        start = {"on": self.on, "start_s": start_s, "duration_s": self.duration_s}
        return {**start, "force_n": force_n}


def forces(pushes: tuple[Push, ...], time_s: float) -> dict[str, FloatArray]:
    """Half → (nsim, 2) sum of the pushes on it in the control period that starts now."""
    total: dict[str, FloatArray] = {}
    for push in pushes:
        total[push.on] = total.get(push.on, 0.0) + push.at(time_s)
    return total
