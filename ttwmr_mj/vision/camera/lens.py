"""From the ideal picture plane to what falls on the sensor: distortion, pixel area, defocus."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.model import DISTORTION, CameraModel
from ttwmr_mj.vision.camera.rendering.region import Region

Place = NDArray[np.float32]
CAMERA = "sensing.camera"


class LensMap:
    """Maps the sensor's pixels onto fine pixels of the ideal picture plane.

    A window is a region of the sensor, its first pixel at (0, 0).

    Attributes:
        focal_px: fine pixels per unit slope.
        sensor: the window of all pixels.
        whole: the region of fine pixels that the whole sensor sees.
    """

    def __init__(
        self, camera: CameraModel, supersampling: int, defocus_px: float, key: str = CAMERA
    ) -> None:
        """Trace the ray of every pixel; `key` is where a scenario has the camera.

        Raises:
            InputError: the distortion folds the picture.
        """
        self._supersampling = supersampling
        self._defocus_px = defocus_px
        self._margin = 2 + int(np.ceil(4.0 * defocus_px))  # light reaches no farther, in pixels
        self._camera = camera
        self.focal_px = float(supersampling * camera.focal_px[0])
        self.sensor = Region(0, 0, camera.width_px, camera.height_px)
        refuse_folding(camera, key)
        fine = _rays(camera) * self.focal_px
        self._u, self._v = fine[..., 0].astype(np.float32), fine[..., 1].astype(np.float32)
        self.whole = self._seen(self.sensor)

    def footprint(self, region: Region) -> Region:
        """The window that sees a region, with a margin for defocus."""
        left, top, right, bottom = (edge / self.focal_px for edge in region)
        middle_x, middle_y = 0.5 * (left + right), 0.5 * (top + bottom)
        border = [(x, y) for x in (left, middle_x, right) for y in (top, middle_y, bottom)]
        pixel = self._camera.to_pixels(np.array(border))
        corners = np.concatenate([pixel, pixel + 1.0])
        return Region.around(*corners.T).grown(self._margin).clipped(self.sensor)

    def source(self, window: Region) -> Region:
        """The region of fine pixels needed for a window, defocus included."""
        return self._seen(window.grown(self._margin).clipped(self.sensor))

    def expose(self, fine: Image, region: Region, window: Region) -> Image:
        """What a window sees of a region, (rows, columns, 3) as `fine`.

        Averages over a sensor pixel's area, then over the lens's blur.
        """
        seeing = window
        if self._defocus_px:
            seeing = window.grown(self._margin).clipped(self.sensor)
        # the average of an even number lies between two pixels; OpenCV keeps it at the later
        late = 0.5 * (self._supersampling % 2 == 0)
        averaged = cv2.blur(fine, (self._supersampling, self._supersampling))
        u, v = self._places(seeing, region, late)
        seen = cv2.remap(averaged, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        if self._defocus_px:
            seen = cv2.GaussianBlur(seen, (0, 0), self._defocus_px)
        return np.asarray(seen[window.within(seeing)])

    def nearest(self, fine: Image, region: Region, window: Region) -> Image:
        """As `expose`, but each pixel takes the nearest value: for classes instead of colours."""
        u, v = self._places(window, region)
        return np.asarray(cv2.remap(fine, u, v, cv2.INTER_NEAREST))

    def _places(self, window: Region, region: Region, late: float = 0.0) -> tuple[Place, Place]:
        """Columns and rows of a window's pixels in a picture of a region."""
        pixels = window.within(self.sensor)
        u = self._u[pixels] - np.float32(region.left + 0.5 - late)
        v = self._v[pixels] - np.float32(region.top + 0.5 - late)
        return u, v

    def _seen(self, window: Region) -> Region:
        pixels = window.within(self.sensor)
        reach = self._supersampling + 1
        return Region.around(self._u[pixels], self._v[pixels]).grown(reach)


def fold_fault(camera: CameraModel) -> Fault | None:
    """Why a lens cannot be used, or None: rays through it are found for one pixel each."""
    if not camera.folds:
        return None
    return lens_fault(
        camera, "this distortion folds the image: near the border a pixel has no unique ray"
    )


def lens_fault(camera: CameraModel, problem: str) -> Fault:
    """What is wrong with a lens, and the numbers that make it so."""
    coefficients = ", ".join(map("{} = {:g}".format, DISTORTION, camera.distortion))
    fx, fy = camera.focal_px
    return Fault(
        problem=problem,
        got=f"{coefficients} at focal lengths of {fx:g} and {fy:g} px",
        allowed="weaker coefficients, or a longer focal length",
    )


def refuse_folding(camera: CameraModel, key: str) -> None:
    """Raise an InputError, with the camera's key, where its lens folds the picture."""
    if fault := fold_fault(camera):
        raise InputError(fault.within(*key.split("."), "lens"))


def _rays(camera: CameraModel) -> FloatArray:
    """Slopes (rows, columns, 2) of the rays that pixels see."""
    column, row = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    return camera.to_tangents(np.stack([column, row], axis=-1).astype(np.float64))
