"""Wheel speeds from a list, whatever the robot does."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.config import column, each
from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.robot import Config
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray


class WheelSegment(Config):
    """Constant wheel speeds for a while."""

    duration_s: float = Field(
        ge=1e-12, le=3600, description="duration of the segment; typically 1 to 10"
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
        self._ends, self._speeds = each(_schedule, self._options)
        limit = column(task.robot.servo.speed_limit_rad_s)
        self._saturated = np.abs(self._speeds).max(axis=-1) > limit
        self._period = task.sampling_time_s
        self._each = np.arange(task.nsim)

    def command(self, k: int, estimate: Estimate) -> Command:
        """The segment's wheel speeds for every simulation; the estimate is not used."""
        del estimate
        # a hair beyond k·T, so that an end at a sample belongs to the next segment
        i = (self._ends <= (k + 1e-9) * self._period).sum(axis=-1)
        nsim, segments = self._each.size, self._speeds.shape[-2]
        wheels = np.broadcast_to(self._speeds, (nsim, segments, 2))[self._each, i]
        saturated = np.broadcast_to(self._saturated, (nsim, segments))[self._each, i]
        return Command(wheels, saturated, near_singular=np.zeros(nsim, dtype=np.bool_))


def _schedule(options: OpenLoopOptions) -> tuple[FloatArray, FloatArray]:
    """Ends (n,) [s] of the segments, and wheel speeds (n + 1, 2) in them and after."""
    segments = options.segments
    speeds = [[s.wheel_right_rad_s, s.wheel_left_rad_s] for s in segments]
    return np.cumsum([s.duration_s for s in segments]), np.array([*speeds, [0.0, 0.0]])


class OpenLoopOptions(ControllerOptions):
    """Segments of constant wheel speed, then standstill."""

    law = OpenLoop
    takes_stacks: ClassVar[bool] = True
    tows_trains: ClassVar[bool] = True
    kind: Literal["open_loop"] = "open_loop"
    needs_reference: ClassVar[bool] = False
    segments: Annotated[
        tuple[WheelSegment, ...], Field(strict=False, min_length=1, max_length=10_000)
    ] = Field(description="the segments, driven one after the other")
