"""Forces that disturb the robot, with random start and direction where the scenario says so."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ttwmr_mj.plants.model.names import trailer_part
from ttwmr_mj.runs.build import generators
from ttwmr_mj.scenario.schema import PushOptions, Scenario
from ttwmr_mj.state import FloatArray


class Push(NamedTuple):
    """A push with the values drawn for each simulation."""

    on: str  # "tractor" or "trailer"
    start_s: FloatArray  # (nsim,)
    duration_s: FloatArray  # (nsim,)
    force_n: FloatArray  # (nsim, 2) x, y in the world
    trailer: int = 1  # which, from the front

    @classmethod
    def of_scenario(cls, scenario: Scenario, nsim: int = 1) -> tuple[Push, ...]:
        """A scenario's pushes as its seed draws them, whatever the batch."""
        rng = generators(scenario.seed, ("pushes",))["pushes"]
        return cls.drawn(scenario.plant.pushes, rng.spawn(nsim))

    @classmethod
    def beside(cls, drawn: Sequence[tuple[Push, ...]]) -> tuple[Push, ...]:
        """Pushes of several batches as those of one; as many, on the same halves."""
        return tuple(
            same[0]._replace(
                start_s=np.concatenate([push.start_s for push in same]),
                duration_s=np.concatenate([push.duration_s for push in same]),
                force_n=np.concatenate([push.force_n for push in same]),
            )
            for same in zip(*drawn, strict=True)
        )

    @classmethod
    def drawn(
        cls, pushes: tuple[PushOptions, ...], rngs: list[np.random.Generator]
    ) -> tuple[Push, ...]:
        """Pushes of simulations with these generators, in order."""
        chance = np.array([rng.random((len(pushes), 2)) for rng in rngs])
        return tuple(cls._of(push, *chance[:, i].T) for i, push in enumerate(pushes))

    @classmethod
    def _of(cls, push: PushOptions, delay: FloatArray, turn: FloatArray) -> Push:
        """One push; delay and turn (nsim,) are shares of the longest delay and of a full turn."""
        start_s = push.start_s + push.random_within_s * delay
        angle = 2.0 * np.pi * turn * push.random_direction
        (x, y), cos, sin = push.force_n, np.cos(angle), np.sin(angle)
        force = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        duration_s = np.full(start_s.shape, push.duration_s)
        return cls(push.on, start_s, duration_s, force, push.trailer)

    @property
    def body(self) -> str:
        """What is pushed, as `plants.model.names` has it."""
        return self.on if self.on == "tractor" else trailer_part("trailer", self.trailer - 1)

    def at(self, time_s: float) -> FloatArray:
        """(nsim, 2) force in the control period that starts now; zero where it does not act."""
        # a hair early, so that a start at a sample belongs to its period
        begun = self.start_s - 1e-9 <= time_s
        acts = begun & (time_s < self.start_s + self.duration_s - 1e-9)
        return np.asarray(self.force_n * acts[:, None])

    def told(self) -> dict[str, Any]:
        """For the manifest: the first simulation's values, as keys of a scenario."""
        start_s, force_n = float(self.start_s[0]), self.force_n[0].tolist()
        on = {"on": self.on, "trailer": self.trailer} if self.on == "trailer" else {"on": self.on}
        duration_s = float(self.duration_s[0])
        return {**on, "start_s": start_s, "duration_s": duration_s, "force_n": force_n}


def forces(pushes: tuple[Push, ...], time_s: float) -> dict[str, FloatArray]:
    """Body → (nsim, 2) sum of the pushes on it in the control period that starts now."""
    total: dict[str, FloatArray] = {}
    for push in pushes:
        total[push.body] = total.get(push.body, 0.0) + push.at(time_s)
    return total
