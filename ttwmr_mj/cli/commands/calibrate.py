"""`ttwmr calibrate`: a camera, simulated or real, and the board to calibrate it with."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Overrides


class Calibrate(Overrides, name="calibrate"):
    """Calibrate a camera with a ChArUco board."""

    scenario: str = argument("scenario whose simulated camera sees the board", "lab_circle_camera")
    images: Path | None = option(
        "a real camera's pictures instead: DIR/held, DIR/origin and DIR/flat", metavar="DIR"
    )
    board: Path | None = option("write the board to print, and nothing else", metavar="PNG")
    out: Path = option("the calibration", Path("calibration.yaml"), metavar="YAML")

    def __call__(self) -> int:
        from ttwmr_mj.studies.calibrate import (
            calibrate_from_images,
            calibrate_scenario,
            write_board,
        )
        from ttwmr_mj.vision.calibration.file import save_calibration

        if self.board is not None:
            write_board(self.board)
            return 0
        if self.images is not None:
            calibration = calibrate_from_images(self.images)
        else:
            calibration = calibrate_scenario(self.load(self.scenario))
        save_calibration(calibration, self.out)
        print(
            f"{calibration.views} views, rms reprojection error "
            f"{calibration.reprojection_rms_px:.3f} px, on the floor "
            f"{calibration.floor_rms_px:.3f} px\nwritten to {self.out}"
        )
        return 0
