"""Plants side by side as one, where their equations do not take the numbers of every simulation."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.base import EquationPlant, Plant
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

Who = NDArray[np.intp]  # simulations, by their place in the batch


class SideBySide(EquationPlant):
    """Some simulations on one plant, some on another; nothing else is seen of it."""

    def __init__(self, parts: Sequence[tuple[Plant, Who]]) -> None:
        """Join plants of one kind; together they have every simulation once."""
        self._parts = parts
        self._places = np.argsort(np.concatenate([who for _, who in parts]))
        self.nsim = self._places.size
        self.time_step_s = parts[0][0].time_step_s

    def reset(self, initial: RobotState) -> None:
        """See `Plant`."""
        for plant, who in self._parts:
            plant.reset(RobotState(initial.q[who], initial.q_rate[who]))

    def state(self) -> RobotState:
        """See `Plant`."""
        states = [plant.state() for plant, _ in self._parts]
        q, q_rate = ([getattr(state, name) for state in states] for name in ("q", "q_rate"))
        return RobotState(self._joined(q), self._joined(q_rate))

    def wheel_speed_rad_s(self) -> FloatArray:
        """See `Plant`."""
        return self._joined([plant.wheel_speed_rad_s() for plant, _ in self._parts])

    def encoder_angle_rad(self) -> FloatArray:
        """See `Plant`."""
        return self._joined([plant.encoder_angle_rad() for plant, _ in self._parts])

    def advance(self, command: FloatArray, steps: int) -> None:
        """See `Plant`."""
        for plant, who in self._parts:
            plant.advance(command[who], steps)

    def failed(self) -> BoolArray:
        """See `Plant`."""
        return np.concatenate([plant.failed() for plant, _ in self._parts])[self._places]

    def fault(self, index: int) -> str:
        """See `Plant`."""
        plant, who = next(part for part in self._parts if index in part[1])
        return plant.fault(int(np.flatnonzero(who == index)[0]))

    def _joined(self, parts: list[FloatArray]) -> FloatArray:
        return np.concatenate(parts)[self._places]
