"""From light to numbers: drifting gains, shot and read noise, eight bits."""

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image, Pixels
from ttwmr_mj.vision.camera.options import Noise

FULL_SCALE = 255.0
LEVELS = np.arange(256)  # of grey
LEVELS_32 = LEVELS.astype(np.float32)
STRIP_ROWS = 32  # of the picture at a time: what is computed on the way stays in the cache
TILE_MARGIN = 256  # a frame's noise is a random window of a tile this much larger than the frame


class SensorNoise:
    """Turns what falls on the sensor into what is read from it.

    Normal numbers are drawn once; every frame takes a window at a random place of them. Two frames
    share no window but once in 65536, and white noise one pixel aside is as good as new.
    """

    def __init__(
        self, options: Noise, width_px: int, height_px: int, rng: np.random.Generator
    ) -> None:
        self._options = options
        self._rng = rng
        self._shape = (height_px, width_px)
        tile = (height_px + TILE_MARGIN, width_px + TILE_MARGIN, 3)
        self._noisy = bool(options.read_noise or options.shot_noise)
        self._tile = rng.standard_normal(tile if self._noisy else (0,), dtype=np.float32)
        light = LEVELS / FULL_SCALE
        spread = np.hypot(options.read_noise, options.shot_noise * np.sqrt(light))
        self._spread = (FULL_SCALE * spread).astype(np.float32)
        self._drift = rng.standard_normal(4)  # of gain, blue, green, red; unit variance
        self._time_s: float | None = None

    def read(self, light: Image, time_s: float) -> Pixels:
        """The picture of a sensor under this light.

        Args:
            light: (rows, columns, 3) without noise; not changed, and not to be changed later.
            time_s: when; gains drift with it, and times must not go back.

        Returns:
            (rows, columns, 3) as read.
        """
        gains = self._gains(time_s)
        if not self._noisy:
            table = np.rint(LEVELS[:, None] * gains).clip(0, 255).astype(np.uint8)
            return np.asarray(cv2.LUT(light, table[None]))
        top, left = self._rng.integers(TILE_MARGIN, size=2)
        rows, columns = self._shape
        window = self._tile[top : top + rows, left : left + columns]
        amplified = LEVELS_32[:, None] * gains.astype(np.float32)
        return _Exposed(light, window, self._spread, amplified[None])

    def _gains(self, time_s: float) -> FloatArray:
        """(3,) factors of blue, green, red: an Ornstein-Uhlenbeck walk about one."""
        options = self._options
        fresh = self._rng.standard_normal(4)
        if self._time_s is not None:
            kept = np.exp(-max(time_s - self._time_s, 0.0) / options.drift_time_s)
            self._drift = kept * self._drift + np.sqrt(1.0 - kept**2) * fresh
        self._time_s = time_s
        walk = options.gain_drift * self._drift[0] + options.white_balance_drift * self._drift[1:]
        return np.asarray(np.exp(walk))


@dataclass(frozen=True, slots=True)
class _Exposed:
    """A noisy picture, computed where it is looked at: a tracker needs a fiftieth of it.

    Attributes:
        light: (rows, columns, 3) without noise.
        noise: (rows, columns, 3) normal numbers.
        spread: (256,) standard deviation of the noise by grey level.
        amplified: (1, 256, 3) what each grey level becomes in blue, green, red.
    """

    light: Image
    noise: NDArray[np.float32]
    spread: NDArray[np.float32]
    amplified: NDArray[np.float32]

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows, columns, 3."""
        return self.light.shape

    def __getitem__(self, part: Any) -> Image:
        """The same numbers, whatever part is asked for."""
        light, noise = self.light[part], self.noise[part]
        picture = np.empty(light.shape, dtype=np.uint8)
        if not picture.size:
            return picture
        for start in range(0, len(light), STRIP_ROWS):
            strip = slice(start, start + STRIP_ROWS)
            noisy = np.asarray(cv2.LUT(light[strip], self.spread))
            noisy *= noise[strip]
            lit = cv2.LUT(light[strip], self.amplified)
            cv2.add(lit, noisy, dst=picture[strip], dtype=cv2.CV_8U)
        return picture


def thinned(pixels: Pixels, step: int) -> Image:
    """One pixel in so many of one row in so many; of a noisy picture no others are computed."""
    if isinstance(pixels, _Exposed):
        light, noise = _thin(pixels.light, step), _thin(pixels.noise, step)
        return replace(pixels, light=light, noise=noise)[:]
    return _thin(pixels[:], step)


def _thin(picture: NDArray[Any], step: int) -> NDArray[Any]:
    rows, columns = picture.shape[:2]
    if rows % step or columns % step:
        return picture[::step, ::step].copy()
    # the same, but that OpenCV copies three colours at once and NumPy each for itself
    size = columns // step, rows // step
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST))
