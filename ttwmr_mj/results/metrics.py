"""From a trajectory to numbers: SI units in the names, null where a number is undefined.

`tractor_*` looks at P against its reference; `trailer_*` at the trailer's COM against
P_ref − l·(cos θ2_ref, sin θ2_ref); `centre_of_oscillation_*` at P − k·(cos θ2, sin θ2) against the
same of the reference. Names without a prefix of their own cover the whole run; `steady_*` covers
the second half of the time. Angle errors are taken on the circle, in [−π, π): a trailer that has
spun once around points where it pointed before.
"""

from __future__ import annotations

import math

import numpy as np

from ttwmr_mj.dynamics.flatness import point_behind
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, wrap

SETTLED_M = 0.01  # a run has settled when P stays this close to its reference until the end

Metrics = dict[str, float | None]


def score(trajectory: Trajectory, robot: RobotParameters) -> tuple[Metrics, ...]:
    """All metrics of every simulation, in order; a value is None where it is undefined.

    Undefined are: errors against a reference that does not exist, settling that never happens, and
    everything of a run without a single finite row.
    """
    return tuple(_score(trajectory.simulation(i), robot) for i in range(trajectory.nsim))


def _score(trajectory: Trajectory, robot: RobotParameters) -> Metrics:
    """All metrics of a batch of one."""
    time = trajectory.time_s
    q, ref = trajectory.q[:, 0], trajectory.ref_q[:, 0]
    error = np.hypot(*(q - ref)[:, :2].T)
    trailer = _distance(q, ref, robot.trailer.com_offset_m)
    oscillation = _distance(q, ref, robot.swing_length_m)
    angle = wrap((q - ref)[:, 2:])
    half = time >= 0.5 * time[-1]
    metrics: Metrics = {
        "tractor_rmse_m": _rms(error),
        "tractor_max_error_m": _max(error),
        "tractor_final_error_m": _value(error[-1]),
        "trailer_rmse_m": _rms(trailer),
        "trailer_max_error_m": _max(trailer),
        "centre_of_oscillation_rmse_m": _rms(oscillation),
        "theta1_rmse_rad": _rms(angle[:, 0]),
        "theta2_rmse_rad": _rms(angle[:, 1]),
    }
    metrics |= {
        "steady_tractor_rmse_m": _rms(error[half]),
        "steady_tractor_max_error_m": _max(error[half]),
        "steady_trailer_rmse_m": _rms(trailer[half]),
        "steady_trailer_max_error_m": _max(trailer[half]),
        "steady_centre_of_oscillation_rmse_m": _rms(oscillation[half]),
        "steady_theta1_rmse_rad": _rms(angle[half, 0]),
        "steady_theta2_rmse_rad": _rms(angle[half, 1]),
        "iae_m_s": _integral(error, time),
        "itae_m_s2": _integral(error * time, time),
        "settling_time_s": _settling_time(error, time),
    }
    return metrics | _effort(trajectory) | _estimation(trajectory)


def _effort(trajectory: Trajectory) -> Metrics:
    """What the wheels were asked for, and how often it had to be cut."""
    command, time = trajectory.wheel_command_rad_s[:, 0], trajectory.time_s
    squared = (command**2).sum(axis=1)
    return {
        "wheel_speed_max_rad_s": _max(np.abs(trajectory.wheel_speed_rad_s[:, 0]).max(axis=1)),
        "control_effort": _integral(squared, time),  # ∫ (ω_r² + ω_l²) dt [rad²/s]
        "saturated_share": float(trajectory.saturated[:, 0].mean()),
        "near_singular_share": float(trajectory.near_singular[:, 0].mean()),
    }


def _estimation(trajectory: Trajectory) -> Metrics:
    """How far what the controller saw was from the truth."""
    miss = (trajectory.est_q - trajectory.q)[:, 0]
    return {
        "estimator_position_rmse_m": _rms(np.hypot(miss[:, 0], miss[:, 1])),
        "estimator_theta1_rmse_rad": _rms(wrap(miss[:, 2])),
        "estimator_theta2_rmse_rad": _rms(wrap(miss[:, 3])),
        "blind_share": float(1.0 - trajectory.est_valid[:, 0].mean()),
    }


def _distance(q: FloatArray, ref: FloatArray, behind_m: float) -> FloatArray:
    miss = point_behind(q, behind_m) - point_behind(ref, behind_m)
    return np.asarray(np.hypot(miss[:, 0], miss[:, 1]))


def _value(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None


def _defined(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _rms(values: FloatArray) -> float | None:
    defined = _defined(values)
    return _value(np.sqrt(np.mean(defined**2))) if defined.size else None


def _max(values: FloatArray) -> float | None:
    defined = _defined(values)
    return _value(np.abs(defined).max()) if defined.size else None


def _integral(values: FloatArray, time: FloatArray) -> float | None:
    defined = np.isfinite(values)
    if not defined.any():
        return None
    return _value(float(np.trapezoid(values[defined], time[defined])))


def _settling_time(error: FloatArray, time: FloatArray) -> float | None:
    """First time after which the error stays below SETTLED_M; None if the run ends outside it."""
    if not np.isfinite(error).all() or error[-1] > SETTLED_M:
        return None
    outside = np.flatnonzero(error > SETTLED_M)
    return float(time[outside[-1] + 1]) if outside.size else float(time[0])
