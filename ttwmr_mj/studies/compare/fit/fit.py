"""Parameters of the extended model, identified from a contact run and validated on another one.

Least squares over the deviations of x, y, θ1, θ2, … at the control samples, each weighted with the
rms of what the plain model misses by. Where the data cannot tell parameters apart (hitch damping
and the balls' inertia act through their ratio alone), a faint pull towards what the robot's own
numbers lead to expect decides.

What may vanish and does not show in the data (its interval reaches down to zero, and the robot's
own numbers name none) is taken for zero, and the rest is fitted again. A dry friction of 0.3 µN·m
that is not there costs a run that was not fitted 1 mrad of θ2.

`scipy.optimize.least_squares` does it; `mujoco.sysid` fits parameters of an MjSpec by rollouts of
MuJoCo, and here the model is not MuJoCo's. `shooting` gives the run and its derivatives.
"""

import functools
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.special import stdtrit

from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.errors import RunError
from ttwmr_mj.results.trajectory import Trajectory, q_names
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.fit.shooting import SCALE, SCALES, Shooting
from ttwmr_mj.studies.compare.measures.deviation import Deviation
from ttwmr_mj.studies.compare.motion import ContactRun, replay_analytic, replay_plain
from ttwmr_mj.studies.compare.variants import Progress, changed

LENGTHS = ("wheel_radius_m", "track_width_m")  # far from zero; all else may vanish
FLOOR = np.array([-np.inf if name in LENGTHS else 0.0 for name in SCALES])
EXPECTED_WITHIN = 1e4  # scales: so faint that it decides only where the data do not
TWO_SIDED, ONE_SIDED = 0.975, 0.95  # levels of Student's t for an interval of 95 %
MEASURES = (
    "position_deviation_rms_m",
    "position_deviation_max_m",
    "theta1_deviation_rms_rad",
    *(f"theta{i}_deviation_{what}_rad" for i in range(2, 7) for what in ("rms", "max")),
)


@dataclass(frozen=True, slots=True)
class Fitted:
    """One parameter, SI units as in its name."""

    value: float
    confidence_95: list[float]  # low and high end; one-sided where it reaches the bound zero
    expected: float  # from the robot's own numbers
    identified: bool  # by the data alone: a two-sided interval narrower than the value
    pinned: bool  # to zero, as the data cannot tell it from that


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
    """A fit and its validation."""

    parameters: dict[str, Fitted]
    fitted: ExtendedParameters  # their values, with the step of the contact physics they are of
    training: Gain  # on the scenario it was fitted on
    validation: Gain  # on one it did not see

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        gains = {
            part: {**asdict(gain), "factor": gain.factor}
            for part, gain in (("training", self.training), ("validation", self.validation))
        }
        return {"parameters": {k: asdict(e) for k, e in self.parameters.items()}, **gains}

    def as_toml(self) -> str:
        """The scenario fragment: the table plant.analytic.extended."""
        return (
            f"# Fitted on {self.training.scenario}, validated on {self.validation.scenario}.\n"
            + tomli_w.dumps({"plant": {"analytic": {"extended": self.fitted.model_dump()}}})
        )


def fit(run: ContactRun, unseen: ContactRun, progress: Progress | None = None) -> Fit:
    """Identify the extended model from one run and validate it on another of the same robot.

    Raises:
        RunError: the search did not converge.
    """
    search = _Search(run, progress)
    everything = np.ones(len(SCALES), np.bool_)
    found = search.run(everything)
    value, low, high = search.intervals(found)
    pinned = (low <= 0.0) & (search.start == 0.0) & (FLOOR == 0.0)
    half = high - value
    if pinned.any():
        value = search.value(search.run(~pinned).x, ~pinned)
    parameters = {
        name: Fitted(
            value=float(value[i]),
            confidence_95=[float(low[i]), float(high[i])],
            expected=float(search.start[i]),
            identified=bool(half[i] < abs(value[i]) and low[i] > FLOOR[i]),
            pinned=bool(pinned[i]),
        )
        for i, name in enumerate(SCALES)
    }
    step_s = run.scenario.plant.contact.timestep_s
    fitted = ExtendedParameters(
        **dict(zip(SCALES, value.tolist(), strict=True)), physics_step_s=step_s
    )
    return Fit(parameters, fitted, _gain(run, fitted), _gain(unseen, fitted))


class _Search:
    """What least squares asks for, at steps of scales from what the robot's numbers lead to expect.

    Attributes:
        start: (p,) the parameters expected.
        low: (p,) bound of the steps.
    """

    def __init__(self, run: ContactRun, progress: Progress | None) -> None:
        expected = ExtendedParameters.expected(run.robot)
        self.start = np.array([getattr(expected, name) for name in SCALES])
        self.low = (FLOOR - self.start) / SCALE
        self._true, self._progress, self._evaluations = run.trajectory.q[:, 0], progress, 0
        self._name = run.scenario.name
        plain = replay_plain(run.scenario, run.commands).q[:, 0]
        apart = np.sqrt(np.mean((self._true - plain) ** 2, axis=0))
        if not (apart > 0.0).all():
            names = ", ".join(q_names(len(apart)))
            raise RunError(
                f"nothing can be fitted to {self._name}: its model and its physics do not differ "
                f"in every one of {names}; drive a longer way, with turns"
            )
        self._weight = 1.0 / apart
        self._pull = np.eye(len(SCALES)) / EXPECTED_WITHIN
        self._shooting = Shooting(run)
        self._shoot = functools.lru_cache(maxsize=2)(self._evaluate)

    def run(self, free: NDArray[np.bool_]) -> OptimizeResult:
        """Least squares over some parameters, the others at their bound or, without one, expected.

        Args:
            free: (p,) the parameters that are searched.

        Raises:
            RunError: it did not converge.
        """
        found = least_squares(
            lambda steps: self.residual(self._all(steps, free)),
            np.maximum(0.0, self.low + 0.1)[free],  # inside, where the search can turn
            jac=lambda steps: self.jacobian(self._all(steps, free))[:, free],
            bounds=(self.low[free], np.inf),
            x_scale="jac",
            max_nfev=100,  # shipped scenarios take 10 to 20
        )
        if not found.success:
            raise RunError(f"the fit to {self._name} did not converge: {found.message}")
        return found

    def value(self, steps: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
        """(p,) the parameters, of steps of the free ones."""
        return np.asarray(self.start + SCALE * self._all(steps, free))

    def _all(self, steps: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
        every: FloatArray = np.maximum(self.low, 0.0)  # those expected at zero stay there
        every[free] = steps
        return every

    def intervals(self, found: OptimizeResult) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(p,) values and ends of their intervals, of a search over all parameters.

        Student's t has as many degrees of freedom as there are independent samples beyond the
        parameters. An interval that reaches its bound has one open side: 5 % lie above it.
        """
        value = self.start + SCALE * found.x
        data = len(found.fun) - len(value)  # the rest is the pull's
        residual, jacobian = found.fun[:data], found.jac[:data]
        width = self._true.shape[1]
        deviation = SCALE * standard_deviation(residual, jacobian, width)
        free = freedom(residual, len(value), width)
        low = value - stdtrit(free, TWO_SIDED) * deviation
        at_bound = low <= FLOOR
        level = np.where(at_bound, ONE_SIDED, TWO_SIDED)
        high = value + stdtrit(free, level) * deviation
        return value, np.where(at_bound, FLOOR, low), high

    def residual(self, step: FloatArray) -> FloatArray:
        """(data + p,) weighted deviations x, y, θ1, θ2, … of every sample, and the pull."""
        return self._shoot(step.tobytes())[0]

    def jacobian(self, step: FloatArray) -> FloatArray:
        """(data + p, p) its derivatives."""
        return self._shoot(step.tobytes())[1]

    def _evaluate(self, steps: bytes) -> tuple[FloatArray, FloatArray]:
        """Both at once, as one costs what both do; they are asked for one by one."""
        self._evaluations += 1
        if self._progress is not None:
            self._progress(1.0 - 0.9**self._evaluations)  # never done, and slower and slower
        step = np.frombuffer(steps)
        q, slope = self._shooting.run(self.start + SCALE * step)
        missed = self._weight * (self._true - q)
        change = (-self._weight[:, None] * slope).reshape(-1, len(step))
        residual = np.concatenate([missed.ravel(), self._pull @ step])
        return residual, np.vstack([change, self._pull])


def standard_deviation(residual: FloatArray, jacobian: FloatArray, width: int) -> FloatArray:
    """(p,) of each parameter, if what is left is noise as correlated in time as it looks.

    Neighbouring samples miss in the same way, so there are fewer independent ones than samples, by
    (1 − ρ)/(1 + ρ) with ρ the correlation of neighbours. A direction that the data do not see at
    all gets no bound.

    Args:
        residual: (width·n,) the columns of every sample, one sample after the other.
        jacobian: (width·n, p).
        width: columns.
    """
    power = float(np.sum(residual**2))
    _, singular, axes = np.linalg.svd(jacobian, full_matrices=False)
    with np.errstate(divide="ignore"):
        variance = ((axes.T / singular) ** 2).sum(axis=1)
    return np.asarray(np.sqrt(variance * power / freedom(residual, jacobian.shape[1], width)))


def freedom(residual: FloatArray, parameters: int, width: int) -> float:
    """Independent samples that (width·n,) residuals hold beyond the parameters; at least one."""
    rows = residual.reshape(-1, width)
    before, after = rows[:-1].ravel(), rows[1:].ravel()
    power = float(np.sum(rows**2))
    correlation = float(np.clip(before @ after / power, 0.0, 0.999)) if power else 0.0
    independent = residual.size * (1.0 - correlation) / (1.0 + correlation)
    return max(independent - parameters, 1.0)


def _gain(run: ContactRun, fitted: ExtendedParameters) -> Gain:
    """What the extended model improves, as a comparison with its fragment finds it."""

    def deviations(rows: Trajectory) -> dict[str, float]:
        numbers = Deviation.between(run.trajectory, rows).numbers()
        return {name: size for name in MEASURES if (size := numbers.get(name)) is not None}

    extended = changed(run.scenario, {"plant.analytic.extended": fitted.model_dump()})
    plain = deviations(replay_plain(run.scenario, run.commands))
    return Gain(run.scenario.name, plain, deviations(replay_analytic(extended, run.commands)))
