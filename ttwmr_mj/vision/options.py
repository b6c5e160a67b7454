"""The scenario's table for sensing by camera."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ttwmr_mj.files import input_file
from ttwmr_mj.robot import merged
from ttwmr_mj.sensing import SensingOptions, UpTo10
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions
from ttwmr_mj.vision.tracking.options import TrackerOptions

CALIBRATION = "make it with ttwmr calibrate, or leave the key out to calibrate before the run"
PRESETS = {"lab": LAB_CAMERA, "clean": CameraOptions()}


class CameraSensing(SensingOptions):
    """The overhead camera as the only sensor."""

    kind: Literal["camera"]
    preset: Literal["lab", "clean"] = Field(
        default="lab",
        description="where camera values that are not given come from: the laboratory's "
        "camera, or a perfect one",
    )
    latency_s: UpTo10 = Field(
        default=0.033,
        description="time from the end of the exposure to the arrival of the frame, a whole "
        "number of control periods; typically 0.033",
    )
    calibration_path: Annotated[str, input_file(CALIBRATION)] | None = Field(
        default=None,
        description="a file written by `ttwmr calibrate`, relative to the scenario; default: "
        "the camera is calibrated before the run, through the same sensor model",
    )
    camera: CameraOptions = LAB_CAMERA
    tracker: TrackerOptions = TrackerOptions()

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, given: Any) -> Any:
        preset = given.get("preset", "lab") if isinstance(given, dict) else None
        if not isinstance(preset, str) or preset not in PRESETS:
            return given
        base = PRESETS[preset].model_dump()
        return {**given, "camera": merged(base, given.get("camera", {}))}
