"""What the controller is told: an estimate with its age and validity."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ttwmr_mj.channel import Arrived, Channel, LatencyQueue
from ttwmr_mj.config import each
from ttwmr_mj.robot import Config
from ttwmr_mj.state import ArrayFields, BoolArray, FloatArray, RobotState

NOISE_BLOCK = 64  # samples whose noise is drawn at once
T = TypeVar("T")
UpTo10 = Annotated[float, Field(ge=0, le=10)]
Lost = Annotated[float, Field(ge=0, lt=1)]


class SensingOptions(Config):
    """The channel from any sensor to the controller."""

    kind: str
    latency_s: UpTo10 = Field(
        default=0.0,
        description="age of the state when it arrives, a whole number of control periods; "
        "typically 0.033",
    )
    latency_jitter_s: UpTo10 = Field(
        default=0.0,
        description="largest additional latency; each measurement's is a random whole number of "
        "control periods, uniform from 0; overtaken measurements are discarded; typically 0.033",
    )
    drop_probability: Lost = Field(
        default=0.0,
        description="probability that a measurement is lost, so that the last one has to serve; "
        "typically 0.02",
    )
    clock_offset_s: float = Field(
        default=0.0,
        ge=-10,
        le=10,
        description="error of the measurements' time stamps; positive: later than the truth, so "
        "that measurements seem younger than they are; typically 0.01",
    )


class TruthSensing(SensingOptions):
    """The true state, late and noisy if asked."""

    kind: Literal["truth"] = "truth"
    position_noise_m: UpTo10 = Field(
        default=0.0, description="standard deviation of the noise in x and y; typically 0.001"
    )
    angle_noise_rad: UpTo10 = Field(
        default=0.0, description="standard deviation of the noise in all angles; typically 0.001"
    )
    velocity_noise_m_s: UpTo10 = Field(
        default=0.0, description="standard deviation of the noise in P's velocity; typically 0.001"
    )
    rate_noise_rad_s: float = Field(
        default=0.0,
        ge=0,
        le=100,
        description="standard deviation of the noise in all angular rates; typically 0.01",
    )


def noise_std(options: TruthSensing) -> FloatArray:
    """(2, 4) standard deviations of the noise in q and its rate; more trailers are as the first."""
    position, angle = options.position_noise_m, options.angle_noise_rad
    velocity, rate = options.velocity_noise_m_s, options.rate_noise_rad_s
    return np.array([[position, position, angle, angle], [velocity, velocity, rate, rate]])


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(ArrayFields):
    """The state as the controller knows it.

    Attributes:
        state: estimated q and rates, (nsim, 3 + n) each.
        age_s: (nsim,) time since the state it describes; 0 where latency is compensated.
        valid: (nsim,) False while the estimate is invalid, as of a camera that sees no labels.
        labels_found: (nsim,) labels the camera found; NaN without a camera.
        measurement_age_s: (nsim,) age of the newest measurement in it; None: `age_s`.
        wheel_angle_rad: (nsim, 2) of the wheels (right, left) by their encoders, always fresh;
            known where wheel torques drive the robot, else None.
    """

    state: RobotState
    age_s: FloatArray
    valid: BoolArray
    labels_found: FloatArray
    measurement_age_s: FloatArray | None = None
    wheel_angle_rad: FloatArray | None = None

    def of(self, who: NDArray[np.intp]) -> Estimate:
        """That of some of the simulations, in arrays of its own."""
        measured, turned = self.measurement_age_s, self.wheel_angle_rad
        return Estimate(
            RobotState(self.state.q[who], self.state.q_rate[who]),
            self.age_s[who],
            self.valid[who],
            self.labels_found[who],
            None if measured is None else measured[who],
            None if turned is None else turned[who],
        )

    def copy(self) -> Estimate:
        """The same in arrays of its own."""
        measured, turned = self.measurement_age_s, self.wheel_angle_rad
        return Estimate(
            RobotState(self.state.q.copy(), self.state.q_rate.copy()),
            self.age_s.copy(),
            self.valid.copy(),
            self.labels_found.copy(),
            None if measured is None else measured.copy(),
            None if turned is None else turned.copy(),
        )


class Sensor(ABC):
    """Turns the plant's truth into what the controller sees, once per control period."""

    @abstractmethod
    def observe(self, truth: RobotState) -> Estimate:
        """Take this sample's measurement and return the one that has arrived by now."""

    def commanded(self, wheel_speed_rad_s: FloatArray) -> None:  # noqa: B027
        """Take note of the wheel speeds (nsim, 2) that hold from now on for one period."""

    def keep_log(self, frames_every: int = 1) -> None:  # noqa: B027
        """From now on, keep what was measured, for reports on the run.

        Args:
            frames_every: of a camera, keep one frame in this many; 0: none.
        """

    def close(self) -> None:  # noqa: B027
        """Release the sensor's resources."""


class MeasurementQueue(LatencyQueue[T]):
    """The channel of measurements, and the time stamps that the receiver gives them.

    A time stamp is the time of arrival minus the latency that the receiver assumes. Jitter and a
    latency that it does not know make the stamp late, as a clock offset does.

    Attributes:
        is_direct: measurements arrive at once, with exact time stamps.
    """

    def __init__(
        self,
        options: SensingOptions,
        period_s: float,
        rngs: list[np.random.Generator],
        told_latency_s: float | None = None,
    ) -> None:
        """Set up.

        Args:
            options: the channel.
            period_s: control period; a measurement is sent in each.
            rngs: one per simulation.
            told_latency_s: the latency that the receiver assumes; None: the true one.
        """
        latency, jitter = (
            _whole(s, period_s) for s in (options.latency_s, options.latency_jitter_s)
        )
        super().__init__(Channel(latency, jitter, options.drop_probability), rngs)
        untold_s = 0.0 if told_latency_s is None else latency * period_s - told_latency_s
        self._latency, self._period_s = latency, period_s
        self._late_s = untold_s + options.clock_offset_s
        late = np.any(latency) or np.any(self._late_s)
        self.is_direct = not (late or self._channel.is_random)

    def stamp_error_s(self, arrived: Arrived) -> FloatArray:
        """(nsim,) by how much the stamps of what has arrived are later than its time."""
        return np.asarray((arrived.travel - self._latency) * self._period_s + self._late_s)


def _whole(time_s: float, period_s: float) -> Any:
    """Periods in a time, the nearest number; (nsim,) of (nsim,) times."""
    return (
        round(time_s / period_s) if np.ndim(time_s) == 0 else np.rint(time_s / period_s).astype(int)
    )


class TruthSensor(Sensor):
    """The true state plus white Gaussian noise, through the queue."""

    def __init__(
        self,
        options: TruthSensing,
        period_s: float,
        rngs: list[np.random.Generator],
        told_latency_s: float | None = None,
    ) -> None:
        """Set up.

        Args:
            options: noise and channel, or those of every simulation (`config.stacked`).
            period_s: control period.
            rngs: one per simulation.
            told_latency_s: as of `MeasurementQueue`.
        """
        # what happens on the way has its own; the noise does not change by it
        channel = [rng.spawn(1)[0] for rng in rngs]
        self._queue = MeasurementQueue[RobotState](options, period_s, channel, told_latency_s)
        self._period_s = period_s
        self._rngs = rngs
        self._noise = each(noise_std, options)
        self._noisy = bool(self._noise.any())
        self._drawn: FloatArray = np.zeros(0)  # (nsim, NOISE_BLOCK, 2, 3 + n)
        self._fresh = np.zeros(len(rngs))
        self._valid = np.ones(len(rngs), dtype=np.bool_)
        self._no_labels = np.full(len(rngs), np.nan)
        self._k = -1

    def observe(self, truth: RobotState) -> Estimate:
        """Measure the true state; every simulation has its own noise."""
        self._k += 1
        if self._noisy:
            width = truth.q.shape[1]
            # further trailers are measured as the first
            noise = self._white(width) * self._noise[..., [*range(4), *[3] * (width - 4)]]
            truth = RobotState(q=truth.q + noise[:, 0], q_rate=truth.q_rate + noise[:, 1])
        if self._queue.is_direct:
            return Estimate(truth, self._fresh, self._valid, self._no_labels)
        arrived = self._queue.exchange(truth)
        age = (self._k - arrived.sent) * self._period_s - self._queue.stamp_error_s(arrived)
        # a stamp of the future is taken for now
        return Estimate(self._arrived(arrived), np.maximum(age, 0.0), self._valid, self._no_labels)

    def _white(self, width: int) -> FloatArray:
        """(nsim, 2, width) of this sample, drawn in blocks: one after the other is the same."""
        at = self._k % NOISE_BLOCK
        if at == 0:
            size = (NOISE_BLOCK, 2, width)
            self._drawn = np.stack([rng.standard_normal(size) for rng in self._rngs])
        return self._drawn[:, at]

    def _arrived(self, arrived: Arrived) -> RobotState:
        """What each simulation's controller has, out of the periods it was sent in."""
        first, *others = np.unique(arrived.sent).tolist()
        state = self._queue.item(first)
        if not others:
            return state
        q, q_rate = state.q.copy(), state.q_rate.copy()
        for sent in others:
            here, state = arrived.sent == sent, self._queue.item(sent)
            q[here], q_rate[here] = state.q[here], state.q_rate[here]
        return RobotState(q=q, q_rate=q_rate)
