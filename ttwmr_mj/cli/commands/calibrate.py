"""`ttwmr calibrate`: a camera, simulated or real, and the board to calibrate it with."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Overrides
from ttwmr_mj.errors import InputError


class Calibrate(Overrides, name="calibrate"):
    """Calibrate a camera with a ChArUco board."""

    scenario: str = argument("scenario whose simulated camera is calibrated", "lab_circle_camera")
    images: Path | None = option(
        "use a real camera's pictures in DIR/held, DIR/origin and DIR/flat instead", metavar="DIR"
    )
    board: Path | None = option("only write the board as an image to print", metavar="PNG")
    out: Path = option("file for the calibration", Path("calibration.yaml"), metavar="YAML")

    def __call__(self) -> int:
        from ttwmr_mj.studies.calibrate import (
            calibrate_from_images,
            calibrate_scenario,
            write_board,
        )
        from ttwmr_mj.vision.calibration.file import save_calibration

        if self.board is not None:
            if self.images is not None:
                problem = "writes the board only; give --images by itself"
                raise InputError.at("--board", problem)
            write_board(self.board)
            return 0
        if self.images is not None:
            calibration = calibrate_from_images(self.images)
        else:
            calibration = calibrate_scenario(self.load(self.scenario))
        save_calibration(calibration, self.out)
        print(
            f"{calibration.views} views, rms reprojection error "
            f"{calibration.reprojection_rms_px:.3f} px, of boards on the floor "
            f"{calibration.floor_rms_px:.3f} px\nwritten to {self.out}"
        )
        return 0
