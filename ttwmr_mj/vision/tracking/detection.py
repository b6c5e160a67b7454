"""Finds the coloured labels and their centres to a fraction of a pixel.

Colour minus grey is a plane, and the labels' hues lie a quarter turn apart in it. A pixel's
response to a label is its colour projected on that hue: linear in light, zero for every grey, so
that a centroid weighted by it is unbiased whatever grey surrounds the label.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import BoolArray, FloatArray
from ttwmr_mj.vision.camera.frame import Image, Pixels
from ttwmr_mj.vision.camera.labels import NAMES, LabelLayout
from ttwmr_mj.vision.camera.rendering.region import Region

Response = NDArray[np.float32]
HUES = len(NAMES)

NEUTRAL_STRIDE = 16  # every 16th pixel of both axes tells the colour of a mostly grey floor
NEUTRAL_BRIGHTNESS = (8.0, 247.0)  # nearly black has no colour, nearly white has lost it
MIN_CONTRAST = 32.0  # grey levels; 2 % noise is 5, a new label 150 to 200
SMOOTHING_PX = (3, 3)  # leaves a third of white noise, and is narrower than a label
EDGE = 0.5  # of the peak response: there lies a blurred edge
FLOOR = 0.1  # of the peak response: below lie noise and the tints of what is nearly grey
AREA_SHARE = (0.7, 1.5)  # of a full disc: a label's blob at half its peak
SIDE_SLACK_PX = 2.2  # how much shorter or longer than a diameter a blob's sides may be
# ratio of the light's variances along and across: 1.06 is the most that noise and a sharp eye give,
# motion blur of 5 px or an edge 1.3 mm over the label makes 1.2
LONGEST = 1.2
SKIRT_PX = 3.0  # beyond the edge, where blur still spreads a label's light
COARSE_LABEL_PX = 2.0  # diameter of a label in the shrunk picture of a whole-frame search
COARSE_CONTRAST = 0.6  # of the least contrast: its pixels are half floor
COARSE_AREA_SHARE = (0.2, 4.0)  # of a disc's area: from half hidden and faint to blurred
SPARE_CANDIDATES = 5  # of one colour, beside its labels; refined one by one, which takes time
FAR = -1e6  # column of a region that does not exist


@dataclass(frozen=True, slots=True)
class Candidates:
    """Blobs that look like labels, n of them."""

    hue: NDArray[np.intp]  # (n,) which of the four colours
    centre_px: FloatArray  # (n, 2) column, row


class Detector:
    """Looks for labels of one size in frames of any size.

    Attributes:
        radius_px: of a label in the picture.
    """

    def __init__(self, layout: LabelLayout, radius_px: float) -> None:
        """Take the labels' hues from their paint."""
        chroma = layout.colour_bgr - layout.colour_bgr.mean(axis=1, keepdims=True)
        self._hue = chroma / np.linalg.norm(chroma, axis=1, keepdims=True)
        self._hue_of = layout.hue
        self._most = SPARE_CANDIDATES + layout.trailers
        self.radius_px = radius_px
        self._reach = int(np.ceil(radius_px + SKIRT_PX))

    def track(
        self, image: Pixels, predicted_px: FloatArray, search_px: float
    ) -> tuple[FloatArray, BoolArray]:
        """Look for each label near where it should be.

        Args:
            image: (rows, columns, 3) BGR.
            predicted_px: (labels, 2) expected centres.
            search_px: how far from there a centre may lie.

        Returns:
            Centres (labels, 2), NaN where not found, and which were found (labels,).
        """
        half = self._reach + int(np.ceil(search_px))
        return self._refine(image, self._hue_of, predicted_px, half)

    def search(self, image: Pixels) -> Candidates:
        """Look for all labels in the whole frame; several candidates of a colour are usual."""
        shrink = max(1, int(2.0 * self.radius_px / COARSE_LABEL_PX))
        rows, columns = image.shape[0] // shrink, image.shape[1] // shrink
        whole = image[: rows * shrink, : columns * shrink]
        small = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)
        weights = self._balanced_hue(image).astype(np.float32)
        response = weights @ small.reshape(-1, 3).T.astype(np.float32)
        mask = np.zeros((HUES, rows + 1, columns), dtype=np.uint8)  # a dark row between each two
        mask[:, :rows] = (response > COARSE_CONTRAST * MIN_CONTRAST).reshape(HUES, rows, columns)
        coarse, area_px, _ = blobs(mask.reshape(-1, columns))
        hue = (coarse[:, 1] // (rows + 1)).astype(np.intp)
        coarse[:, 1] -= hue * (rows + 1)
        share = area_px * shrink**2 / (np.pi * self.radius_px**2)
        chosen = _likeliest(hue, share, self._most)
        hue, centre = hue[chosen], (coarse[chosen] + 0.5) * shrink - 0.5
        refined, sound = self._refine(image, hue, centre, self._reach + shrink)
        return Candidates(hue[sound], refined[sound])

    def _balanced_hue(self, image: Pixels) -> FloatArray:
        """(4, 3) weights of blue, green, red that cancel for what is grey in this image."""
        return np.asarray(self._hue / neutral_colour(image))

    def _refine(
        self, image: Pixels, hue: NDArray[np.intp], near_px: FloatArray, half: int
    ) -> tuple[FloatArray, BoolArray]:
        """Centres (n, 2) of the labels in square regions around (n, 2), and which exist (n,)."""
        count, side = len(hue), 2 * half + 1
        centre = np.full((count, 2), np.nan)
        sound = np.zeros(count, dtype=np.bool_)
        if not count:
            return centre, sound
        near = np.where(np.isfinite(near_px), near_px, FAR)
        corner = np.rint(near).astype(np.intp) - half
        patches = _cut(image, corner, side)
        weights = self._balanced_hue(image)[hue].astype(np.float32)
        response = np.matmul(patches.reshape(count, -1, 3), weights[:, :, None])
        response = response.reshape(count, side, side)
        even = cv2.blur(response.reshape(-1, side), SMOOTHING_PX).reshape(count, side, side)
        peak = even.max(axis=(1, 2))
        mask = (even > (EDGE * peak)[:, None, None]).view(np.uint8)
        mask[:, 0] = mask[:, -1] = 0  # regions are stacked: keep their blobs apart
        place, area_px, size_px = blobs(mask.reshape(-1, side))
        place = place[label_sized(area_px, size_px, self.radius_px)]
        owner = (place[:, 1] // side).astype(np.intp)
        place[:, 1] -= owner * side
        away = ((place - (near[owner] - corner[owner])) ** 2).sum(axis=1)
        rough = np.zeros((count, 2), dtype=np.float32)
        for index in np.argsort(-away):  # the nearest comes last and stays
            rough[owner[index]] = place[index]
            sound[owner[index]] = True
        sound &= peak >= MIN_CONTRAST
        if sound.any():
            light = response[sound] - (FLOOR * peak[sound])[:, None, None]
            middle, whole = self._centroids(light, rough[sound])
            centre[sound] = np.where(whole[:, None], corner[sound] + middle, np.nan)
            sound[sound] = whole
        return centre, sound

    def _centroids(self, light: Response, rough: Response) -> tuple[FloatArray, BoolArray]:
        """Columns, rows (n, 2) of the light (n, side, side) around rough centres (n, 2).

        And which are whole discs (n,): something over a label's edge moves its centroid, and
        leaves it longer than wide.
        """
        numbers = np.arange(light.shape[1], dtype=np.float32)
        aside, below = numbers - rough[:, :1], numbers - rough[:, 1:]
        limit = np.float32((self.radius_px + SKIRT_PX) ** 2)
        inside = (below[:, :, None] ** 2 + aside[:, None, :] ** 2 < limit) & (light > 0.0)
        light = light * inside
        columns, rows = light.sum(axis=1), light.sum(axis=2)
        total = rows.sum(axis=1)
        x, y = (columns * aside).sum(axis=1) / total, (rows * below).sum(axis=1) / total
        xx = (columns * aside**2).sum(axis=1) / total - x * x
        yy = (rows * below**2).sum(axis=1) / total - y * y
        product = np.matmul(light, aside[:, :, None])[..., 0]
        xy = (product * below).sum(axis=1) / total - x * y
        unequal, both = np.hypot(xx - yy, 2.0 * xy), xx + yy
        whole = both + unequal < LONGEST * (both - unequal)
        return np.stack([x, y], axis=-1).astype(np.float64) + rough, whole


def blobs(mask: Image) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The connected sets of non-zero pixels in a mask (rows, columns), n of them.

    Returns:
        Their middles (n, 2) column, row; numbers of pixels (n,); widths and heights (n, 2).
    """
    _, _, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
    # the first is the background
    found, middle = np.array(stats[1:], dtype=np.float64), np.array(centres[1:], dtype=np.float64)
    return middle, found[:, cv2.CC_STAT_AREA], found[:, 2:4]


def label_sized(area_px: FloatArray, size_px: FloatArray, radius_px: float) -> BoolArray:
    """(n,) which blobs have the area (n,) and the sides (n, 2) of a disc of this radius."""
    low, high = AREA_SHARE
    area = area_px / (np.pi * radius_px**2)
    sides = np.abs(size_px - 2.0 * radius_px).max(axis=1, initial=0.0) <= SIDE_SLACK_PX
    return np.asarray((area >= low) & (area <= high) & sides)


def neutral_colour(image: Pixels) -> FloatArray:
    """(3,) what grey looks like in an image of a mostly grey scene, scaled to mean one.

    The mean of a sparse sample; four labels are a five-hundredth of the picture and move it less
    than an eight-bit step.
    """
    typical = np.array(cv2.mean(np.ascontiguousarray(image[::NEUTRAL_STRIDE, ::NEUTRAL_STRIDE])))
    low, high = NEUTRAL_BRIGHTNESS
    if typical[:3].min() < low or typical[:3].max() > high:
        return np.ones(3)
    return np.asarray(typical[:3] / typical[:3].mean())


def _cut(image: Pixels, corner: NDArray[np.intp], side: int) -> Response:
    """(n, side, side, 3) squares with their first pixel at corners (n, 2); black outside."""
    picture = Region(0, 0, image.shape[1], image.shape[0])
    patches = np.zeros((len(corner), side, side, 3), dtype=np.float32)
    for patch, (column, row) in zip(patches, corner.tolist(), strict=True):
        square = Region(column, row, column + side, row + side)
        seen = square.clipped(picture)
        if min(seen.shape) > 0:
            patch[seen.within(square)] = image[seen.within(picture)]
    return patches


def _likeliest(hue: NDArray[np.intp], area: FloatArray, most: int) -> NDArray[np.intp]:
    """Indices of the blobs closest in size to a label, a few of each colour."""
    low, high = COARSE_AREA_SHARE
    fits = np.flatnonzero((area >= low) & (area <= high))
    ranked = fits[np.argsort(np.abs(np.log(area[fits])))]
    chosen = [ranked[hue[ranked] == i][:most] for i in range(HUES)]
    return np.concatenate(chosen)
