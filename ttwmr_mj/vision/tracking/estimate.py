"""What the tracker answers: what came of a frame, and where the robot is."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ttwmr_mj.state import FloatArray


class Status(StrEnum):
    """What the tracker knows."""

    TRACKED = "tracked"  # the last frame showed labels where they belong
    BLIND = "blind"  # it did not, and the prediction stands in, for a short while
    LOST = "lost"  # nothing is known; the whole of every frame is searched


def no_labels(count: int) -> FloatArray:
    """(count, 2) pixels of labels of which none is known: NaN."""
    return np.full((count, 2), np.nan)


@dataclass(frozen=True, slots=True)
class Sighting:
    """What came of one frame.

    Attributes:
        found_px: (labels, 2) centres that were used, NaN where none.
        predicted_px: (labels, 2) where they were looked for; NaN in a whole-frame search.
        search_px: half the side of the search regions; NaN in a whole-frame search.
    """

    found_px: FloatArray
    predicted_px: FloatArray
    search_px: float = np.nan

    @classmethod
    def of_none(cls, count: int) -> "Sighting":
        """A whole-frame search without a result, for so many labels."""
        return cls(no_labels(count), no_labels(count))

    @property
    def labels(self) -> int:
        """How many labels were used."""
        return int(np.isfinite(self.found_px[:, 0]).sum())


@dataclass(frozen=True, slots=True)
class TrackEstimate:
    """The tracker's answer for one instant."""

    q: FloatArray  # (3 + n,) x, y, θ1, θ2, …, angles unwrapped
    q_rate: FloatArray  # (3 + n,) their rates
    covariance: FloatArray  # (3 + n, 3 + n) of q
    valid: bool  # False while lost, or too uncertain
    status: Status  # tracked, blind or lost
    measurement_age_s: float  # since the last frame with labels; infinite before the first
    labels: int  # used in the newest frame; 0 when none has come
