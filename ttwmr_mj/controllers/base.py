"""What a controller is: told the task once, asked for wheel speeds every period."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Task:
    """What a controller may know before the run.

    Attributes:
        robot: every number of the robot.
        reference: sampled at k·sampling_time_s, with samples beyond the end of the run to look
            ahead; None in open-loop experiments.
        sampling_time_s: the control period T.
        nsim: simulations in the batch.
        rng: the controller's own random numbers.
    """

    robot: RobotParameters
    reference: ReferencePath | None
    sampling_time_s: float
    nsim: int
    rng: np.random.Generator


@dataclass(frozen=True, slots=True)
class Command:
    """Wheel speeds for the coming period.

    Attributes:
        wheel_speed_rad_s: (nsim, 2) (ω_r, ω_l).
        saturated: (nsim,) the wish was cut to what the servo can do.
        near_singular: (nsim,) the map to wheel speeds was near its singularity, standstill.
    """

    wheel_speed_rad_s: FloatArray
    saturated: BoolArray
    near_singular: BoolArray


class Controller(ABC):
    """A control law. Subclass it, or name your own subclass in a scenario as `module:Class`."""

    @abstractmethod
    def start(self, task: Task) -> None:
        """Prepare for a run and forget the last one."""

    @abstractmethod
    def command(self, k: int, estimate: Estimate) -> Command:
        """Wheel speeds from sample k (time k·T) until the next."""

    @staticmethod
    def plain(wheel_speed_rad_s: FloatArray) -> Command:
        """A command without flags, for laws that speak in wheel speeds themselves."""
        clear = np.zeros(wheel_speed_rad_s.shape[0], dtype=np.bool_)
        return Command(wheel_speed_rad_s, saturated=clear, near_singular=clear)
