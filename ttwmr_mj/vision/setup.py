"""A scenario's camera made ready: calibrated first, then put into the loop."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from ttwmr_mj.plants.base import Plant
from ttwmr_mj.plants.mjcf import build_model
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate_virtual
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.options import CameraOptions, CameraSensing
from ttwmr_mj.vision.sensor import CameraSensor


def make_camera_sensor(
    scenario: Scenario,
    section: CameraSensing,
    plant: Plant,
    rng: np.random.Generator,
    folder: Path,
) -> CameraSensor:
    """The scenario's camera in the loop.

    Args:
        scenario: robot, control period and scene.
        section: its camera.
        plant: whose joints are seen.
        rng: source of the calibration's and the camera's noise.
        folder: where a calibration file is looked for.

    Raises:
        InputError: the calibration cannot be used, or the scene lacks a part.
        MachineError: no OpenGL.
    """
    # camera and loop keep two cores busy; parting a strip of a picture among more threads costs
    # more time than it saves
    cv2.setNumThreads(1)
    calibration_rng, camera_rng = rng.spawn(2)
    sensor = CameraSensor(
        section.camera,
        section.tracker,
        find_calibration(section, calibration_rng, folder).camera,
        scenario.robot,
        build_model(scenario.robot, scenario.plant.contact),
        period_s=scenario.control.sampling_time_s,
        latency_s=section.latency_s,
        nsim=plant.nsim,
        rng=camera_rng,
        joint_positions=plant.joint_positions,
    )
    sensor.segmentation = scenario.output.save_frames
    return sensor


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
    return options.model_copy(update={"faults": type(options.faults)()})
