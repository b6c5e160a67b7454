"""What the laws that steer the trailer share: friction, observer, and the servos' limits."""

from typing import Annotated, TypeVar

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.controllers.shared.estimation.friction import FrictionOptions, HitchFriction
from ttwmr_mj.controllers.shared.estimation.learning import (
    PLACES,
    UNEXPLAINED_WALK_RAD_S2,
    Learnable,
    Learner,
)
from ttwmr_mj.controllers.shared.estimation.observer import Observed, Observer
from ttwmr_mj.controllers.shared.estimation.steady_kalman import (
    ObserverOptions,
    process_std,
    slip_std,
)
from ttwmr_mj.controllers.shared.wheels import CUT_RAD_S, NEAR_STANDSTILL_M_S
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.latency import LatencyFinder
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.state import BoolArray, FloatArray

# Name and unit of what is learned, in the order of `dynamics.floor.influence`.
SIGNALS = (
    ("gravity_x", "m_s2"),
    ("gravity_y", "m_s2"),
    ("rolling_resistance", "m"),
    ("dry_friction", "n_m"),
    ("viscous_friction", "n_m_s_rad"),
)


class SteeringOptions(ControllerOptions):
    """Options of every law that steers the trailer."""

    friction: FrictionOptions = FrictionOptions()
    observer: ObserverOptions = ObserverOptions()
    learn: Annotated[tuple[Learnable, ...], Field(strict=False)] = Field(
        default=(),
        description="what to find out on line and make up for; the belief is the first guess",
    )


OptionsT = TypeVar("OptionsT", bound=SteeringOptions)


class SteeringLaw(Law[OptionsT]):
    """A law on the observer's state."""

    def start(self, task: Task) -> None:
        """Set up the assumed hitch, the sampled model and the observer."""
        self._nsim, self._period = task.nsim, task.sampling_time_s
        options, T = self._options, self._period
        self._friction = HitchFriction(task.robot, options.friction, task.ground)
        self._robot = self._friction.believed
        self._model = SampledModel(self._robot, T, ground=task.ground)
        inertia = self._robot.swing_inertia_kg_m2
        lever = self._robot.casters.radius_m / GRAVITY_M_S2
        self._units = np.array([1.0, 1.0, lever, inertia, inertia])  # to those of SIGNALS
        noise, learner, latency = options.observer, None, None
        if PLACES.keys() & set(options.learn):
            angle = noise.angle_std_rad, noise.rate_std_rad_s
            walk = max(noise.swing_walk_rad_s2, UNEXPLAINED_WALK_RAD_S2)
            process = process_std(noise.model_copy(update={"swing_walk_rad_s2": walk}), T)
            smoothing = options.friction.smoothing_rad_s
            learner = Learner(options.learn, self._robot, T, self._nsim, process, angle, smoothing)
        if "latency" in options.learn:
            std = noise.position_std_m, noise.angle_std_rad
            latency = LatencyFinder(self._robot, T, self._nsim, std)
        self._observer = Observer(self._robot, self._model, noise, learner, task.ahead, latency)
        self._slip_std = slip_std(noise, T)

    def _signals(self, now: Observed) -> dict[str, FloatArray]:
        """What was learned, and how sure that is, for the log."""
        learner, latency = self._observer.learner, self._observer.latency
        signals = {} if latency is None else {"learned_latency_s": latency.extra_s.copy()}
        if "wheel_radius" in self._options.learn:
            signals |= self._wheel_radius(now)
        if learner is None:
            return signals
        found, std = now.influence * self._units, learner.std() * self._units
        return signals | {
            f"learned_{name}{what}_{unit}": values[:, i].copy()
            for what, values in (("", found), ("_std", std))
            for i, (name, unit) in enumerate(SIGNALS)
            if learner.places[i]
        }

    def _wheel_radius(self, now: Observed) -> dict[str, FloatArray]:
        """r·(1 + slip/u1), by which wheels without slip would be as fast; unknown while P stands.

        The laws have no use for it: they make up for the slip itself.
        """
        speed = twist_from_wheels(now.wheels, self._robot)[:, 0]
        per_speed = np.full_like(speed, np.nan)
        np.divide(1.0, speed, out=per_speed, where=np.abs(speed) >= NEAR_STANDSTILL_M_S)
        radius = self._robot.tractor.wheel_radius_m
        std = radius * self._slip_std * np.abs(per_speed)
        return {
            "learned_wheel_radius_m": radius * (1.0 + now.slip[:, 0] * per_speed),
            "learned_wheel_radius_std_m": np.where(np.isnan(std), np.inf, std),
        }

    def _at_limit(self, wish: FloatArray, now: Observed) -> BoolArray:
        """(nsim,) whose wish (nsim, 2) [rad/s] is at a limit of the servos, or beyond."""
        outward = wish + np.copysign(CUT_RAD_S, wish - now.wheels)
        cut = np.abs(self._model.within_limits(now.wheels, outward) - outward)
        return np.asarray(cut.max(axis=1) > 0.0)

    def _possible(self, wish: FloatArray, now: Observed) -> Command:
        """The command closest to the desired one (nsim, 2) [rad/s]; the observer takes note of it.

        A wish at a limit counts as saturated: who optimises within the limits asks for no more.
        """
        wheels = self._model.within_limits(now.wheels, wish)
        cut = self._at_limit(wish, now)
        speed = twist_from_wheels(wheels, self._robot)[:, 0]
        self._observer.commanded(wheels)
        near_singular = np.asarray(np.abs(speed) < NEAR_STANDSTILL_M_S)
        return Command(
            wheels, saturated=cut, near_singular=near_singular, signals=self._signals(now)
        )
