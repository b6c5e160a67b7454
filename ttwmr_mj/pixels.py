"""Pixels of picture files, which may be damaged or enormous."""

import math
import warnings
from pathlib import Path
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.quiet import quiet

MOST_PIXELS = 30_000_000  # of a picture: it takes seconds to search


def read_pixels(path: Path, flags: int) -> NDArray[np.generic] | None:
    """The pixels of a file, as OpenCV's flags ask for them; None where it has no readable picture.

    A picture of more than MOST_PIXELS is not read.
    """
    from PIL import Image as Pillow

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of damaged and of enormous pictures
            with Pillow.open(path) as image:
                if math.prod(image.size) > MOST_PIXELS:
                    return None
                image.load()  # OpenCV takes 4 GB where a damaged PNG says that it is so long
        with quiet():
            return cast("NDArray[np.generic] | None", cv2.imread(str(path), flags))
    except Exception:  # libraries raise anything of pictures that are damaged or enormous
        return None
