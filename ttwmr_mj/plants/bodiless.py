"""What plants made of equations alone have in common: no joints, no contacts, nothing to push."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray, RobotState


class BodilessPlant(ABC):
    """The part of the `Plant` protocol that speaks of bodies.

    Attributes:
        nsim: simulations in the batch.
    """

    nsim: int

    @abstractmethod
    def state(self) -> RobotState:
        """The state now, as fresh arrays."""

    def push(self, forces_n: dict[str, FloatArray]) -> None:
        """Refused: the tractor's motion is prescribed, a force on it has no meaning here.

        Raises:
            InputError: always, if there is a force.
        """
        if forces_n:
            raise InputError.at("plant.pushes", "only plant.kind = 'contact' can be pushed")

    def joint_positions(self) -> FloatArray:
        """(nsim, 0): the model has no joints."""
        return np.empty((self.nsim, 0))

    def contact_readings(self) -> FloatArray:
        """(nsim, 0, 15): the model has no contacts."""
        return np.empty((self.nsim, 0, 15))

    def fault(self, index: int) -> str:
        """What broke in one failed simulation: there is one way to break."""
        return f"the state is not finite: {self.state().q[index].tolist()}"
