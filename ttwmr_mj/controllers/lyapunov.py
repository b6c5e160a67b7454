"""The article's law for the tractor alone (Eq. 32), with a choice of what to do about e1²/e2.

As printed, v = v_d − α2·e2 − (α1/α2)·(e1 + e1²/e2), and the same in y. Theorem 1 overlooks that the
error reaches e2 = 0 in finite time with e1 ≠ 0, where e1²/e2 is undefined: with u = e2/e1 the
printed law gives u' = −α2·u − (α1/α2)(1 + 1/u) − u², which for Table II is negative for every u > 0
and drives every u < 0 up to 0⁻ or down through −∞.

`singular_terms` names the choices:

- "omitted" (default): without e1²/e2, e1'' + α2·e1' + (α1/α2)·e1 = 0. V of Eq. 33 then has
  V' = −(α2·e2)² − (α4·e4)², and by LaSalle's principle e → 0. Table II: poles −0.26 and −9.74 1/s.
- "regularized": e1²·e2/(e2² + ε²). Bounded, and V' ≤ −(α2·e2)² − (α4·e4)² still; slow near the
  end, because the term fights the error's last motion.
- "published": as printed. Where e2 is exactly 0 the term counts as 0; close to 0 it is left as
  large as it is, and the wheels saturate.

Stability assumes that P obeys v, that is: no wheel saturation, no slip, and T small against α.
Nothing here looks at the trailer.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.config import column, each
from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.controllers.shared.wheels import AccelerationToWheels
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, RobotState


def singular_term(e: FloatArray, e_rate: FloatArray, options: LyapunovOptions) -> FloatArray:
    """The term used for e1²/e2 (Eq. 32), elementwise on any shape [m, m/s → m²/(m/s)]."""
    if options.singular_terms == "omitted":
        return np.zeros_like(e)
    if options.singular_terms == "regularized":
        return e * e * e_rate / (e_rate * e_rate + column(each(_regularization, options)))
    return np.divide(e * e, e_rate, out=np.zeros_like(e), where=e_rate != 0.0)


def law(
    e: FloatArray, e_rate: FloatArray, feedforward: FloatArray, options: LyapunovOptions
) -> FloatArray:
    """(v1, v2) of Eq. 32 for errors e = (e1, e3), e_rate = (e2, e4), all (..., 2) [m/s²]."""
    damping, stiffness = gains(options)
    pull = e if options.singular_terms == "omitted" else e + singular_term(e, e_rate, options)
    return np.asarray(feedforward - damping * e_rate - stiffness * pull)


@lru_cache(maxsize=16)
def gains(options: LyapunovOptions) -> tuple[FloatArray, FloatArray]:
    """(α2, α4) [1/s] and (α1/α2, α3/α4) [1/s²], the gains as Eq. 32 uses them.

    (2,) each, or (nsim, 2) for options of as many simulations (`config.stacked`).
    """
    return each(_gains, options)


def _gains(options: LyapunovOptions) -> tuple[FloatArray, FloatArray]:
    damping = np.array([options.alpha2, options.alpha4])
    return damping, np.array([options.alpha1, options.alpha3]) / damping


def _regularization(options: LyapunovOptions) -> float:
    """ε² of the regularised term."""
    return options.regularization_m_s**2


def lyapunov_function(
    e: FloatArray, e_rate: FloatArray, options: LyapunovOptions
) -> tuple[FloatArray, FloatArray]:
    """V of Eq. 33 and 44, and V' as Eq. 36 and 46 claim it, (...), for errors as in `law`.

    V mixes m² and (m/s)², as the article's does; only its shape over time means something.
    """
    errors = np.concatenate([e, e_rate], axis=-1)
    # sums, not products of matrices, whose rounding depends on the size of the batch
    both = np.add.reduce((errors * errors)[..., None, :] * _weights(options), axis=-1)
    return both[..., 0], both[..., 1]


@lru_cache(maxsize=16)
def _weights(options: LyapunovOptions) -> FloatArray:
    """(2, 4), or (nsim, 2, 4): what V and the claimed V' weigh e1², e3², e2², e4² with."""
    return each(_weighing, options)


def _weighing(options: LyapunovOptions) -> FloatArray:
    on_error = np.array([options.alpha1, options.alpha3])
    on_rate = np.array([options.alpha2, options.alpha4])
    return np.array([[*on_error / 2, *on_rate / 2], [*-on_error, *-(on_rate**2)]])


class Lyapunov(Law["LyapunovOptions"]):
    """Law (32) and the map of Eq. 27-28 to wheel speeds.

    v_d is the reference's mean acceleration over the coming period, (ẋ_d(k+1) − ẋ_d(k))/T: with
    it, zero error is an exact equilibrium of the sampled loop.
    """

    def start(self, task: Task) -> None:
        """Take the reference."""
        self._reference, self._period = task.path, task.sampling_time_s
        self._position, self._velocity = task.path.position_m, task.path.velocity_m_s
        self._mean_acceleration = np.diff(self._velocity, axis=0) / task.sampling_time_s
        self._wheels = AccelerationToWheels(task.robot, task.sampling_time_s, task.nsim)
        self._v: FloatArray | float = np.nan

    def command(self, k: int, estimate: Estimate) -> Command:
        """One sample of the law on the estimated position and velocity of P."""
        e, e_rate, v = self._law(k, estimate.state)
        command = self._wheels.command(v, estimate.state)
        return replace(command, signals=self._signals(e, e_rate))

    def _signals(self, e: FloatArray, e_rate: FloatArray) -> dict[str, FloatArray]:
        """V, its slope since the last sample, and what the article claims of V'."""
        v, claimed = lyapunov_function(e, e_rate, self._options)
        slope, self._v = (v - self._v) / self._period, v
        names = ("lyapunov_v", "lyapunov_v_rate_1_s", "lyapunov_v_rate_eq36_1_s")
        return dict(zip(names, (v, slope, claimed), strict=True))

    def _law(self, k: int, state: RobotState) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(e1, e3), (e2, e4) and (v1, v2) of Eq. 32, (nsim, 2) each."""
        e = state.q[:, :2] - self._position[k]
        e_rate = state.q_rate[:, :2] - self._velocity[k]
        return e, e_rate, law(e, e_rate, self._mean_acceleration[k], self._options)


class LyapunovOptions(ControllerOptions):
    """The article's law (32) for the tractor alone, gains of Table II."""

    law = Lyapunov
    takes_stacks: ClassVar[bool] = True
    tows_trains: ClassVar[bool] = True
    kind: Literal["lyapunov"] = "lyapunov"
    alpha1: float = Field(
        default=25.0,
        ge=1e-12,
        le=1e6,
        description="gain α1 of the error e1 = x − x_d; Table II: 25",
    )
    alpha2: float = Field(
        default=10.0,
        ge=1e-12,
        le=1e6,
        description="gain α2 of the error e2 = ẋ − ẋ_d; Table II: 10",
    )
    alpha3: float = Field(
        default=25.0,
        ge=1e-12,
        le=1e6,
        description="gain α3 of the error e3 = y − y_d; Table II: 25",
    )
    alpha4: float = Field(
        default=10.0,
        ge=1e-12,
        le=1e6,
        description="gain α4 of the error e4 = ẏ − ẏ_d; Table II: 10",
    )
    singular_terms: Literal["omitted", "regularized", "published"] = Field(
        default="omitted",
        description="treatment of e1²/e2 and e3²/e4, whose singularity Theorem 1 overlooks",
    )
    regularization_m_s: float = Field(
        default=0.01,
        ge=1e-12,
        le=10,
        description="ε in e1²·e2/(e2² + ε²), if singular_terms is regularized; typically 0.01",
    )
