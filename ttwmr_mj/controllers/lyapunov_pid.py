"""The article's Lyapunov-PID law (Eq. 47-48, 60-61, 68-71): law (32) plus a correction for θ2.

The tractor's law v (Eq. 32) is turned by a scalar γ (Eq. 55),

    v̄1 = v1 + α4·e4·γ        v̄2 = v2 − α2·e2·γ

which cancels in V' of Eq. 50 whatever γ is. Put into Eq. 24 it gives, with Eq. 58's sign corrected,

    k·θ̈2 = A − D·γ,   A = −v1·sin θ2 + v2·cos θ2,   D = α4·e4·sin θ2 + α2·e2·cos θ2

so γ = (A − k·w)/D makes θ̈2 = w. What the article leaves open (w, 1/D, limits, θ2d) is an option;
the defaults are as printed, except for `singular_terms` (`controllers.lyapunov`).

Two facts to know before use. The correction rotates (e2, e4) at the rate α·γ, for α2 = α4 = α, and
is zero where e2 = e4 = 0: it cannot move the trailer of a tractor that tracks. And with γ exact the
direction of (e2, e4) runs into D = 0, where the solution ends (docs/theory/errata.md).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.config import each
from ttwmr_mj.controllers.base import Command, Task, undefined_theta2
from ttwmr_mj.controllers.lyapunov import Lyapunov, LyapunovOptions, gains
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import THETA1, THETA2, BoolArray, FloatArray, RobotState, wrap


def denominator(
    e_rate: FloatArray, theta2_rad: FloatArray, options: LyapunovPidOptions
) -> FloatArray:
    """D = α4·e4·sin θ2 + α2·e2·cos θ2 (Eq. 48), (...), of e_rate = (e2, e4) (..., 2) [m/s²]."""
    weighted = gains(options)[0] * e_rate
    return np.asarray(weighted[..., 1] * np.sin(theta2_rad) + weighted[..., 0] * np.cos(theta2_rad))


def sideways(v: FloatArray, theta2_rad: FloatArray) -> FloatArray:
    """A = −v1·sin θ2 + v2·cos θ2, (...): P's acceleration across the trailer [m/s²]."""
    return np.asarray(v[..., 1] * np.cos(theta2_rad) - v[..., 0] * np.sin(theta2_rad))


def pid_acceleration(
    error_rad: FloatArray,
    error_rate_rad_s: FloatArray,
    integral_rad_s: FloatArray,
    feedforward_rad_s2: FloatArray | float,
    options: LyapunovPidOptions,
) -> FloatArray:
    """Wanted θ̈2, w of Eq. 62, (...) [rad/s²], of e5 = θ2 − θ2d (Eq. 63), its rate, its integral."""
    return np.asarray(
        feedforward_rad_s2
        - options.k_d * error_rate_rad_s
        - options.k_p * error_rad
        - options.k_i * integral_rad_s
    )


def spring_push(
    hitch_angle_rad: FloatArray, hitch_rate_rad_s: FloatArray, options: LyapunovPidOptions
) -> FloatArray:
    """k_t·(θ1 − θ2) + c_t·(θ̇1 − θ̇2) of Eq. 59-60, (...), added to k·θ̈2 as Eq. 41 prints it."""
    return np.asarray(-options.k_t * hitch_angle_rad - options.c_t * hitch_rate_rad_s)


def gamma(
    excess: FloatArray, d: FloatArray, options: LyapunovPidOptions
) -> tuple[FloatArray, BoolArray]:
    """γ for an excess A − k·w (Eq. 48, 61, 71), and where it was cut; exact D = 0 counts as γ = 0.

    Args:
        excess: (...) what the correction shall take from k·θ̈2 [m/s²].
        d: (...) D of Eq. 48 [m/s²].
        options: how to divide, and the limit.

    Returns:
        γ (...) [no unit, but for "constant", where ρ carries that of 1/D], cut or not (...).
    """
    if options.gamma == "constant":
        wish = options.rho * excess
    elif options.gamma == "regularized":
        wish = excess * d / (d * d + each(_regularization, options))
    else:
        wish = np.divide(excess, d, out=np.zeros_like(excess), where=d != 0.0)
    limit = np.inf if options.gamma_limit is None else options.gamma_limit
    return np.clip(wish, -limit, limit), np.abs(wish) > limit


def _regularization(options: LyapunovPidOptions) -> float:
    """ε² of the regularised γ."""
    return options.gamma_regularization_m_s2**2


def corrected(
    v: FloatArray, e_rate: FloatArray, gamma_: FloatArray, options: LyapunovPidOptions
) -> FloatArray:
    """v̄ = v + γ·(α4·e4, −α2·e2) (Eq. 49, 55), all (..., 2) but γ (...) [m/s²]."""
    weighted = gains(options)[0] * e_rate
    turned = np.stack([weighted[..., 1], -weighted[..., 0]], axis=-1)
    return np.asarray(v + gamma_[..., None] * turned)


class LyapunovPid(Lyapunov):
    """Laws (47) and (70) and the map of Eq. 27-28 to wheel speeds.

    The integral of e5 is advanced by the rectangle rule. e5 is taken on the circle, in [−π, π);
    where the reference defines no θ2d the correction pauses.
    """

    _options: LyapunovPidOptions

    def start(self, task: Task) -> None:
        """Take the reference."""
        super().start(task)
        self._length = task.robot.swing_length_m
        self._integral: FloatArray = np.zeros(task.nsim)

    def command(self, k: int, estimate: Estimate) -> Command:
        """One sample of the law on the estimated state."""
        options, state = self._options, estimate.state
        e, e_rate, v = self._law(k, state)
        theta2 = state.q[:, THETA2]
        if options.correction == "pid":
            error, error_rate, feedforward = self._theta2_error(k, state)
            wanted = pid_acceleration(error, error_rate, self._integral, feedforward, options)
            excess = sideways(v, theta2) - self._length * wanted
        else:
            error = np.zeros_like(theta2)
            hitch_rate = state.q_rate[:, THETA2] - state.q_rate[:, THETA1]
            excess = -spring_push(state.hitch_angle_rad, hitch_rate, options)
        undefined = np.isnan(excess)
        excess = np.where(undefined, 0.0, excess)
        gamma_, cut = gamma(excess, denominator(e_rate, theta2, options), options)
        command = self._wheels.command(corrected(v, e_rate, gamma_, options), state)
        hold = undefined
        if options.anti_windup == "conditional":
            hold = hold | cut | command.saturated
        self._integral = self._integral + np.where(hold, 0.0, self._period * error)
        return replace(command, signals=self._signals(e, e_rate))

    def _theta2_error(
        self, k: int, state: RobotState
    ) -> tuple[FloatArray, FloatArray, FloatArray | float]:
        """e5 (Eq. 63) on the circle, its rate, and θ̈2d, (nsim,) each; NaN where undefined."""
        reference = self._reference
        angle, rate = state.q[:, THETA2], state.q_rate[:, THETA2]
        if self._options.theta2_reference == "tractor":
            return wrap(angle - state.q[:, THETA1]), rate - state.q_rate[:, THETA1], 0.0
        return (
            wrap(angle - reference.theta2_rad[k]),
            rate - reference.theta_rate[k, :, 1],
            reference.theta_acceleration[k, :, 1],
        )


class LyapunovPidOptions(LyapunovOptions):
    """The article's Lyapunov-PID: law (32) and a correction for θ2.

    Laws (47) and (70) with the gains of Table II.
    """

    law = LyapunovPid
    kind: Literal["lyapunov_pid"] = "lyapunov_pid"  # type: ignore[assignment]  # the tag of another law
    correction: Literal["pid", "spring_damper"] = Field(
        default="pid",
        description="the desired θ̈2: PID about θ2d (Eq. 62), or a virtual spring and damper "
        "(Eq. 60)",
    )
    gamma: Literal["exact", "constant", "regularized"] = Field(
        default="constant",
        description="what replaces 1/D: nothing (Eq. 48), constant ρ (Eq. 69-71), or D/(D² + ε²)",
    )
    rho: float = Field(default=2.5, ge=-1e6, le=1e6, description="ρ of Eq. 69; Table II: 2.5")
    gamma_regularization_m_s2: float = Field(
        default=0.1,
        ge=1e-12,
        le=1e3,
        description="ε in D/(D² + ε²), if gamma is regularized; typically 0.1",
    )
    gamma_limit: float | None = Field(
        default=None, ge=1e-12, le=1e12, description="largest |γ|; default: no limit"
    )
    k_p: float = Field(
        default=48.0, ge=0, le=1e6, description="proportional gain [1/s²]; Table II: 48"
    )
    k_i: float = Field(default=64.0, ge=0, le=1e6, description="integral gain [1/s³]; Table II: 64")
    k_d: float = Field(
        default=12.0, ge=0, le=1e6, description="derivative gain [1/s]; Table II: 12"
    )
    k_t: float = Field(
        default=200.0,
        ge=0,
        le=1e6,
        description="stiffness of the virtual spring of Eq. 60; Table II: 200",
    )
    c_t: float = Field(
        default=200.0,
        ge=0,
        le=1e6,
        description="coefficient of the virtual damper of Eq. 60; Table II: 200",
    )
    theta2_reference: Literal["reference", "tractor"] = Field(
        default="reference",
        description="θ2d: the reference's θ2, or the tractor's θ1 with its rate",
    )
    anti_windup: Literal["none", "conditional"] = Field(
        default="none",
        description="conditional: the integral is held while γ is limited or a wheel saturates",
    )

    def path_faults(self, reference: Reference, path: ReferencePath) -> list[Fault]:
        """A PID about θ2d needs a θ2d somewhere."""
        if self.correction != "pid" or self.theta2_reference != "reference":
            return []
        if not np.isnan(path.theta2_rad).all():
            return []
        return [
            undefined_theta2(
                reference,
                "everywhere; controller.theta2_reference = 'reference' needs it",
                "give 'aligned' or 'outward' here, or 'tractor' there",
            )
        ]
