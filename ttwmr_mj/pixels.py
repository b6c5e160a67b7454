"""Pixels of picture files, which may be damaged or enormous."""

import math
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

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


@contextmanager
def quiet() -> Iterator[None]:
    """While the context lasts nothing is printed to the process's stderr, by compiled code too.

    Libraries print remarks on damaged files there: whoever reads the file says it.
    """
    with suppress(AttributeError, OSError, ValueError):  # there may be none
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # there is none
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nowhere)
        os.close(kept)
