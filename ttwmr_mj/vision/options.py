"""What the camera is and what goes wrong with it: every part can be switched on by itself.

Light is a share of the sensor's full scale, so 0.02 of noise is 2 %, or 5 of 255 grey levels.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ttwmr_mj.files import input_file
from ttwmr_mj.robot import Config

CALIBRATION = "make it with ttwmr calibrate, or leave the key out to calibrate before the run"

# TOML has arrays where Python has tuples; their elements stay strict
Pair = Annotated[tuple[float, float], Field(strict=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
LabelName = Literal["tractor_front", "tractor_rear", "trailer_front", "trailer_rear"]
END_S = 3600.0


class Lens(Config):
    """Brown-Conrady distortion, where the optical axis meets the sensor, and focus."""

    k1: float = Field(default=0.0, ge=-1, le=1, description="radial, r²; negative is a barrel")
    k2: float = Field(default=0.0, ge=-1, le=1, description="radial, r⁴")
    p1: float = Field(default=0.0, ge=-0.1, le=0.1, description="tangential")
    p2: float = Field(default=0.0, ge=-0.1, le=0.1, description="tangential")
    k3: float = Field(default=0.0, ge=-1, le=1, description="radial, r⁶")
    principal_offset_px: Pair = Field(
        default=(0.0, 0.0), description="optical axis from the picture's centre: right, down"
    )
    defocus_px: float = Field(default=0.0, ge=0, le=20, description="Gaussian standard deviation")


class Exposure(Config):
    """How long the shutter is open; a frame's time is the middle of its exposure."""

    exposure_s: float = Field(default=0.0, ge=0, le=1, description="0: no motion blur")
    blur_step_px: float = Field(
        default=0.4, gt=0, le=10, description="motion between two of the averaged instants"
    )


class Noise(Config):
    """What the electronics add."""

    read_noise: Share = Field(default=0.0, description="standard deviation, at any light")
    shot_noise: Share = Field(
        default=0.0, description="standard deviation at full scale; goes with the root of light"
    )
    gain_drift: Share = Field(default=0.0, description="standard deviation of the slow gain")
    white_balance_drift: Share = Field(
        default=0.0, description="standard deviation of each channel's slow gain"
    )
    drift_time_s: float = Field(default=5.0, gt=0, le=END_S, description="correlation time")


class Window(Config):
    """A stretch of simulated time."""

    start_s: float = Field(default=0.0, ge=0, le=END_S)
    end_s: float = Field(default=END_S, ge=0, le=END_S)

    def contains(self, time_s: float) -> bool:
        """Whether a time lies in [start_s, end_s)."""
        return self.start_s <= time_s < self.end_s


class Occluder(Window):
    """Something opaque between camera and floor: it crosses, or it rides above one half."""

    over: Literal["path", "tractor", "trailer"] = Field(
        default="path", description="path: from from_m to to_m; else above that half's labels"
    )
    from_m: Pair = Field(default=(-1.0, 0.0), description="x, y in the label plane at start_s")
    to_m: Pair = Field(default=(1.0, 0.0), description="x, y in the label plane at end_s")
    diameter_m: float = Field(default=0.25, gt=0, le=5)
    grey: Share = Field(default=0.2, description="its brightness")


class Glare(Window):
    """A bright spot with soft edges that washes colours out."""

    position_px: Pair = Field(default=(320.0, 240.0), description="column, row of its centre")
    radius_px: float = Field(default=40.0, gt=0, le=1000, description="standard deviation")
    strength: float = Field(default=1.0, ge=0, le=10, description="light added at the centre")


class Distractor(Config):
    """A disc on the floor that has a label's colour."""

    colour_of: LabelName = "tractor_front"
    position_m: Pair = Field(default=(0.7, 0.5), description="x, y on the floor")
    diameter_m: float = Field(default=0.036, gt=0, le=1, description="a label measures 0.036")


class FadedLabel(Config):
    """A label bleached by the sun."""

    label: LabelName
    fading: Share = Field(default=0.5, description="0 as new, 1 grey")


class Delivery(Config):
    """Frames that do not come, come again, or come late."""

    dropped: Share = Field(default=0.0, description="share of frames lost")
    frozen: Share = Field(default=0.0, description="share of frames that repeat the last one")
    late: Share = Field(default=0.0, description="share of frames that come late")
    late_periods: int = Field(default=1, ge=1, le=30, description="how late: control periods")
    blackouts: Annotated[tuple[Window, ...], Field(strict=False)] = Field(
        default=(), description="stretches without any frame"
    )


class Faults(Config):
    """What goes wrong."""

    delivery: Delivery = Delivery()
    occluders: Annotated[tuple[Occluder, ...], Field(strict=False)] = ()
    glare: Annotated[tuple[Glare, ...], Field(strict=False)] = ()
    distractors: Annotated[tuple[Distractor, ...], Field(strict=False)] = ()
    faded: Annotated[tuple[FadedLabel, ...], Field(strict=False)] = ()


class CameraOptions(Config):
    """The overhead camera with its sensor model."""

    name: str = Field(default="overhead", description="of the camera in the scene file")
    height_m: float | None = Field(
        default=None, gt=0.2, le=20, description="above the floor; left out: as in the scene file"
    )
    width_px: int = Field(default=640, ge=64, le=4096)
    height_px: int = Field(default=480, ge=64, le=4096)
    supersampling: Literal[1, 2, 3, 4, 5] = Field(
        default=3, description="rendered pixels along one sensor pixel"
    )
    lens: Lens = Lens()
    exposure: Exposure = Exposure()
    noise: Noise = Noise()
    faults: Faults = Faults()


class TrackerOptions(Config):
    """How labels are looked for and fused with the commanded wheel speeds."""

    label_noise_px: float = Field(
        default=0.0225, gt=0, le=10, description="standard deviation of a label's centre, one axis"
    )
    calibration_noise_m: float = Field(
        default=0.00003, ge=0, le=1, description="standard deviation of what calibration left over"
    )
    speed_noise_m_s: float = Field(
        default=0.003, gt=0, le=10, description="how far P's speed strays from the wheels'"
    )
    turn_noise_rad_s: float = Field(
        default=0.02, gt=0, le=100, description="how far the turn rate strays from the wheels'"
    )
    noise_time_s: float = Field(default=0.3, gt=0, le=END_S, description="how long it strays")
    swing_noise_rad_s2: float = Field(
        default=0.5, gt=0, le=1e3, description="angular acceleration the hitch model lacks"
    )
    gate_chi2: float = Field(
        default=18.4, gt=0, le=1e3, description="largest squared normalised innovation of a label"
    )
    max_blind_s: float = Field(
        default=0.15, gt=0, le=60, description="longer without labels and the estimate is invalid"
    )
    max_position_std_m: float = Field(
        default=0.02, gt=0, le=10, description="more uncertain and the estimate is invalid"
    )
    max_angle_std_rad: float = Field(
        default=0.2, gt=0, le=10, description="more uncertain and the estimate is invalid"
    )


LAB_LENS = Lens(
    k1=-0.12,
    k2=0.05,
    p1=0.0006,
    p2=-0.0004,
    principal_offset_px=(3.2, -2.1),
    defocus_px=0.6,
)
LAB_NOISE = Noise(read_noise=0.018, shot_noise=0.012, gain_drift=0.02, white_balance_drift=0.01)
# two by two rendered pixels are enough behind its blur: P's rms error is 0.050 mm, not 0.043 mm
# as with three by three (500 poses)
LAB_CAMERA = CameraOptions(
    supersampling=2,
    lens=LAB_LENS,
    exposure=Exposure(exposure_s=0.008, blur_step_px=0.75),
    noise=LAB_NOISE,
)
PRESETS = {"lab": LAB_CAMERA, "clean": CameraOptions()}


class CameraSensing(Config):
    """The robot seen by the overhead camera, and by nothing else."""

    kind: Literal["camera"]
    preset: Literal["lab", "clean"] = Field(
        default="lab", description="camera values that are not given: lab-like, or flawless"
    )
    latency_s: float = Field(
        default=0.033, ge=0, le=10, description="shutter to arrival, whole control periods"
    )
    calibration_path: Annotated[str, input_file(CALIBRATION)] | None = Field(
        default=None,
        description="file of `ttwmr calibrate`, relative to the scenario; left out: the camera "
        "is calibrated before the run, through the same sensor model",
    )
    camera: CameraOptions = LAB_CAMERA
    tracker: TrackerOptions = TrackerOptions()

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict) or given.get("preset", "lab") not in PRESETS:
            return given
        camera = given.get("camera", {})
        if not isinstance(camera, dict):
            return given
        base = PRESETS[given.get("preset", "lab")].model_dump()
        return {**given, "camera": _merge(base, camera)}


def _merge(base: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """`base` with the given values put in, table by table."""
    merged = dict(base)
    for key, value in given.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        merged[key] = _merge(base[key], value) if both else value
    return merged
