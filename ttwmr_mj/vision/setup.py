"""What the loop knows of its camera, before the camera is put into the loop."""

from pathlib import Path

import numpy as np

from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate_virtual
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.options import CameraSensing


def find_calibration(section: CameraSensing, rng: np.random.Generator, folder: Path) -> Calibration:
    """The named calibration file, or else a calibration of the simulated camera, made now.

    Args:
        section: the camera.
        rng: source of the noise in a calibration's pictures.
        folder: where the file is looked for.

    Raises:
        InputError: the file cannot be used, or is for another resolution.
        MachineError: no OpenGL.
    """
    if section.calibration_path is None:
        return calibrate_virtual(section.camera, rng)
    size = (section.camera.width_px, section.camera.height_px)
    return load_calibration(folder / section.calibration_path, size)
