"""What the vision tests share: one model, one lab calibration, one way to drive."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np

from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate_virtual
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions, Faults
from ttwmr_mj.vision.camera.rendering.drawn import build_drawn_model
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera

ROBOT = RobotParameters()


@cache
def model() -> mujoco.MjModel:
    return build_drawn_model(ROBOT, ContactOptions())


@cache
def lab_calibration() -> Calibration:
    return calibrate_virtual(LAB_CAMERA, np.random.default_rng(5))


def camera(
    options: CameraOptions | None = None, seed: int = 0, *, segmentation: bool = False
) -> VirtualCamera:
    rng = np.random.default_rng(seed)
    return VirtualCamera(options or CameraOptions(), model(), rng, segmentation=segmentation)


def with_faults(base: CameraOptions, **faults: object) -> CameraOptions:
    return base.model_copy(update={"faults": Faults.model_validate(faults)})


def random_pose(rng: np.random.Generator) -> FloatArray:
    radius, around = 0.43 * np.sqrt(rng.random()), rng.uniform(-np.pi, np.pi)
    theta1 = rng.uniform(-np.pi, np.pi)
    return np.array(
        [radius * np.cos(around), radius * np.sin(around), theta1, theta1 + rng.uniform(-2.0, 2.0)]
    )
