"""What lies between camera and floor: occluders and glare."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import OCCLUDER_CLASS, Image
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.options import Glare, Occluder

CORNERS = 48  # of the polygon that stands for a circle
SUBPIXEL_BITS = 4  # outlines are drawn to a sixteenth of a pixel
FARTHEST_PX = (1 << 30) >> SUBPIXEL_BITS  # OpenCV's corners have 32 bits
_ANGLE = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
CIRCLE: FloatArray = np.stack([np.cos(_ANGLE), np.sin(_ANGLE)], axis=-1)


def circle_points(centre_m: FloatArray, diameter_m: float, height_m: float) -> FloatArray:
    """(CORNERS, 3) points of a horizontal circle around x, y."""
    points = np.empty((CORNERS, 3))
    points[:, :2] = centre_m + 0.5 * diameter_m * CIRCLE
    points[:, 2] = height_m
    return points


def fill(
    image: Image, outline_px: FloatArray, value: Sequence[float], *, smooth: bool = True
) -> None:
    """Fill a convex outline (n, 2) into an image; one that reaches beyond all lenses is nowhere."""
    if not np.abs(outline_px).max() < FARTHEST_PX:
        return
    corners = np.rint(outline_px * (1 << SUBPIXEL_BITS)).astype(np.int32)
    line = cv2.LINE_AA if smooth else cv2.LINE_8
    cv2.fillConvexPoly(image, corners, value, line, SUBPIXEL_BITS)


def occluder_centre(occluder: Occluder, time_s: float, labels_m: FloatArray) -> FloatArray:
    """x, y (2,) of an occluder's middle at a time; labels_m (labels, 3) is where the labels are."""
    if occluder.over == "path":
        share = (time_s - occluder.start_s) / (occluder.end_s - occluder.start_s)
        start, end = np.array(occluder.from_m), np.array(occluder.to_m)
        return np.asarray(start + share * (end - start))
    body = 0 if occluder.over == "tractor" else occluder.trailer
    return np.asarray(labels_m[2 * body : 2 * body + 2, :2].mean(axis=0))


class Occluders:
    """Draws the occluders of a moment, and tells what they hide."""

    def __init__(
        self, occluders: tuple[Occluder, ...], camera: CameraModel, layout: LabelLayout
    ) -> None:
        self._occluders = occluders
        self._camera = camera
        self._height_m = float(layout.height_m.max())

    def draw(
        self, image: Image, segmentation: Image | None, time_s: float, labels_m: FloatArray
    ) -> None:
        """Draw into the image and the segmentation, in place."""
        for occluder in self.at(time_s):
            centre = occluder_centre(occluder, time_s, labels_m)
            circle = circle_points(centre, occluder.diameter_m, self._height_m)
            outline = self._camera.project(circle)
            fill(image, outline, [255.0 * occluder.grey] * 3)
            if segmentation is not None:
                fill(segmentation, outline, [OCCLUDER_CLASS], smooth=False)

    def at(self, time_s: float) -> list[Occluder]:
        """Those that are there at a time."""
        return [occluder for occluder in self._occluders if occluder.contains(time_s)]

    def hide(self, points_m: FloatArray, time_s: float, labels_m: FloatArray) -> NDArray[np.bool_]:
        """Which of the points (..., 3), at the labels' height, are hidden."""
        hidden = np.zeros(points_m.shape[:-1], dtype=np.bool_)
        for occluder in self.at(time_s):
            offset = points_m[..., :2] - occluder_centre(occluder, time_s, labels_m)
            hidden |= (offset**2).sum(axis=-1) < (0.5 * occluder.diameter_m) ** 2
        return hidden


class GlareSpots:
    """Adds bright spots to the light; each is computed once."""

    def __init__(self, spots: tuple[Glare, ...], width_px: int, height_px: int) -> None:
        column, row = np.arange(width_px), np.arange(height_px)[:, None]
        self._spots = []
        for spot in spots:
            x, y = spot.position_px
            square = (column - x) ** 2 + (row - y) ** 2
            light = 255.0 * spot.strength * np.exp(-0.5 * square / spot.radius_px**2)
            shade = np.rint(light.clip(0, 255)).astype(np.uint8)
            self._spots.append((spot, np.repeat(shade[..., None], 3, axis=2)))

    def add(self, image: Image, time_s: float) -> None:
        """Add the light of a moment's spots in place; the sensor saturates."""
        for spot, light in self._spots:
            if spot.contains(time_s):
                cv2.add(image, light, dst=image)
