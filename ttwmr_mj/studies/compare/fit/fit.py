"""Parameters of the extended model identified from a contact run, and proved on another one.

Least squares over the deviations of x, y, θ1 and θ2 at the control samples, each weighted with the
rms of what the plain model misses by. Where the data cannot tell parameters apart (hitch damping
and the balls' inertia act through their ratio alone), a faint pull towards what the robot's own
numbers lead to expect decides.

`scipy.optimize.least_squares` does it; `mujoco.sysid` fits parameters of an MjSpec by rollouts of
MuJoCo, and here the model is not MuJoCo's. `shooting` gives the run and its derivatives.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tomli_w
from scipy.optimize import least_squares

from ttwmr_mj.dynamics.extended import ExtendedParameters
from ttwmr_mj.errors import RunError
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.deviation import Deviation, rms
from ttwmr_mj.studies.compare.fit.shooting import Shooting
from ttwmr_mj.studies.compare.motion import ContactRun, replay_analytic

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
NEVER_NEGATIVE = frozenset(SCALES) - {"wheel_radius_m", "track_width_m"}
DIFFERENCE = 0.1  # of a scale
DIFFERENCES = {name: DIFFERENCE * size for name, size in SCALES.items()}
EXPECTED_WITHIN = 1e4  # scales: faint
CONFIDENCE_95 = 1.96
MAX_STEP_S = 0.033  # Runge-Kutta's; the swing takes seconds

Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Estimate:
    """One parameter, SI units as in its name.

    Attributes:
        value: the estimate.
        low, high: 95 % confidence interval, cut at a bound of the parameter.
        expected: from the robot's own numbers.
        identified: whether the data alone bound it: the interval is narrower than the value.
    """

    value: float
    low: float
    high: float
    expected: float
    identified: bool


@dataclass(frozen=True, slots=True)
class Gain:
    """Deviations of the plain and of the fitted model on one scenario; keys as compare.json's."""

    scenario: str
    plain: dict[str, float]
    fitted: dict[str, float]

    @property
    def factor(self) -> dict[str, float]:
        """By what each deviation fell."""
        return {name: self.plain[name] / self.fitted[name] for name in self.plain}


@dataclass(frozen=True, slots=True)
class Fit:
    """A fit and its proof.

    Attributes:
        parameters: name → estimate.
        training: on the scenario it was fitted on.
        validation: on one it did not see.
    """

    parameters: dict[str, Estimate]
    training: Gain
    validation: Gain

    @property
    def fitted(self) -> ExtendedParameters:
        """The fitted model's parameters."""
        return ExtendedParameters(**{name: e.value for name, e in self.parameters.items()})

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        parameters = {
            name: {
                "value": e.value,
                "confidence_95": [e.low, e.high],
                "expected": e.expected,
                "identified": e.identified,
            }
            for name, e in self.parameters.items()
        }
        gains = {
            part: {
                "scenario": gain.scenario,
                "plain": gain.plain,
                "fitted": gain.fitted,
                "factor": gain.factor,
            }
            for part, gain in (("training", self.training), ("validation", self.validation))
        }
        return {"parameters": parameters, **gains}

    def as_toml(self) -> str:
        """The scenario fragment: the table plant.analytic.extended."""
        return (
            f"# Fitted on {self.training.scenario}, validated on {self.validation.scenario}.\n"
            + tomli_w.dumps({"plant": {"analytic": {"extended": self.fitted.model_dump()}}})
        )


def fit(run: ContactRun, unseen: ContactRun, progress: Progress | None = None) -> Fit:
    """Identify the extended model from one run and validate it on the other.

    Args:
        run: of the robot to be identified.
        unseen: of the same robot in another scenario.
        progress: called with the share of the iterations done, roughly.

    Raises:
        RunError: the search did not converge.
    """
    expected = ExtendedParameters.expected(run.robot)
    start = np.array([getattr(expected, name) for name in SCALES])
    scale = np.array(list(SCALES.values()))
    plain = replay_analytic(run.scenario, run.commands)
    weight = 1.0 / np.sqrt(np.mean((run.trajectory.q[:, 0] - plain.q[:, 0]) ** 2, axis=0))
    low = np.where([name in NEVER_NEGATIVE for name in SCALES], -start / scale, -np.inf)
    pull = np.eye(len(start)) / EXPECTED_WITHIN
    evaluations = 0
    shooting = Shooting(run, DIFFERENCES, MAX_STEP_S)

    @functools.lru_cache(maxsize=2)
    def shoot(steps: bytes) -> tuple[FloatArray, FloatArray]:
        """Residual and Jacobian at steps of scales from the nominal; asked for one by one."""
        nonlocal evaluations
        evaluations += 1
        if progress is not None:
            progress(1.0 - 0.9**evaluations)
        step = np.frombuffer(steps)
        q, slope = shooting.run(start + scale * step)
        missed = weight * (run.trajectory.q[:, 0] - q)
        change = -weight[:, None] * slope / DIFFERENCE
        rows = change.reshape(-1, len(step))
        return np.concatenate([missed.ravel(), pull @ step]), np.vstack([rows, pull])

    def residual(step: FloatArray) -> FloatArray:
        return shoot(step.tobytes())[0]

    def jacobian(step: FloatArray) -> FloatArray:
        return shoot(step.tobytes())[1]

    first = np.maximum(0.0, low + 0.1)  # inside, where the search can turn
    found = least_squares(
        residual, first, jac=jacobian, bounds=(low, np.inf), x_scale="jac", max_nfev=100
    )
    if not found.success:
        raise RunError(f"the fit to {run.scenario.name} did not converge: {found.message}")
    data = len(found.fun) - len(start)
    spread = scale * _standard_deviation(found.fun[:data], found.jac[:data])
    value = start + scale * found.x
    parameters = {}
    for i, name in enumerate(SCALES):
        floor = 0.0 if name in NEVER_NEGATIVE else -np.inf
        half = CONFIDENCE_95 * float(spread[i])
        parameters[name] = Estimate(
            value=float(value[i]),
            low=float(max(value[i] - half, floor)),
            high=float(value[i] + half),
            expected=float(start[i]),
            identified=half < abs(float(value[i])),
        )
    return Fit(parameters, _gain(run, value), _gain(unseen, value))


def _standard_deviation(residual: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Of each parameter, if what is left is noise as correlated in time as it looks.

    Neighbouring samples miss in the same way, so there are fewer independent ones than samples, by
    (1 − ρ)/(1 + ρ) with ρ the correlation of neighbours. A direction that the data do not see at
    all gets no bound.
    """
    rows = residual.reshape(-1, 4)
    before, after = rows[:-1].ravel(), rows[1:].ravel()
    power = float(np.sum(rows**2))
    correlation = float(np.clip(before @ after / power, 0.0, 0.999)) if power else 0.0
    independent = residual.size * (1.0 - correlation) / (1.0 + correlation)
    freedom = max(independent - jacobian.shape[1], 1.0)
    _, singular, axes = np.linalg.svd(jacobian, full_matrices=False)
    with np.errstate(divide="ignore"):
        variance = ((axes.T / singular) ** 2).sum(axis=1)
    return np.asarray(np.sqrt(variance * power / freedom))


def _gain(run: ContactRun, value: FloatArray) -> Gain:
    """What parameters in the order of `SCALES` improve."""
    plain = replay_analytic(run.scenario, run.commands)
    q = Shooting(run, DIFFERENCES, MAX_STEP_S).run(value)[0]
    fitted = replace(run.trajectory, q=q[:, None])
    return Gain(run.scenario.name, _deviations(run, plain), _deviations(run, fitted))


def _deviations(run: ContactRun, rows: Trajectory) -> dict[str, float]:
    deviation = Deviation.between(run.trajectory, rows)
    return {
        "position_deviation_rms_m": rms(deviation.position_m),
        "position_deviation_max_m": float(deviation.position_m.max()),
        "theta1_deviation_rms_rad": rms(deviation.q[:, 2]),
        "theta2_deviation_rms_rad": rms(deviation.q[:, 3]),
        "theta2_deviation_max_rad": float(np.abs(deviation.q[:, 3]).max()),
    }
