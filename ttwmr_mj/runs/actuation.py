"""From the controller's commands to the servos: late, and some never."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.channel import Channel, LatencyQueue
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.scenario.schema import ControlOptions
from ttwmr_mj.state import FloatArray


class Actuation:
    """The way of commands to a plant; servos hold the last command that has arrived.

    A command of sample k arrives at k·T + latency, and whole periods of jitter later. Until the
    first one, servos hold the speeds that they start with.
    """

    def __init__(
        self, options: ControlOptions, steps_per_period: int, rngs: list[np.random.Generator]
    ) -> None:
        """Set up.

        Args:
            options: latency, jitter and drops of commands.
            steps_per_period: the plant's steps in a control period.
            rngs: one per simulation.
        """
        period_s, self._steps = options.sampling_time_s, steps_per_period
        late = round(options.command_latency_s / period_s * steps_per_period)
        latency, self._held_steps = divmod(late, steps_per_period)
        jitter = round(options.command_jitter_s / period_s)
        channel = Channel(latency, jitter, options.command_drop_probability)
        self._queue = LatencyQueue[FloatArray](channel, rngs)
        self._direct = not (late or channel.is_random)
        self._command: FloatArray | None = None

    def drive(self, plant: Plant, wheel_speed_rad_s: FloatArray) -> None:
        """Let a plant pass one control period, at whose start this is commanded (nsim, 2)."""
        if self._direct:
            plant.advance(wheel_speed_rad_s, self._steps)
            return
        if self._command is None:
            self._command = plant.wheel_speed_rad_s()
            self._queue.exchange(self._command)  # the queue's first stands in for what is due
        arrived = self._queue.exchange(np.array(wheel_speed_rad_s)).sent
        if self._held_steps:
            plant.advance(self._command, self._held_steps)
        each = range(len(arrived))
        self._command = np.array([self._queue.item(int(arrived[i]))[i] for i in each])
        plant.advance(self._command, self._steps - self._held_steps)
