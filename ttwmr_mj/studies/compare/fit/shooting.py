"""A run of the extended model and its derivatives by the parameters, by multiple shooting."""

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.train import extended_model
from ttwmr_mj.dynamics.kinematics import workspace_rate
from ttwmr_mj.dynamics.servo import Stretches, cut, limit_speed
from ttwmr_mj.state import THETA2, FloatArray
from ttwmr_mj.studies.compare.motion import ContactRun
from ttwmr_mj.studies.compare.shooting import FIRST, shoot

# What a parameter is searched in: the size of a typical correction.
SCALES = {
    "wheel_radius_m": 1e-5,
    "track_width_m": 1e-4,
    "servo_time_constant_s": 1e-4,
    "slip_time_s": 1e-3,
    "hitch_damping_n_m_s_rad": 1e-5,
    "hitch_coulomb_friction_n_m": 1e-5,
    "caster_mass_kg": 1e-3,
    "rolling_resistance_m": 1e-6,
}
SCALE = np.array(list(SCALES.values()))
DIFFERENCE = 0.1  # of a scale: well above rounding, well below what bends the model


class Shooting:
    """The commands of one contact run under varying parameters.

    The first guess is what contact physics did, every later one the run before.
    """

    def __init__(self, run: ContactRun) -> None:
        self._run, self._robot = run, run.robot
        self._physics_step_s = run.scenario.plant.contact.timestep_s
        self._longest_s = run.scenario.plant.analytic.max_step_s
        trailers = len(run.robot.trailers)
        self._width, self._states = 3 + trailers, 3 + 2 * trailers
        self._guess: FloatArray | None = None  # (stretches + 1, states)

    def run(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The run with parameters (p,) in the order of `SCALES`.

        Returns:
            q (periods + 1, width) and its derivatives (periods + 1, width, p) by steps of scales.
        """
        columns = np.vstack([values, values + DIFFERENCE * np.diag(SCALE)])
        stretches, passed = self._cut(columns)
        guess = self._guess
        if guess is None or len(guess) != len(stretches.duration_s) + 1:
            guess = self._contact_physics(stretches)
        column = np.append(np.zeros(1 + self._states - FIRST, np.intp), np.arange(1, len(columns)))

        def ends(states: FloatArray, which: slice) -> FloatArray:
            parts = (part[which][:, column].swapaxes(0, 1) for part in stretches)
            batch = Stretches(*(part.reshape(-1, *part.shape[2:]) for part in parts))
            model = self._model(np.repeat(columns[column], states.shape[1], axis=0))
            now = np.ascontiguousarray(states.reshape(-1, self._states).T)
            return model.step(now, batch).T.reshape(states.shape)

        self._guess, slope = shoot(ends, guess, len(values))
        samples = np.append(0, passed)
        width = self._width
        return self._guess[samples, :width], slope[samples, :width] / DIFFERENCE

    def _cut(self, columns: FloatArray) -> tuple[Stretches, NDArray[np.intp]]:
        """Stretches (n, p + 1) of every column of parameters, and how many each period ends."""
        servo, period_s = self._robot.servo, self._run.scenario.control.sampling_time_s
        goal = limit_speed(self._run.commands, servo)
        now = self._model(columns).wheels(workspace_rate(*self._start)[:, :2])
        reach = servo.acceleration_limit_rad_s2 * period_s
        starts = np.empty((len(goal), *now.shape))
        for start, wish in zip(starts, goal, strict=True):
            start[:] = now
            now = now + np.clip(wish - now, -reach, reach)
        # every period is a simulation of its own
        each = np.repeat(goal, len(columns), axis=0)
        steps = self._longest_s, self._physics_step_s
        parts = cut(starts.reshape(-1, 2), each, servo, period_s, *steps)
        split = (
            part.reshape(len(part), *starts.shape[:2], *part.shape[2:]).swapaxes(0, 1)
            for part in parts
        )
        periods = Stretches(*split)
        used = np.asarray(periods.duration_s.any(axis=2))
        return periods.where(used), np.cumsum(used.sum(axis=1))

    @property
    def _start(self) -> tuple[FloatArray, FloatArray]:
        return self._run.start.q, self._run.start.q_rate

    def _contact_physics(self, stretches: Stretches) -> FloatArray:
        """(n + 1, states) of contact physics at the stretches' ends."""
        physics, time_s = self._run.physics, np.append(0.0, np.cumsum(stretches.duration_s[:, 0]))
        columns = [*physics.q.T, *physics.q_rate[:, THETA2:].T]
        return np.stack([np.interp(time_s, physics.time_s, column) for column in columns], axis=-1)

    def _model(self, values: FloatArray) -> ExtendedModel:
        """The model with parameters (nsim, p), as the plant integrates it."""
        parameters = dict(zip(SCALES, values.T, strict=True))
        rest = self._physics_step_s, self._run.scenario.ground
        kind = extended_model(self._robot)
        return kind(self._robot, parameters, *rest).softened(self._longest_s)
