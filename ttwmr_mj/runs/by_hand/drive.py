"""A person drives: hands set the twist while the physics keeps to the clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.controllers.open_loop import OpenLoopOptions, WheelSegment
from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.errors import InputError
from ttwmr_mj.runs.by_hand.hands import Hands
from ttwmr_mj.runs.closed_loop.pace import LIVE_REPORT_EVERY_S, Pace
from ttwmr_mj.runs.execute import Run, run_experiment
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from ttwmr_mj.recording.stream.live import LiveView

SPEED_SHARE = 0.8  # of the servo's speed limit, straight ahead: the rest is left for turning
TURN_SHARE = 0.4  # of it, turning on the spot
Tell = Callable[[str], None]


class ByHand(Controller):
    """The wheel speeds of the twist that a person's hands ask for."""

    def __init__(self, hands: Hands) -> None:
        self._hands = hands

    def start(self, task: Task) -> None:
        """See how fast the robot is."""
        self._robot, self._nsim = task.robot, task.nsim
        self._limit = task.robot.servo.speed_limit_rad_s
        unit = wheels_from_twist(np.eye(2), self._robot)  # of 1 m/s, and of 1 rad/s
        self._fastest = np.array([SPEED_SHARE, TURN_SHARE]) * self._limit / np.abs(unit).max(axis=1)

    @property
    def twist(self) -> FloatArray:
        """(2,) speed of P ahead [m/s] and turn rate [rad/s] that are asked for."""
        return np.asarray(self._fastest * [self._hands.forward, self._hands.turn])

    def command(self, k: int, estimate: Estimate) -> Command:
        """The same for every simulation; slower on the same curve where a wheel is at its limit."""
        del k, estimate
        wheels = wheels_from_twist(self.twist, self._robot)
        wheels = wheels / max(1.0, float(np.abs(wheels).max()) / self._limit)
        wheels = np.clip(wheels, -self._limit, self._limit)  # rounding
        return self.plain(np.tile(wheels, (self._nsim, 1)))


@dataclass(slots=True)
class HandPace(Pace):
    """Real time, until the hands end it."""

    hands: Hands | None = None
    tell: Callable[[float], None] | None = None

    def hold(self, time_s: float) -> bool:
        """Wait until the sample is due, and see what the hands have done meanwhile."""
        Pace.hold(self, time_s)
        assert self.hands is not None
        self.hands.look()
        if self.tell is not None:
            self.tell(time_s)
        return not self.hands.ended or time_s == 0.0  # a run has a first sample


def drive_scenario(
    scenario: Scenario,
    hands: Hands,
    folder: Path,
    *,
    longest_s: float,
    speed: float = 1.0,
    command_line: list[str] | None = None,
    live: LiveView | None = None,
    tell: Tell | None = None,
) -> Run:
    """Drive a scenario's robot by hand and write a run folder.

    The folder's scenario.resolved.toml replays the run: its open_loop controller gives the wheel
    speeds that were driven, sample by sample.

    Args:
        scenario: robot, plant, start and reference; its controller does not matter.
        hands: ready.
        folder: an existing folder for the files.
        longest_s: the run ends then at the latest.
        speed: simulated seconds per second.
        command_line: for the manifest.
        live: shows the recording while it is written.
        tell: called now and then with the state in words.

    Raises:
        InputError: this scenario cannot be driven by wheel speeds.
    """
    if scenario.control.inner_loop != "velocity_servo":
        got = repr(scenario.control.inner_loop)
        raise InputError.at("control.inner_loop", got=got, allowed="'velocity_servo', to drive")
    law = ByHand(hands)
    still = WheelSegment(duration_s=longest_s, wheel_right_rad_s=0.0, wheel_left_rad_s=0.0)
    open_ended = _by(scenario, (still,), longest_s)

    def show(time_s: float) -> None:
        if tell is not None:
            ahead, turn = law.twist
            tell(f"{time_s:6.1f} s  {ahead:+.3f} m/s  {turn:+.2f} rad/s")

    pace = HandPace(speed, LIVE_REPORT_EVERY_S, hands=hands, tell=show)
    return run_experiment(
        Experiment(open_ended, controller=law),
        folder,
        command_line=command_line,
        live=live,
        pace=pace,
        replayed=lambda result: _by(scenario, *_driven(result)),
    )


def _driven(result: Result) -> tuple[tuple[WheelSegment, ...], float]:
    """The segments that were driven, and the run's duration [s]."""
    rows, period_s = result.trajectory, result.scenario.control.sampling_time_s
    wheels = np.nan_to_num(rows.wheel_command_rad_s[:, 0]).tolist()
    segments = tuple(
        WheelSegment(
            duration_s=sum(1 for _ in same) * period_s,
            wheel_right_rad_s=right,
            wheel_left_rad_s=left,
        )
        for (right, left), same in groupby(wheels)
    )
    return segments, max(len(rows) - 1, 1) * period_s


def _by(scenario: Scenario, segments: tuple[WheelSegment, ...], duration_s: float) -> Scenario:
    """The scenario under these wheel speeds."""
    told = {
        "controller": OpenLoopOptions(segments=segments),
        "duration_s": duration_s,
        "description": f"Driven by hand in {scenario.name}",
    }
    return scenario.model_copy(update=told)
