"""Feedforward: the wheel speeds of the reference, and no look at where the robot is.

The do-nothing baseline. Over each period the wheels turn by what takes P and the heading from one
sample of the reference to the next along an arc (Eq. 8-9), as if no error there ever were. What a
law with feedback is worth shows against it.
"""

from typing import ClassVar, Literal

import numpy as np

from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.dynamics.kinematics import arcs_between, wheels_from_twist
from ttwmr_mj.dynamics.servo import limit_speed
from ttwmr_mj.sensing import Estimate


class Feedforward(Law["FeedforwardOptions"]):
    """The law above, within the servo's range."""

    def start(self, task: Task) -> None:
        """Compute all commands."""
        path = task.path_ahead
        motion = arcs_between(path.position_m, path.theta1_rad) / task.sampling_time_s
        wish = wheels_from_twist(motion, task.robot)
        self._command = np.broadcast_to(
            limit_speed(wish, task.robot.servo), (len(wish), task.nsim, 2)
        )
        self._saturated = np.broadcast_to(
            np.any(self._command != wish, axis=-1), (len(wish), task.nsim)
        )

    def command(self, k: int, estimate: Estimate) -> Command:
        """The command for period k."""
        del estimate
        clear = np.zeros(self._saturated.shape[1], dtype=np.bool_)
        return Command(self._command[k].copy(), self._saturated[k].copy(), near_singular=clear)


class FeedforwardOptions(ControllerOptions):
    """The reference's wheel speeds without feedback: the do-nothing baseline."""

    law = Feedforward
    takes_stacks: ClassVar[bool] = True
    kind: Literal["feedforward"] = "feedforward"
