"""Rectangles of the ideal picture plane."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Region(NamedTuple):
    """Fine pixels left ≤ u < right, top ≤ v < bottom, counted from the optical axis."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def around(cls, u: NDArray[Any], v: NDArray[Any], margin: int = 0) -> Region:
        """The smallest region with all of these points, and a margin."""
        return cls(
            int(np.floor(u.min())) - margin,
            int(np.floor(v.min())) - margin,
            int(np.ceil(u.max())) + margin,
            int(np.ceil(v.max())) + margin,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.bottom - self.top, self.right - self.left

    def union(self, other: Region) -> Region:
        """The smallest region that contains both."""
        return Region(
            min(self.left, other.left),
            min(self.top, other.top),
            max(self.right, other.right),
            max(self.bottom, other.bottom),
        )

    def within(self, outer: Region) -> tuple[slice, slice]:
        """Rows and columns of this region in a picture of a larger one."""
        return (
            slice(self.top - outer.top, self.bottom - outer.top),
            slice(self.left - outer.left, self.right - outer.left),
        )
