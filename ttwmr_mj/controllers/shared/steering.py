"""What the laws that steer the trailer share: friction, observer, and the servos' limits."""

from typing import TypeVar

import numpy as np

from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.controllers.shared.friction import FrictionOptions, HitchFriction
from ttwmr_mj.controllers.shared.observer import Observed, Observer, ObserverOptions
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S, NEAR_STANDSTILL_M_S
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.sampled import SampledModel
from ttwmr_mj.state import FloatArray


class SteeringOptions(ControllerOptions):
    """Options of every law that steers the trailer."""

    friction: FrictionOptions = FrictionOptions()
    observer: ObserverOptions = ObserverOptions()


OptionsT = TypeVar("OptionsT", bound=SteeringOptions)


class SteeringLaw(Law[OptionsT]):
    """A law on the observer's state."""

    def start(self, task: Task) -> None:
        """Set up the assumed hitch, the sampled model and the observer."""
        self._nsim, self._period = task.nsim, task.sampling_time_s
        self._friction = HitchFriction(task.robot, self._options.friction)
        self._robot = self._friction.believed
        self._model = SampledModel(self._robot, self._period)
        self._observer = Observer(self._robot, self._model, self._options.observer)

    def _possible(self, wish: FloatArray, now: Observed) -> Command:
        """The command closest to the desired one (nsim, 2) [rad/s]; the observer takes note of it.

        A wish at a limit counts as saturated: who optimises within the limits asks for no more.
        """
        wheels = self._model.within_limits(now.wheels, wish)
        outward = wish + np.copysign(CUT_RAD_S, wish - now.wheels)
        cut = np.abs(self._model.within_limits(now.wheels, outward) - outward).max(axis=1) > 0.0
        speed = twist_from_wheels(wheels, self._robot)[:, 0]
        self._observer.commanded(wheels)
        near_singular = np.asarray(np.abs(speed) < NEAR_STANDSTILL_M_S)
        return Command(wheels, saturated=np.asarray(cut), near_singular=near_singular)
