"""`ttwmr calibrate`: a camera, simulated or real, and the board to calibrate it with."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import NewFiles, Overrides
from ttwmr_mj.errors import InputError

LAB, OUT = "lab_circle_camera", Path("calibration.yaml")


class Calibrate(Overrides, NewFiles, name="calibrate"):
    """Calibrate a camera with a ChArUco board."""

    scenario: str = argument("scenario whose simulated camera is calibrated", LAB)
    images: Path | None = option(
        "use a real camera's pictures in DIR/held, DIR/origin and DIR/flat instead", metavar="DIR"
    )
    board: Path | None = option(
        "only write the board as an image, to print at true size on A2: a square is 80 mm wide",
        metavar="PNG",
    )
    out: Path = option("file for the calibration", OUT, metavar="YAML")

    def __call__(self) -> int:
        from ttwmr_mj.studies.calibrate import (
            calibrate_from_images,
            calibrate_scenario,
            write_board,
        )
        from ttwmr_mj.vision.calibration.board import SQUARE_M
        from ttwmr_mj.vision.calibration.file import save_calibration

        if self.board is not None:
            files = {"--images": self.images is not None, "--out": self.out != OUT}
            self._refuse_beside("--board", files | self._of_scenario())
            self.refuse_to_replace("--board", self.board)
            write_board(self.board)
            print(
                f"written to {self.board}\nprint it at 100 %, on A2 or larger, and measure a "
                f"square: it must be {1e3 * SQUARE_M:.0f} mm wide"
            )
            return 0
        self.refuse_to_replace("--out", self.out)
        if self.images is not None:
            self._refuse_beside("--images", self._of_scenario())
            calibration, unused = calibrate_from_images(self.images)
            if unused:
                print(f"too little of the board is seen in {', '.join(map(str, unused))}")
        else:
            calibration = calibrate_scenario(self.load(self.scenario))
        save_calibration(calibration, self.out)
        print(
            f"{calibration.views} views, rms reprojection error "
            f"{calibration.reprojection_rms_px:.3f} px, of boards on the floor "
            f"{calibration.floor_rms_px:.3f} px\nwritten to {self.out}"
        )
        return 0

    def _of_scenario(self) -> dict[str, bool]:
        """Which words name the simulated camera, and whether they were given."""
        return {
            "SCENARIO": self.scenario != LAB,
            "--set": bool(self.overrides),
            "--fragment": bool(self.fragments),
            "--seed": self.seed is not None,
        }

    @staticmethod
    def _refuse_beside(option: str, given: dict[str, bool]) -> None:
        if unused := [name for name, is_given in given.items() if is_given]:
            problem = f"{', '.join(unused)} would not be used"
            raise InputError.at(option, problem, hint="leave one or the other out")
