"""The world frame as seen by a camera that was moved after its calibration."""

from copy import copy

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.results.frame import PlaneFrame
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import read_layout
from ttwmr_mj.vision.camera.model import CameraModel, hang_camera
from ttwmr_mj.vision.camera.options import CameraOptions

GRID = (16, 12)  # columns and rows of pixels at which the frame is fitted


def camera_frame(model: mujoco.MjModel, true: CameraOptions, believed: CameraOptions) -> PlaneFrame:
    """The rigid frame that best describes how a moved camera sees the world.

    Args:
        model: a scene with the robot; not changed.
        true: the camera as it is.
        believed: the camera as it was calibrated.
    """
    height_m = float(read_layout(model).height_m.mean())
    looking, taken = (hang_camera(copy(model), camera) for camera in (true, believed))
    pixels = _grid(looking)
    return PlaneFrame.fit(looking.to_plane(pixels, height_m), taken.to_plane(pixels, height_m))


def _grid(camera: CameraModel) -> FloatArray:
    """(n, 2) pixels, evenly spread over the picture."""
    columns, rows = (
        (np.arange(count) + 0.5) * side / count - 0.5
        for count, side in zip(GRID, (camera.width_px, camera.height_px), strict=True)
    )
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
