"""Wheel speeds from a list, whatever the robot does."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.robot import Config
from ttwmr_mj.sensing import Estimate


class WheelSegment(Config):
    """Constant wheel speeds for a while."""

    duration_s: float = Field(
        gt=0, le=3600, description="duration of the segment; typically 1 to 10"
    )
    wheel_right_rad_s: float = Field(
        ge=-1e3,
        le=1e3,
        description="speed of the right wheel, positive forward; a lab servo reaches 6.5, a "
        "fast one 40",
    )
    wheel_left_rad_s: float = Field(
        ge=-1e3,
        le=1e3,
        description="speed of the left wheel, positive forward; a lab servo reaches 6.5, a "
        "fast one 40",
    )


class OpenLoop(Law["OpenLoopOptions"]):
    """Segments of constant wheel speed, one after the other, then standstill.

    A segment is in force at every sample that falls into it; its ends are not moved to samples.
    """

    def start(self, task: Task) -> None:
        """Lay the segments out in time and flag what the servo will cut."""
        segments = self._options.segments
        self._ends = np.cumsum([segment.duration_s for segment in segments])
        speeds = [[s.wheel_right_rad_s, s.wheel_left_rad_s] for s in segments]
        self._speeds = np.array([*speeds, [0.0, 0.0]])
        self._saturated = np.abs(self._speeds).max(axis=1) > task.robot.servo.speed_limit_rad_s
        self._period = task.sampling_time_s
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        """The segment's wheel speeds for every simulation; the estimate is not used."""
        del estimate
        # a hair beyond k·T, so that an end at a sample belongs to the next segment
        i = int(np.searchsorted(self._ends, (k + 1e-9) * self._period, side="right"))
        wheels = np.tile(self._speeds[i], (self._nsim, 1))
        never = np.zeros(self._nsim, dtype=np.bool_)
        return Command(wheels, saturated=never | self._saturated[i], near_singular=never)


class OpenLoopOptions(ControllerOptions):
    """Segments of constant wheel speed, then standstill."""

    law = OpenLoop
    kind: Literal["open_loop"] = "open_loop"
    needs_reference: ClassVar[bool] = False
    segments: Annotated[tuple[WheelSegment, ...], Field(strict=False, min_length=1)] = Field(
        description="the segments, driven one after the other"
    )
