"""What the controller is told: an estimate with its age and validity."""

from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, replace
from typing import Annotated, Generic, Literal, TypeVar

import numpy as np
from pydantic import Field

from ttwmr_mj.robot import Config
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

T = TypeVar("T")
UpTo10 = Annotated[float, Field(ge=0, le=10)]


class TruthSensing(Config):
    """The true state, with optional latency and noise."""

    kind: Literal["truth"] = "truth"
    latency_s: UpTo10 = Field(
        default=0.0,
        description="age of the state when it arrives, a whole number of control periods; "
        "typically 0.033",
    )
    position_noise_m: UpTo10 = Field(
        default=0.0, description="standard deviation of the noise in x and y; typically 0.001"
    )
    angle_noise_rad: UpTo10 = Field(
        default=0.0, description="standard deviation of the noise in both angles; typically 0.001"
    )
    velocity_noise_m_s: UpTo10 = Field(
        default=0.0, description="standard deviation of the noise in P's velocity; typically 0.001"
    )
    rate_noise_rad_s: float = Field(
        default=0.0,
        ge=0,
        le=100,
        description="standard deviation of the noise in both angular rates; typically 0.01",
    )


@dataclass(frozen=True, slots=True)
class Estimate:
    """The state as the controller knows it.

    Attributes:
        state: estimated q and rates, (nsim, 4) each.
        age_s: (nsim,) time since the state it describes; 0 where latency is compensated.
        valid: (nsim,) False while the estimate is invalid, as of a camera that sees no labels.
        labels_found: (nsim,) labels the camera found; NaN without a camera.
        measurement_age_s: (nsim,) age of the newest measurement in it; None: `age_s`.
    """

    state: RobotState
    age_s: FloatArray
    valid: BoolArray
    labels_found: FloatArray
    measurement_age_s: FloatArray | None = None


class Sensor(ABC):
    """Turns the plant's truth into what the controller sees, once per control period."""

    @abstractmethod
    def observe(self, truth: RobotState) -> Estimate:
        """Take this sample's measurement and return the one that has arrived by now."""

    def commanded(self, wheel_speed_rad_s: FloatArray) -> None:  # noqa: B027
        """Take note of the wheel speeds (nsim, 2) that hold from now on for one period."""

    def keep_log(self) -> None:  # noqa: B027
        """From now on, keep what was measured, for reports on the run."""

    def close(self) -> None:  # noqa: B027
        """Release the sensor's resources."""


class LatencyQueue(Generic[T]):
    """Delays what a sensor measures by whole control periods.

    Until the first measurement is that old, it is returned in place of those that are due.
    """

    def __init__(self, latency_s: float, period_s: float) -> None:
        self._delay = round(latency_s / period_s)
        self._waiting: deque[T] = deque()

    def exchange(self, fresh: T) -> tuple[T, int]:
        """Put in this period's measurement; take out what is due, and its age in periods."""
        self._waiting.append(fresh)
        due, age = self._waiting[0], len(self._waiting) - 1
        if age == self._delay:
            self._waiting.popleft()
        return due, age


class TruthSensor(Sensor):
    """The true state plus white Gaussian noise, through the latency queue."""

    def __init__(
        self, options: TruthSensing, period_s: float, nsim: int, rng: np.random.Generator
    ) -> None:
        self._queue = LatencyQueue[Estimate](options.latency_s, period_s)
        self._period_s = period_s
        self._rng = rng
        position, angle = options.position_noise_m, options.angle_noise_rad
        velocity, rate = options.velocity_noise_m_s, options.rate_noise_rad_s
        self._noise = np.array(
            [[position, position, angle, angle], [velocity, velocity, rate, rate]]
        )
        self._noisy = bool(self._noise.any())
        self._fresh = np.zeros(nsim)
        self._valid = np.ones(nsim, dtype=np.bool_)
        self._no_labels = np.full(nsim, np.nan)

    def observe(self, truth: RobotState) -> Estimate:
        """Measure the true state; every simulation has its own noise."""
        if self._noisy:
            noise = self._rng.standard_normal((truth.nsim, 2, 4)) * self._noise
            truth = RobotState(q=truth.q + noise[:, 0], q_rate=truth.q_rate + noise[:, 1])
        fresh = Estimate(truth, self._fresh, self._valid, self._no_labels)
        due, age = self._queue.exchange(fresh)
        return replace(due, age_s=due.age_s + age * self._period_s) if age else due
