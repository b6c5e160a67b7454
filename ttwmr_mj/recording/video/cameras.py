"""Where a video is seen from: behind the robot, calmly."""

from collections.abc import Callable

import numpy as np

from ttwmr_mj.plants.engine import mujoco
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.state import THETA1, FloatArray

CALM_S = 1.2  # over how long the chasing camera turns
DISTANCE_M, ELEVATION_DEG = 0.5, -28.0

Camera = Callable[[int], mujoco.MjvCamera]


def chase(footage: Footage) -> Camera:
    """Behind the robot, a little aside, and calm: it turns slower than the robot does."""
    q = footage.q
    step_s = float(footage.time_s[1] - footage.time_s[0]) if len(q) > 1 else 1.0
    heading = _calm(q[:, THETA1], CALM_S / step_s)
    place = np.column_stack([_calm(q[:, i], 0.25 * CALM_S / step_s) for i in range(2)])
    scale = footage.scenario.robot.looks_scale
    back = 0.09 * scale * np.column_stack([np.cos(heading), np.sin(heading)])

    def at(frame: int) -> mujoco.MjvCamera:
        return _camera(
            (*(place - back)[frame], 0.03 * scale),
            DISTANCE_M * scale,
            float(np.degrees(heading[frame])) - 32.0,
            ELEVATION_DEG,
        )

    return at


def _camera(
    look_at: tuple[float, ...], distance_m: float, azimuth_deg: float, elevation_deg: float
) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = look_at
    camera.distance, camera.azimuth, camera.elevation = distance_m, azimuth_deg, elevation_deg
    return camera


def _calm(values: FloatArray, width: float) -> FloatArray:
    """Smoothed by a bell of that many frames, to both sides."""
    reach = int(np.ceil(3.0 * width))
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(width, 1e-9)) ** 2)
    padded = np.pad(values, reach, mode="edge")
    return np.convolve(padded, bell / bell.sum(), mode="valid")
