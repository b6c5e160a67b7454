"""What the camera is and what goes wrong with it: every part can be switched on by itself.

Light is a share of the sensor's full scale, so 0.02 of noise is 2 %, or 5 of 255 grey levels.
"""

from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import Field

from ttwmr_mj.robot import Config, WhichTrailer

T = TypeVar("T")
# TOML has arrays where Python has tuples; their elements stay strict
Several = Annotated[tuple[T, ...], Field(strict=False, max_length=1000)]
Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
Pair = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Radial = Annotated[float, Field(ge=-1, le=1)]
Tangential = Annotated[float, Field(ge=-0.1, le=0.1)]
END_S = 3600.0  # an hour: longer than any run
Moment = Annotated[float, Field(ge=0, le=END_S)]
Side = Annotated[int, Field(ge=64, le=4096)]
Move = Annotated[float, Field(ge=-1, le=1)]
Tilt = Annotated[float, Field(ge=-0.5, le=0.5)]
Angle = Annotated[float, Field(ge=-np.pi, le=np.pi)]
MOVES = ("x_m", "y_m", "roll_rad", "pitch_rad", "yaw_rad")  # how a camera is moved
LabelName = Literal["tractor_front", "tractor_rear", "trailer_front", "trailer_rear"]


class Lens(Config):
    """Brown-Conrady distortion, where the optical axis meets the sensor, and focus."""

    k1: Radial = Field(
        default=0.0,
        description="radial distortion, r²; negative for barrel distortion, typically -0.1",
    )
    k2: Radial = Field(default=0.0, description="radial distortion, r⁴; typically 0.05")
    p1: Tangential = Field(default=0.0, description="tangential distortion; typically 0.0005")
    p2: Tangential = Field(default=0.0, description="tangential distortion; typically 0.0005")
    k3: Radial = Field(default=0.0, description="radial distortion, r⁶; for wide-angle lenses only")
    principal_offset_px: Pair = Field(
        default=(0.0, 0.0),
        description="offset of the principal point from the image centre (right, down); "
        "typically a few pixels",
    )
    defocus_px: float = Field(
        default=0.0,
        ge=0,
        le=20,
        description="defocus blur: standard deviation of a Gaussian; 0.6 in the lab",
    )


class Exposure(Config):
    """How long the shutter is open; a frame's time is the middle of its middle row's exposure."""

    exposure_s: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="exposure time, which causes motion blur; 0: none, 0.008 in the lab",
    )
    blur_step_px: float = Field(
        default=0.4,
        ge=1e-12,
        le=10,
        description="motion blur is averaged over instants; largest motion between two of "
        "them; typically 0.4 to 0.8",
    )
    rolling_shutter_s: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="time between the exposures of the first and the last row; typically 0.015",
    )

    @property
    def middle_age_s(self) -> float:
        """Age of a frame's middle, the picture's middle row half exposed, as its shutter closes."""
        return 0.5 * (self.exposure_s + self.rolling_shutter_s)


class Noise(Config):
    """Noise of the sensor's electronics."""

    read_noise: Share = Field(
        default=0.0,
        description="standard deviation of the noise that does not depend on the light; "
        "typically 0.02",
    )
    shot_noise: Share = Field(
        default=0.0,
        description="standard deviation at full scale of the noise that grows with the square "
        "root of the light; typically 0.01",
    )
    gain_drift: Share = Field(
        default=0.0, description="standard deviation of the slowly drifting gain; typically 0.02"
    )
    white_balance_drift: Share = Field(
        default=0.0,
        description="standard deviation of each channel's slowly drifting gain; typically 0.01",
    )
    drift_time_s: float = Field(
        default=5.0,
        ge=1e-12,
        le=END_S,
        description="correlation time of the drifting gains; typically 5",
    )


class Window(Config):
    """An interval of simulated time."""

    start_s: Moment = Field(default=0.0, description="start of the interval")
    end_s: Moment = Field(default=END_S, description="end of the interval, itself excluded")

    def contains(self, time_s: float) -> bool:
        """Whether a time lies in [start_s, end_s)."""
        return self.start_s <= time_s < self.end_s


class Occluder(Window):
    """An opaque disc between camera and floor: it crosses, or it moves with tractor or trailer."""

    over: Literal["path", "tractor", "trailer"] = Field(
        default="path",
        description="path: moves from from_m to to_m; otherwise stays above that body's labels",
    )
    trailer: WhichTrailer = 1
    from_m: Pair = Field(
        default=(-1.0, 0.0), description="position (x, y) in the label plane at start_s"
    )
    to_m: Pair = Field(
        default=(1.0, 0.0), description="position (x, y) in the label plane at end_s"
    )
    diameter_m: float = Field(
        default=0.25,
        ge=1e-12,
        le=5,
        description="diameter of the disc; 0.16 covers one body's labels",
    )
    grey: Share = Field(default=0.2, description="brightness of the disc: 0 black, 1 white")


class Glare(Window):
    """A bright spot with soft edges that washes out colours."""

    position_px: Pair = Field(
        default=(320.0, 240.0), description="centre of the spot (column, row)"
    )
    radius_px: float = Field(
        default=40.0,
        ge=1e-12,
        le=1000,
        description="standard deviation of the spot's brightness profile; typically 40",
    )
    strength: float = Field(
        default=1.0,
        ge=0,
        le=10,
        description="light added at the centre; 1 or more saturates the image",
    )


class Distractor(Config):
    """A disc on the floor that has a label's colour."""

    colour_of: LabelName = Field(
        default="tractor_front", description="the label whose colour the disc has"
    )
    position_m: Pair = Field(default=(0.7, 0.5), description="position (x, y) on the floor")
    diameter_m: float = Field(
        default=0.036, ge=1e-12, le=1, description="diameter of the disc; a label measures 0.036"
    )


class FadedLabel(Config):
    """A label bleached by the sun."""

    label: LabelName = Field(description="the label that is faded")
    trailer: WhichTrailer = 1
    fading: Share = Field(default=0.5, description="loss of colour: 0 as new, 1 grey")


class Delivery(Config):
    """Frames that are lost, repeated or late."""

    dropped: Share = Field(default=0.0, description="share of frames lost; 0.2 is a bad link")
    frozen: Share = Field(
        default=0.0, description="share of frames that repeat the previous image; typically 0.1"
    )
    late: Share = Field(default=0.0, description="share of frames that arrive late; typically 0.1")
    late_periods: int = Field(
        default=1,
        ge=1,
        le=30,
        description="delay of late frames in control periods; typically 1 to 3",
    )
    blackouts: Several[Window] = Field(default=(), description="intervals without any frames")


class Faults(Config):
    """What goes wrong; each kind is absent unless it is given."""

    delivery: Delivery = Delivery()
    occluders: Several[Occluder] = ()
    glare: Several[Glare] = ()
    distractors: Several[Distractor] = ()
    faded: Several[FadedLabel] = ()


class CameraOptions(Config):
    """The overhead camera with its sensor model."""

    name: str = Field(default="overhead", description="the camera's name in the scene file")
    height_m: float | None = Field(
        default=None, gt=0.2, le=20, description="height above the floor; default: the scene's, 1.9"
    )
    x_m: Move = Field(default=0.0, description="displacement along the world's x; typically 0.005")
    y_m: Move = Field(default=0.0, description="displacement along the world's y; typically 0.005")
    roll_rad: Tilt = Field(
        default=0.0, description="rotation about the world's x, applied first; typically 0.005"
    )
    pitch_rad: Tilt = Field(
        default=0.0, description="rotation about the world's y, applied second; typically 0.005"
    )
    yaw_rad: Angle = Field(
        default=0.0, description="rotation about the vertical, applied third; typically 0.005"
    )
    width_px: Side = Field(default=640, description="image width; typically 640")
    height_px: Side = Field(default=480, description="image height; typically 480")
    supersampling: int = Field(
        default=3,
        ge=1,
        le=5,
        description="rendered pixels per sensor pixel in each direction; rendering time grows "
        "with its square",
    )
    lens: Lens = Lens()
    exposure: Exposure = Exposure()
    noise: Noise = Noise()
    faults: Faults = Faults()

    @property
    def unmoved(self) -> "CameraOptions":
        """This camera where the scene hangs it, at the same height."""
        return self.model_copy(update=dict.fromkeys(MOVES, 0.0))


# two by two rendered pixels are enough behind its blur: P's rms error is 0.050 mm, not 0.043 mm
# as with three by three (500 poses)
LAB_CAMERA = CameraOptions(
    supersampling=2,
    lens=Lens(
        k1=-0.12, k2=0.05, p1=0.0006, p2=-0.0004, principal_offset_px=(3.2, -2.1), defocus_px=0.6
    ),
    exposure=Exposure(exposure_s=0.008, blur_step_px=0.75),
    noise=Noise(read_noise=0.018, shot_noise=0.012, gain_drift=0.02, white_balance_drift=0.01),
)
