"""Ground that is not flat: rolling terrain and kerbs. Only contact physics drives over it.

Rolling terrain is a Gaussian random field of heights z over the floor's plane, with the correlation
exp(−r²/L²) at a distance r; its rms slope in any direction is √2·rms/L. It is made on a grid by
filtering white noise, and scaled so that its rms height is exactly the one asked for. A picture
may stand in its place, its grey levels scaled to the same rms height.
"""

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from ttwmr_mj.dynamics.floor.regions import Coordinate, Size
from ttwmr_mj.files import input_file
from ttwmr_mj.robot import Config
from ttwmr_mj.state import FloatArray

PICTURE = "give a PNG, relative to the scenario, or leave the key out for random terrain"
CELLS_PER_LENGTH = 8  # of the grid, over a correlation length
MOST_CELLS = 600  # along a side


class Terrain(Config):
    """Rolling terrain, a square around the world's origin."""

    same_in_batch: ClassVar[frozenset[str]] = frozenset({"correlation_length_m", "half_size_m"})
    free_in_batch: ClassVar[frozenset[str]] = frozenset({"seed"})

    rms_height_m: float = Field(
        ge=0, le=0.2, description="root mean square of the heights; typically 0.002 to 0.01"
    )
    correlation_length_m: float = Field(
        default=0.5,
        ge=0.05,
        le=20,
        description="distance at which heights are alike to 1/e; typically 0.5",
    )
    half_size_m: float = Field(
        default=3.0, ge=0.5, le=30, description="half the side of the square; typically 3"
    )
    seed: int = Field(default=0, ge=0, le=2**31, description="one seed is one terrain")
    png_path: Annotated[str, input_file(PICTURE)] | None = Field(
        default=None,
        description="a picture whose grey levels are the heights, relative to the scenario; "
        "in place of seed and correlation_length_m",
    )

    @property
    def side_m(self) -> float:
        """Of the square; random heights that are alike further than this would be no terrain."""
        return 2.0 * self.half_size_m

    @property
    def cells(self) -> int:
        """Of the grid along a side, at most MOST_CELLS."""
        wanted = CELLS_PER_LENGTH * self.side_m / self.correlation_length_m
        return min(max(math.ceil(wanted), 8), MOST_CELLS)

    def heights_m(self) -> FloatArray:
        """(cells + 1, cells + 1) heights, rows along +y and columns along +x, of mean zero."""
        count = self.cells + 1
        step = self.side_m / self.cells
        noise = np.random.default_rng(self.seed).standard_normal((2 * count, 2 * count))
        wave = 2.0 * np.pi * np.fft.fftfreq(2 * count, step)
        # the root of the spectrum of exp(−r²/L²)
        root = np.exp(-0.125 * self.correlation_length_m**2 * (wave[:, None] ** 2 + wave**2))
        field = np.fft.ifft2(root * np.fft.fft2(noise)).real[:count, :count]
        return scaled(field, self.rms_height_m)


class Kerb(Config):
    """A plate on the floor: a kerb where it is narrow, a step where it is wide."""

    height_m: float = Field(
        ge=1e-12, le=0.03, description="over the floor; typically 0.001 to 0.003"
    )
    x_m: Coordinate = Field(description="of its centre; typically within 1")
    y_m: Coordinate = Field(description="of its centre; typically within 1")
    length_m: Size = Field(description="along its own x axis; typically 0.5")
    width_m: Size = Field(description="along its own y axis; typically 0.02")
    angle_rad: float = Field(default=0.0, ge=-100, le=100, description="of its x axis, from +x")


def scaled(field: FloatArray, rms_m: float) -> FloatArray:
    """A field of any shape and scale with mean zero and this rms."""
    centred = field - field.mean()
    rms = math.sqrt(float((centred**2).mean()))
    return np.asarray(centred * (rms_m / rms if rms > 0.0 else 0.0))
