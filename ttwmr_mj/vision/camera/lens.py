"""From the ideal picture plane to what falls on the sensor: distortion, pixel area, defocus."""

from __future__ import annotations

import cv2
import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.model import DISTORTION, CameraModel
from ttwmr_mj.vision.camera.region import Region

FOLD_PX = 1e-3  # distortion undone and done again leads back to the same pixel


class LensMap:
    """Maps the sensor's pixels onto fine pixels of the ideal picture plane.

    Attributes:
        whole: the region of fine pixels that the whole sensor sees.
    """

    def __init__(self, camera: CameraModel, supersampling: int, defocus_px: float) -> None:
        """Trace the ray of every pixel.

        Raises:
            InputError: the distortion cannot be inverted within the picture.
        """
        self._scale = float(supersampling)
        self._supersampling = supersampling
        self._defocus_px = defocus_px
        self._margin = 2 + int(np.ceil(4.0 * defocus_px))  # light reaches no farther, in pixels
        self._camera = camera
        column, row = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
        pixel = np.stack([column, row], axis=-1).astype(np.float64)
        tangent = camera.to_tangents(pixel)
        if not np.abs(camera.to_pixels(tangent) - pixel).max() < FOLD_PX:
            raise InputError.at(
                "sensing.camera.lens",
                "this distortion folds the picture: pixels near its border see no single ray",
                got=", ".join(map("{} = {:g}".format, DISTORTION, camera.distortion)),
                allowed="weaker coefficients, or a longer focal length",
            )
        fine = tangent * self.focal_px
        self._u, self._v = fine[..., 0].astype(np.float32), fine[..., 1].astype(np.float32)
        self.whole = self._source(slice(None), slice(None))

    @property
    def focal_px(self) -> float:
        """Fine pixels per unit slope."""
        return float(self._scale * self._camera.focal_px[0])

    def footprint(self, region: Region) -> tuple[slice, slice]:
        """Rows and columns of the sensor that see a region, clipped to the sensor, with margin."""
        left, top, right, bottom = (edge / self.focal_px for edge in region)
        middle_x, middle_y = 0.5 * (left + right), 0.5 * (top + bottom)
        border = [(x, y) for x in (left, middle_x, right) for y in (top, middle_y, bottom)]
        pixel = self._camera.to_pixels(np.array(border))
        low = np.floor(pixel.min(axis=0)).astype(int) - self._margin
        high = np.ceil(pixel.max(axis=0)).astype(int) + self._margin + 1
        limit = np.array([self._camera.width_px, self._camera.height_px])
        low, high = np.clip(low, 0, limit), np.clip(high, 0, limit)
        return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))

    def source(self, rows: slice, columns: slice) -> Region:
        """The region of fine pixels needed for a window of the sensor, defocus included."""
        return self._source(*self._grown(rows, columns, self._margin))

    def expose(self, fine: Image, region: Region, rows: slice, columns: slice) -> Image:
        """What a window of the sensor sees of a region, (rows, columns, 3) as `fine`.

        Averages over a sensor pixel's area, then over the lens's blur.
        """
        window = self._grown(rows, columns, self._margin if self._defocus_px else 0)
        # the average of an even number lies between two pixels; OpenCV keeps it at the later
        late = 0.5 * (self._supersampling % 2 == 0)
        u = self._u[window] - np.float32(region.left + 0.5 - late)
        v = self._v[window] - np.float32(region.top + 0.5 - late)
        averaged = cv2.blur(fine, (self._supersampling, self._supersampling))
        seen = cv2.remap(averaged, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        if self._defocus_px:
            seen = cv2.GaussianBlur(seen, (0, 0), self._defocus_px)
        row, column = rows.start - window[0].start, columns.start - window[1].start
        height, width = rows.stop - rows.start, columns.stop - columns.start
        return np.asarray(seen[row : row + height, column : column + width])

    def nearest(self, fine: Image, region: Region, rows: slice, columns: slice) -> Image:
        """As `expose`, but each pixel takes the nearest value: for classes instead of colours."""
        u = self._u[rows, columns] - np.float32(region.left + 0.5)
        v = self._v[rows, columns] - np.float32(region.top + 0.5)
        return np.asarray(cv2.remap(fine, u, v, cv2.INTER_NEAREST))

    def _grown(self, rows: slice, columns: slice, reach: int) -> tuple[slice, slice]:
        """A window with so many pixels more on every side, as far as the sensor goes."""
        height, width = self._u.shape
        return (
            slice(max(rows.start - reach, 0), min(rows.stop + reach, height)),
            slice(max(columns.start - reach, 0), min(columns.stop + reach, width)),
        )

    def _source(self, rows: slice, columns: slice) -> Region:
        reach = self._supersampling + 1
        return Region.around(self._u[rows, columns], self._v[rows, columns], reach)
