"""What `ttwmr calibrate` does: a board shown to a simulated or a real camera."""

from __future__ import annotations

from pathlib import Path

import cv2

from ttwmr_mj.errors import InputError
from ttwmr_mj.runs.build import generators
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.vision.calibration.board import board_print
from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate_images, calibrate_virtual
from ttwmr_mj.vision.options import CameraSensing
from ttwmr_mj.vision.setup import without_faults

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def calibrate_scenario(scenario: Scenario) -> Calibration:
    """Show the board to a scenario's simulated camera.

    Raises:
        InputError: the scenario has no camera, or the board was not found often enough.
        MachineError: no OpenGL.
    """
    if not isinstance(scenario.sensing, CameraSensing):
        raise InputError.at(
            "sensing.kind",
            f"{scenario.name} has no camera to calibrate",
            got=repr(scenario.sensing.kind),
            hint="add --set sensing.kind=camera, or give a scenario with a camera",
        )
    rng = generators(scenario.seed, ("calibration",))["calibration"]
    return calibrate_virtual(without_faults(scenario.sensing.camera), rng)


def calibrate_from_images(folder: Path) -> Calibration:
    """Calibrate from a real camera's pictures of the board.

    Args:
        folder: holds held/ (the board in the hand, tilted, all over the picture), origin/ (flat
            on the floor, where the world's origin shall be, long side along x) and flat/ (flat,
            anywhere; may be absent).

    Raises:
        InputError: no pictures, pictures that cannot be read, or too few boards in them.
    """
    held, origin, flat = (_pictures(folder / name) for name in ("held", "origin", "flat"))
    if not held or not origin:
        raise InputError.at(
            "--images",
            f"needs pictures in {folder / 'held'} (got {len(held)}) and in "
            f"{folder / 'origin'} (got {len(origin)})",
            allowed=", ".join(PICTURES),
        )
    return calibrate_images(held, origin, flat)


def write_board(path: Path) -> None:
    """Write the board as a picture to print.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        written = cv2.imwrite(str(path), board_print())
    except cv2.error:  # no such format
        written = False
    if not written:
        raise InputError.at(
            "--board", f"{path} cannot be written", hint="give a .png in an existing folder"
        )


def _pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURES)
