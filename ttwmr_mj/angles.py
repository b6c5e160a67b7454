"""Angles on the circle: wrapping, unwrapping against a history, circular mean."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.state import FloatArray

TWO_PI = 2.0 * np.pi


def wrap(angle_rad: FloatArray) -> FloatArray:
    """The same angles in [−π, π) [rad], any shape."""
    return (angle_rad + np.pi) % TWO_PI - np.pi


def unwrap_near(angle_rad: FloatArray, previous_rad: FloatArray) -> FloatArray:
    """The representative of each angle that lies within π of the previous one [rad]."""
    return previous_rad + wrap(angle_rad - previous_rad)


def circular_mean(angle_rad: FloatArray, axis: int = -1) -> FloatArray:
    """Direction of the mean unit vector along an axis, in [−π, π] [rad]."""
    return np.asarray(
        np.arctan2(np.sin(angle_rad).mean(axis=axis), np.cos(angle_rad).mean(axis=axis))
    )
