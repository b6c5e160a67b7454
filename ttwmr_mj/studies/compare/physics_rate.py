"""A contact run at every physics step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.state import ArrayFields, FloatArray, RobotState


@dataclass(frozen=True, slots=True, eq=False)
class PhysicsRate(ArrayFields):
    """A run of one simulation at its start and after each of n physics steps."""

    time_s: FloatArray  # (n + 1,) from zero
    q: FloatArray  # (n + 1, 4) as in `RobotState`
    q_rate: FloatArray  # (n + 1, 4)
    wheel_speed_rad_s: FloatArray  # (n + 1, 2) right, left
    inputs: FloatArray  # (n, 2) of the wheels' `Drive`s in the step that ends at time_s[1:]

    @classmethod
    def of(cls, plant: ContactPlant, start: RobotState, wheels_rad_s: FloatArray) -> PhysicsRate:
        """What a plant of one simulation has kept of a run from a start at wheel speeds (1, 2)."""
        time_s, states, wheels = plant.physics_rate_states()
        return cls(
            time_s=np.append(0.0, time_s),
            q=np.concatenate([start.q, states.q[0]]),
            q_rate=np.concatenate([start.q_rate, states.q_rate[0]]),
            wheel_speed_rad_s=np.concatenate([wheels_rad_s, wheels[0]]),
            inputs=plant.physics_rate_inputs()[0],
        )

    def stretches(self, every: int) -> tuple[Stretches, FloatArray]:
        """What the wheels did in each period of so many steps, linear from knot to knot.

        MuJoCo moves over a whole step at the speed of the step's end, which so is the speed of its
        middle: there are the knots. At the ends of periods the mean of two middles stands.

        Returns:
            The stretches (every + 1, periods), and the wheel speeds (periods + 1, 2) at the ends of
            periods.
        """
        wheels = self.wheel_speed_rad_s
        between = 0.5 * (wheels[every:-1:every] + wheels[every + 1 :: every])
        ends = np.concatenate([wheels[:1], between, wheels[-1:]])
        middles = wheels[1:].reshape(-1, every, 2).swapaxes(0, 1)
        knots = np.concatenate([ends[None, :-1], middles, ends[None, 1:]])
        duration_s = np.full(knots.shape[:2], self.time_s[1])[1:]
        duration_s[[0, -1]] *= 0.5
        rates = np.diff(knots, axis=0) / duration_s[..., None]
        return Stretches(duration_s, knots[:-1], rates, np.zeros_like(rates)), ends
