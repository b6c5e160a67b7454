"""What a camera sensor saw in one control period, for recordings and exported frames."""

from dataclasses import dataclass

from ttwmr_mj.vision.camera.frame import Frame, FrameTruth
from ttwmr_mj.vision.tracking.estimate import Sighting, TrackEstimate


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """One control period of one camera."""

    time_s: float  # of the control sample
    frame: Frame | None  # the newest frame that arrived in it; None where none did or was kept
    truth: FrameTruth | None  # of that frame, kept or not; None of a real camera's
    sighting: Sighting | None  # what the tracker made of that frame; None where none arrived
    estimate: TrackEstimate  # the tracker's answer for this sample
