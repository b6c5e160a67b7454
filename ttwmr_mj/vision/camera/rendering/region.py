"""Rectangles of pixels: of the sensor, or of the ideal picture plane."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Region(NamedTuple):
    """Pixels left ≤ u < right, top ≤ v < bottom; those of the plane count from the optical axis."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def around(cls, u: NDArray[Any], v: NDArray[Any]) -> Region:
        """The smallest region with all of these points."""
        low, high = np.floor([u.min(), v.min()]), np.ceil([u.max(), v.max()])
        return cls(*map(int, (*low, *high)))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.bottom - self.top, self.right - self.left

    def grown(self, reach: int) -> Region:
        """So many pixels more on every side."""
        left, top, right, bottom = self
        return Region(left - reach, top - reach, right + reach, bottom + reach)

    def clipped(self, outer: Region) -> Region:
        """What of it lies in another region; nothing: a shape that is not positive."""
        return Region(*map(max, self[:2], outer[:2]), *map(min, self[2:], outer[2:]))

    def within(self, outer: Region) -> tuple[slice, slice]:
        """Rows and columns of this region in a picture of a larger one."""
        return (
            slice(self.top - outer.top, self.bottom - outer.top),
            slice(self.left - outer.left, self.right - outer.left),
        )
