"""A scenario's camera made ready: calibrated first, then put into the loop."""

from __future__ import annotations

from pathlib import Path

import cv2
import mujoco
import numpy as np

from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate_virtual
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.camera.options import CameraOptions, Faults
from ttwmr_mj.vision.options import CameraSensing
from ttwmr_mj.vision.sensor import CameraSensor, JointPositions


def make_camera_sensor(
    section: CameraSensing,
    model: mujoco.MjModel,
    believed: RobotParameters,
    rng: np.random.Generator,
    folder: Path,
    *,
    period_s: float,
    nsim: int,
    joint_positions: JointPositions,
    segmentation: bool,
) -> CameraSensor:
    """A scenario's camera in the loop.

    Args:
        section: the camera, its tracker and its latency.
        model: the scene with the robot that is seen, as of `plants.mjcf.build_model`.
        believed: what the tracker takes the robot to be.
        rng: source of the calibration's and the camera's noise.
        folder: where a calibration file is looked for.
        period_s: control period.
        nsim: simulations in the batch.
        joint_positions: of the plant whose joints are seen.
        segmentation: whether frames carry the class of every pixel.

    Raises:
        InputError: the calibration cannot be used, or the scene lacks a part.
        MachineError: no OpenGL.
    """
    # camera and loop keep two cores busy; parting a strip of a picture among more threads costs
    # more time than it saves
    cv2.setNumThreads(1)
    calibration_rng, camera_rng = rng.spawn(2)
    return CameraSensor(
        section.camera,
        section.tracker,
        find_calibration(section, calibration_rng, folder).camera,
        believed,
        model,
        period_s=period_s,
        latency_s=section.latency_s,
        nsim=nsim,
        rng=camera_rng,
        joint_positions=joint_positions,
        segmentation=segmentation,
    )


def find_calibration(section: CameraSensing, rng: np.random.Generator, folder: Path) -> Calibration:
    """The named calibration file, or else a calibration of the simulated camera, made now.

    Raises:
        InputError: the file cannot be used, or is for another resolution.
    """
    if section.calibration_path is None:
        return calibrate_virtual(without_faults(section.camera), rng)
    size = (section.camera.width_px, section.camera.height_px)
    return load_calibration(folder / section.calibration_path, size)


def without_faults(options: CameraOptions) -> CameraOptions:
    """The camera on a good day, which is when one calibrates."""
    return options.model_copy(update={"faults": Faults()})
