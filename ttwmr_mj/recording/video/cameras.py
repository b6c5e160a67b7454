"""Where a video is seen from: behind the robot, calmly."""

from collections.abc import Callable

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.state import THETA1, THETA2, FloatArray

CALM_S = 1.2  # over how long the chasing camera turns
DISTANCE_M, ELEVATION_DEG = 0.5, -28.0
LONGER = 1.0  # farther away by so much of what a train is longer than one trailer

Camera = Callable[[int], mujoco.MjvCamera]


def chase(footage: Footage) -> Camera:
    """Behind the robot, a little aside, and calm: it turns slower than the robot does."""
    q, robot = footage.q, footage.scenario.robot
    step_s = float(footage.time_s[1] - footage.time_s[0]) if len(q) > 1 else 1.0
    heading = _calm(q[:, THETA1], CALM_S / step_s)
    tows_m = [trailer.next_hitch_offset_m or 0.0 for trailer in robot.trailers[:-1]]
    middle = q[:, :2].copy()  # between P and the last hitch
    for tow_m, angle in zip(tows_m, q[:, THETA2:].T, strict=False):
        middle -= 0.5 * tow_m * np.column_stack([np.cos(angle), np.sin(angle)])
    place = np.column_stack([_calm(middle[:, i], 0.25 * CALM_S / step_s) for i in range(2)])
    scale = robot.looks_scale
    back = 0.09 * scale * np.column_stack([np.cos(heading), np.sin(heading)])

    def at(frame: int) -> mujoco.MjvCamera:
        return _camera(
            (*(place - back)[frame], 0.03 * scale),
            DISTANCE_M * scale + LONGER * sum(tows_m),
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
