"""Commands on their way to the servos: delayed, and sometimes lost."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.channel import Channel, LatencyQueue
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.scenario.schema import ControlOptions
from ttwmr_mj.state import FloatArray


class Actuation:
    """The channel from the controller to the servos, which hold the last command received.

    The command of sample k arrives at k·T + latency, plus whole periods of jitter. Until the first
    one arrives, the servos hold the speeds that they start with, or give no torque.
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
        self._torques = options.torque_input

    def drive(self, plant: Plant, command: FloatArray) -> None:
        """Advance the plant by one control period; the command (nsim, 2) is sent at its start."""
        if self._direct:
            plant.advance(command, self._steps)
            return
        if self._command is None:
            self._command = 0.0 * command if self._torques else plant.wheel_speed_rad_s()
            self._queue.exchange(self._command)  # the queue's first stands in for what is due
        arrived = self._queue.exchange(np.array(command)).sent
        if self._held_steps:
            plant.advance(self._command, self._held_steps)
        each = range(len(arrived))
        self._command = np.array([self._queue.item(int(arrived[i]))[i] for i in each])
        plant.advance(self._command, self._steps - self._held_steps)
