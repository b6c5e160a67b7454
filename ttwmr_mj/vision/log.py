"""What a camera sensor saw in one control period, for recordings and exported frames."""

from dataclasses import dataclass

from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.tracking.estimate import Sighting, TrackEstimate


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """One control period of one camera.

    Attributes:
        time_s: of the control sample.
        frame: the newest frame that arrived in it; None where none did.
        sighting: what the tracker made of it; None without a frame.
        estimate: the tracker's answer for this sample.
    """

    time_s: float
    frame: Frame | None
    sighting: Sighting | None
    estimate: TrackEstimate
