"""What the closed loop asks of a plant: a state, and time that advances under a command."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import BoolArray, FloatArray, RobotState


class Plant(Protocol):
    """A batch of robots that obey wheel-speed commands.

    Attributes:
        nsim: simulations in the batch.
        time_step_s: the step in which the plant counts time.
    """

    nsim: int
    time_step_s: float

    def reset(self, initial: RobotState) -> None:
        """Put every robot at rest or in motion as `initial` says, servos at that wheel speed."""
        ...

    def state(self) -> RobotState:
        """The true state now, as fresh arrays."""
        ...

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) true wheel speeds (right, left)."""
        ...

    def advance(self, wheel_command_rad_s: FloatArray, steps: int) -> None:
        """Hold the commanded wheel speeds (nsim, 2) (right, left) for a number of steps."""
        ...

    def push(self, forces_n: dict[str, FloatArray]) -> None:
        """From now on, push "tractor" or "trailer" with forces (2,) or (nsim, 2), world frame."""
        ...

    def joint_positions(self) -> FloatArray:
        """(nsim, nq) MuJoCo's generalized positions; nq = 0 where there is no such thing."""
        ...

    def contact_readings(self) -> FloatArray:
        """(nsim, ncontact, 15) contact sensors; ncontact = 0 where there are no contacts."""
        ...

    def failed(self) -> BoolArray:
        """(nsim,) simulations whose physics broke."""
        ...

    def fault(self, index: int) -> str:
        """What broke in one failed simulation, in words."""
        ...


class BodilessPlant(ABC):
    """What plants made of equations have in common: no joints, no contacts, nothing to push.

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
