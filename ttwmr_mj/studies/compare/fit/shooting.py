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

from ttwmr_mj.dynamics.extended import STATES, ExtendedModel
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.plants.extended_steps import cut_all, rolling_setpoint, step
from ttwmr_mj.state import THETA2, FloatArray, RobotState
from ttwmr_mj.studies.compare.motion import ContactRun

MOVED = [2, 3, 4]  # the states that matter for rates: θ1, θ2, swing rate
DIFFERENCE = 1e-6  # of these [rad, rad/s]: rounding and curvature both cost 1e-10
CLOSED = 1e-9  # a correction after which the next would be of its square
MAX_ROUNDS = 8  # smooth hitches take 3


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
        self._run, self._robot, self._max_step_s = run, run.robot, max_step_s
        self._period_s = run.scenario.control.sampling_time_s
        self._physics_step_s = run.scenario.plant.contact.timestep_s
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

    def _cut(self, columns: FloatArray) -> tuple[Stretches, NDArray[np.intp]]:
        """Stretches (n, p + 1) of every column of parameters, and where the periods end."""
        start, nsim = self._run.start, len(columns)
        many = RobotState(np.tile(start.q, (nsim, 1)), np.tile(start.q_rate, (nsim, 1)))
        return cut_all(
            rolling_setpoint(self._model(columns), many),
            self._run.commands,
            self._robot.servo,
            self._period_s,
            self._max_step_s,
            self._physics_step_s,
        )

    def _contact_physics(self, stretches: Stretches) -> FloatArray:
        """(n + 1, STATES) of contact physics at the stretches' ends."""
        physics, time_s = self._run.physics, np.append(0.0, np.cumsum(stretches.duration_s[:, 0]))
        columns = [*physics.q.T, physics.q_rate[:, THETA2]]
        return np.stack([np.interp(time_s, physics.time_s, column) for column in columns], axis=-1)

    def _model(self, values: FloatArray) -> ExtendedModel:
        """The model with parameters (nsim, p)."""
        parameters = dict(zip(self._names, values.T, strict=True))
        return ExtendedModel(self._robot, parameters, self._physics_step_s)

    def _march(self, values: FloatArray, stretches: Stretches) -> FloatArray:
        """(n + 1, STATES) stretch after stretch."""
        model = self._model(values[None])
        start = self._run.start
        states = [np.append(start.q[0], start.q_rate[0, THETA2])]
        for k in range(len(stretches.duration_s)):
            stretch = Stretches(*(part[k, :1] for part in stretches))
            states.append(step(model, states[-1][:, None], stretch)[:, 0])
        return np.array(states)

    def _newton(
        self, columns: FloatArray, stretches: Stretches, guess: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Correction (n + 1, STATES) of a guess, and the derivatives (n + 1, STATES, p)."""
        count, moved, parameters = len(guess) - 1, len(MOVED), len(self._names)
        changes = np.zeros((1 + moved + parameters, STATES))
        changes[1 : 1 + moved, MOVED] = DIFFERENCE * np.eye(moved)
        column = np.append(np.zeros(1 + moved, np.intp), np.arange(1, 1 + parameters))
        states = guess[:-1] + changes[:, None]
        batch = Stretches(
            *(part[:, column].swapaxes(0, 1).reshape(-1, *part.shape[2:]) for part in stretches)
        )
        model = self._model(np.repeat(columns[column], count, axis=0))
        ends = step(model, np.ascontiguousarray(states.reshape(-1, STATES).T), batch)
        ends = ends.T.reshape(states.shape)
        here, there = ends[1 : 1 + moved] - ends[0], ends[1 + moved :] - ends[0]
        by_state = np.moveaxis(here, 0, -1) / DIFFERENCE  # of x and y it is trivial
        gap = (ends[0] - guess[1:])[..., None]
        added = np.concatenate([gap, np.moveaxis(there, 0, -1)], axis=-1)
        total = np.zeros((count + 1, STATES, 1 + parameters))
        for k in range(count):
            total[k + 1] = added[k] + by_state[k] @ total[k, MOVED[0] :]
            total[k + 1, : MOVED[0]] += total[k, : MOVED[0]]
        return total[..., 0], total[..., 1:]
