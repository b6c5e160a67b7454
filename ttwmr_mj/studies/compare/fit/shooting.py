"""A run of the extended model and its derivatives by the parameters, all of its time at once.

The wheels are known, so every stretch of time (`plants.extended_steps`) can be made before the
stretch before it is, from a guess of where that ends. All stretches, each from states and with
parameters that are a little different, are one batch; finite differences of it are the derivatives
A and B of every stretch z' = F(z, p). Multiple shooting: Newton's method closes the gaps between
the stretches, and the chain rule gives the derivatives of the run,

    δ' = A·δ + (F(z, p) − z'),    S' = A·S + B,    S = dz/dp

A gap that is closed quadratically needs few rounds, and those of numpy are as many as for one
stretch, where marching from stretch to stretch costs them once for every stretch.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.plants.extended_steps import Clock, Stretch, cut, rolling_setpoint, step
from ttwmr_mj.state import FloatArray, RobotState
from ttwmr_mj.studies.compare.motion import ContactRun

STATES = 5  # x, y, θ1, θ2, swing rate
DIFFERENCE = 1e-6  # of θ1, θ2 [rad] and the swing rate [rad/s]
CLOSED = 1e-9  # a correction after which the next would be of its square
MAX_ROUNDS = 8


class Shooting:
    """The commands of one contact run under varying parameters.

    The first guess is what contact physics did, every later one the run before.
    """

    def __init__(self, run: ContactRun, differences: dict[str, float], max_step_s: float) -> None:
        """Take what does not depend on the parameters.

        Args:
            run: on contact physics.
            differences: name of every parameter → by how much it is varied.
            max_step_s: Runge-Kutta's.
        """
        scenario = run.scenario
        self._run, self._robot = run, run.robot
        self._period_s = scenario.control.sampling_time_s
        self._clock = Clock(scenario.plant.contact.timestep_s, max_step_s)
        self._names, self._differences = list(differences), np.array(list(differences.values()))
        self._guess: FloatArray | None = None  # (stretches + 1, STATES)

    def run(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The run with parameters (p,) in the order of the differences.

        Returns:
            q (periods + 1, 4) and its derivatives (periods + 1, 4, p), by differences.
        """
        columns = np.vstack([values, values + np.diag(self._differences)])
        stretches, ends = self._cut(columns)
        guess = self._guess
        if guess is None or len(guess) != len(stretches.duration_s) + 1:
            guess = self._contact_physics(stretches)
        for _ in range(MAX_ROUNDS):
            correction, slope = self._newton(columns, stretches, guess)
            guess = guess + correction
            if np.abs(correction).max() < CLOSED:  # false also where it is not finite
                break
        else:  # dry friction can be too rough for it
            guess = self._march(values, stretches)
            slope = self._newton(columns, stretches, guess)[1]
        self._guess = guess
        samples = np.append(0, ends)
        return guess[samples, :4], slope[samples, :4]

    def _cut(self, columns: FloatArray) -> tuple[Stretch, NDArray[np.intp]]:
        """Stretches (n, p + 1) of every column of parameters, and where the periods end."""
        start = RobotState(
            *(
                np.tile(part, (len(columns), 1))
                for part in (self._run.start.q, self._run.start.q_rate)
            )
        )
        setpoint = rolling_setpoint(self._model(columns), start)
        commands = self._run.commands[:, None]
        return cut(setpoint, commands, self._period_s, self._clock, self._robot.servo)

    def _contact_physics(self, stretches: Stretch) -> FloatArray:
        """(n + 1, STATES) of contact physics at the stretches' ends."""
        physics, time_s = self._run.physics, np.append(0.0, np.cumsum(stretches.duration_s[:, 0]))
        columns = [*physics.q.T, physics.q_rate[:, 3]]
        return np.stack([np.interp(time_s, physics.time_s, column) for column in columns], axis=-1)

    def _model(self, values: FloatArray) -> ExtendedModel:
        """The model with parameters (nsim, p)."""
        return ExtendedModel(self._robot, dict(zip(self._names, values.T, strict=True)))

    def _march(self, values: FloatArray, stretches: Stretch) -> FloatArray:
        """(n + 1, STATES) stretch after stretch."""
        model = self._model(values[None])
        q, swing = self._run.start.q, self._run.start.q_rate[:, 3]
        states = [np.append(q, swing)]
        for parts in zip(*stretches, strict=True):
            q, swing = step(model, q, swing, Stretch(*(part[:1] for part in parts)))
            states.append(np.append(q, swing))
        return np.array(states)

    def _newton(
        self, columns: FloatArray, stretches: Stretch, guess: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Correction (n + 1, STATES) of a guess, and the derivatives (n + 1, STATES, p)."""
        count, changes = len(guess) - 1, np.zeros((3, STATES))
        changes[[0, 1, 2], [2, 3, 4]] = DIFFERENCE
        changes = np.vstack([np.zeros(STATES), changes, np.zeros((len(self._names), STATES))])
        column = np.append([0, 0, 0, 0], np.arange(1, len(columns)))
        states = (guess[:-1] + changes[:, None]).reshape(-1, STATES)
        batch = Stretch(
            *(part[:, column].swapaxes(0, 1).reshape(-1, *part.shape[2:]) for part in stretches)
        )
        model = self._model(np.repeat(columns[column], count, axis=0))
        q, swing = step(model, states[:, :4], states[:, 4], batch)
        ends = np.concatenate([q, swing[:, None]], axis=1).reshape(len(column), count, STATES)
        by_state = np.moveaxis(ends[1:4] - ends[0], 0, -1) / DIFFERENCE  # of x and y it is trivial
        gap = (ends[0] - guess[1:])[..., None]
        here = np.concatenate([gap, np.moveaxis(ends[4:] - ends[0], 0, -1)], axis=-1)
        total = np.zeros((count + 1, STATES, 1 + len(self._names)))
        for k in range(count):
            total[k + 1] = here[k] + by_state[k] @ total[k, 2:]
            total[k + 1, :2] += total[k, :2]
        return total[..., 0], total[..., 1:]
