"""A camera frame, and what is true about it."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import FloatArray

Image = NDArray[np.uint8]

BACKGROUND, TRACTOR_CLASS, TRAILER_CLASS, FIRST_LABEL_CLASS = 0, 1, 2, 3
OCCLUDER_CLASS = FIRST_LABEL_CLASS + 4
DISTRACTOR_CLASS = OCCLUDER_CLASS + 1


@dataclass(frozen=True, slots=True)
class FrameTruth:
    """What a frame shows, for scoring; nothing in the loop may look at it.

    Attributes:
        time_s: the middle of the exposure by the simulation's own clock; of a frame that repeats
            the previous image, when its own should have been exposed.
        q: (3 + n,) x, y, θ1, θ2, … at the middle of the exposure.
        centres_px: (labels, 2) column and row of the labels' centres, in the layout's order;
            also where a label is hidden or outside of the picture.
        visible: (labels,) share of each label's area that can be seen, 0 to 1.
        segmentation: (rows, columns) class of every pixel: 0 background, 1 tractor, 2 trailers,
            3-6 the labels by hue, 7 occluder, 8 distractor; None unless asked for.
    """

    time_s: float
    q: FloatArray
    centres_px: FloatArray
    visible: FloatArray
    segmentation: Image | None


class Pixels(Protocol):
    """A picture (rows, columns, 3), blue, green, red, of which parts can be looked at."""

    @property
    def shape(self) -> tuple[int, ...]:
        """As of an array."""

    def __getitem__(self, part: Any, /) -> Image:
        """The part that one or two slices select, whole in colour."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture."""

    pixels: Pixels
    time_s: float  # middle of the exposure, as far as the receiver knows
    truth: FrameTruth | None  # None for a real camera's frame

    @property
    def image(self) -> Image:
        """All pixels."""
        return self.pixels[:]
