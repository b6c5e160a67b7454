"""Pictures from files, which may be damaged or enormous."""

import re
from pathlib import Path

import cv2
import numpy as np

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.pixels import read_pixels
from ttwmr_mj.vision.camera.frame import Image

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def picture_files(folder: Path) -> list[Path]:
    """The pictures in a folder, by name, 2.png before 10.png; none where it is absent.

    Hidden files are left out: macOS puts a ._2.png beside 2.png that is no picture.
    """
    found = [path for path in folder.glob("[!.]*") if path.suffix.lower() in SUFFIXES]
    return sorted(found, key=lambda path: (_numbered(path.name), path.name))


def _numbered(name: str) -> list[str | int]:
    """A name's parts, the numbers in it as numbers; letters and numbers take turns."""
    parts = re.split("([0-9]+)", name)
    return [int(part) if i % 2 else part for i, part in enumerate(parts)]


def read_picture(path: Path) -> Image:
    """A picture (rows, columns, 3), blue, green, red.

    Raises:
        InputError: it is missing, or cannot be read as a picture of reasonable size.
    """
    refuse_missing(path)
    image = read_pixels(path, cv2.IMREAD_COLOR)
    if image is None:
        unreadable = Fault(
            problem="cannot be read as an image", hint="PNG and JPEG of up to 30 megapixels work"
        )
        raise InputError(unreadable, file=str(path))
    return np.asarray(image, dtype=np.uint8)


def refuse_missing(path: Path) -> None:
    """Raise an InputError where no file has this name; a pipe, which would never end, is none."""
    if not path.is_file():
        raise InputError(Fault(problem="no picture file of this name"), file=str(path))
