"""Connected sets of pixels, and which of them have a label's size."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from ttwmr_mj.state import BoolArray, FloatArray
from ttwmr_mj.vision.camera.frame import Image

# a label's blob at half its peak, compared with a full disc
AREA_SHARE = (0.7, 1.5)
SIDE_SLACK_PX = 2.2  # how much shorter or longer than a diameter a blob's sides may be


class Blobs(NamedTuple):
    """Connected sets of pixels, n of them.

    Attributes:
        centre_px: (n, 2) column, row of their middle.
        area_px: (n,) number of pixels.
        size_px: (n, 2) width and height.
    """

    centre_px: FloatArray
    area_px: FloatArray
    size_px: FloatArray


def blobs(mask: Image) -> Blobs:
    """The connected sets of non-zero pixels in a mask (rows, columns)."""
    _, _, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
    found = np.asarray(stats[1:], dtype=np.float64)  # the first is the background
    return Blobs(
        np.asarray(centres[1:], dtype=np.float64), found[:, cv2.CC_STAT_AREA], found[:, 2:4]
    )


def label_sized(found: Blobs, radius_px: float) -> BoolArray:
    """(n,) which blobs have the area and the sides of a disc of this radius."""
    area = found.area_px / (np.pi * radius_px**2)
    low, high = AREA_SHARE
    sides = np.abs(found.size_px - 2.0 * radius_px).max(axis=1, initial=0.0) <= SIDE_SLACK_PX
    return np.asarray((area >= low) & (area <= high) & sides)
