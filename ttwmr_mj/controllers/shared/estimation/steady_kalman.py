"""Steady Kalman gains of the observer's chains, from what it assumes about noise and model."""

import numpy as np
from pydantic import Field
from scipy.linalg import solve_discrete_are

from ttwmr_mj.robot import Config
from ttwmr_mj.state import THETA1, THETA2, FloatArray

# Prediction error of one period. The analytic plant, commands changing by up to 3 rad/s, differs by
# 1 µm, 0.03 mrad and 1e-4 rad/s; what is added keeps the gains from falling asleep.
MODEL_POSITION_STD_M = 2e-5
MODEL_ANGLE_STD_RAD = 1e-4
MODEL_RATE_STD_RAD_S = 3e-3


class ObserverOptions(Config):
    """What the observer assumes about its measurements and the model's errors.

    Standard deviations per sample, and of random walks per square root of a second. The defaults
    are those of an overhead camera; they cost little where the measurement is better than that.
    """

    position_std_m: float = Field(
        default=2e-4, ge=1e-12, le=1, description="measurement noise of x and y; typically 2e-4"
    )
    angle_std_rad: float = Field(
        default=1e-3, ge=1e-12, le=1, description="measurement noise of θ1 and θ2; typically 1e-3"
    )
    velocity_std_m_s: float = Field(
        default=0.01, ge=1e-12, le=10, description="measurement noise of ẋ and ẏ; typically 0.01"
    )
    rate_std_rad_s: float = Field(
        default=0.05, ge=1e-12, le=100, description="measurement noise of θ̇1 and θ̇2; typically 0.05"
    )
    creep_walk_m_s: float = Field(
        default=2e-3,
        ge=1e-12,
        le=10,
        description="random walk of the tyres' slip, per √s; typically 2e-3",
    )
    turn_creep_walk_rad_s: float = Field(
        default=5e-3,
        ge=1e-12,
        le=10,
        description="random walk of the heading's slip, per √s; typically 5e-3",
    )
    swing_walk_rad_s2: float = Field(
        default=0.05,
        ge=1e-12,
        le=100,
        description="random walk of the unexplained θ̈2, per √s; typically 0.05",
    )


def chain_gains(options: ObserverOptions, period_s: float) -> FloatArray:
    """(3, 2, 4) steady gains on the value, its slope and the slope's unexplained change.

    The second axis is the innovation, of value and slope; the third is x, y, θ1, θ2. Slopes of the
    first three are slip, that of θ2 is θ̇2; only θ̇2 has an unexplained change.
    """
    T, root = period_s, np.sqrt(period_s)
    slow = np.array([[1.0, T], [0.0, 1.0]])
    swinging = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    angle = (options.angle_std_rad, options.rate_std_rad_s)
    turn_slip = options.turn_creep_walk_rad_s * root
    gain = np.zeros((3, 2, 4))
    gain[:2, :, 0] = gain[:2, :, 1] = kalman_gain(*_place_chain(options, T))
    gain[:2, :, THETA1] = kalman_gain(slow, (MODEL_ANGLE_STD_RAD, turn_slip), angle)
    gain[:, :, THETA2] = kalman_gain(swinging, process_std(options, period_s), angle)
    return gain


def process_std(options: ObserverOptions, period_s: float) -> tuple[float, float, float]:
    """What a period adds to θ2, θ̇2 and the unexplained θ̈2, as standard deviations."""
    return (
        MODEL_ANGLE_STD_RAD,
        MODEL_RATE_STD_RAD_S,
        float(options.swing_walk_rad_s2 * np.sqrt(period_s)),
    )


def kalman_gain(
    A: FloatArray, process_std: tuple[float, ...], measurement_std: tuple[float, ...]
) -> FloatArray:
    """(n, m) steady gain on the innovation of the first m states, all measured directly."""
    return _steady(A, process_std, measurement_std)[0]


def slip_std(options: ObserverOptions, period_s: float) -> float:
    """Standard deviation of the slip of P that is found, in every direction [m/s]."""
    A, process, noise = _place_chain(options, period_s)
    return float(np.sqrt(_steady(A, process, noise)[1][1, 1]))


def _place_chain(
    options: ObserverOptions, period_s: float
) -> tuple[FloatArray, tuple[float, float], tuple[float, float]]:
    """Chain of x or y with its slip: A, process noise, measurement noise."""
    slow = np.array([[1.0, period_s], [0.0, 1.0]])
    slip = options.creep_walk_m_s * np.sqrt(period_s)
    return slow, (MODEL_POSITION_STD_M, slip), (options.position_std_m, options.velocity_std_m_s)


def _steady(
    A: FloatArray, process_std: tuple[float, ...], measurement_std: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Steady gain (n, m), and covariance (n, n) right after a measurement."""
    n, m = len(process_std), len(measurement_std)
    C = np.eye(m, n)
    Q, R = np.diag(np.square(process_std)), np.diag(np.square(measurement_std))
    P = solve_discrete_are(A.T, C.T, Q, R)
    gain = np.asarray(P @ C.T @ np.linalg.inv(C @ P @ C.T + R))
    return gain, P - gain @ C @ P
