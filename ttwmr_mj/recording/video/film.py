"""The pictures of a video, put together: robot, view from above, words, plots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from ttwmr_mj.files import importing_matplotlib
from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene.robot import force_scale_m_n
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.recording.video.cameras import chase
from ttwmr_mj.recording.video.encode import check_format, write_video
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.recording.video.map import Map
from ttwmr_mj.recording.video.stage import Stage
from ttwmr_mj.recording.video.strip import Strip
from ttwmr_mj.vision.camera.frame import Image

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

View = Literal["both", "chase", "overhead"]
SIZE_PX = (1280, 720)
STRIP_SHARE = 0.28  # of the height
CHASE_SHARE = 0.64  # of the width, where both views are shown
INK: Colour = (30, 34, 40)
GIF_SHRINK = 2
FPS = {
    ".mp4": 30.0,
    ".webm": 30.0,
    ".gif": 12.5,
}  # whole hundredths of a second per frame, which is what a GIF counts in


def make_video(
    folder: Path,
    out: Path,
    *,
    view: View = "both",
    speed: float = 1.0,
    start_s: float = 0.0,
    stop_s: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> str:
    """Write a video of a run.

    Args:
        folder: the run folder.
        out: the file; its suffix .mp4, .webm or .gif says the format.
        view: from behind the robot, from above, or both.
        speed: simulated seconds per second of the video.
        start_s: simulated time of the first frame.
        stop_s: of the last one; None: the run's end.
        progress: called with the share that is done.

    Returns:
        What of the run could not be read and is not shown, in words; empty: nothing.

    Raises:
        InputError: no such run or format.
        MachineError: no encoder, or no OpenGL.
    """
    suffix = check_format(out)
    footage = Footage.of(folder, FPS[suffix], speed, start_s, stop_s)
    film = Film(footage, view, speed)
    shrink = GIF_SHRINK if suffix == ".gif" else 1
    size_px = SIZE_PX[0] // shrink, SIZE_PX[1] // shrink
    try:
        write_video(out, _frames(film, len(footage.time_s), shrink, progress), size_px, FPS[suffix])
    finally:
        film.close()
    return footage.lacks


def _frames(
    film: Film, count: int, shrink: int, progress: Callable[[float], None] | None
) -> Iterator[Image]:
    import cv2

    for k in range(count):
        picture = film.frame(k)
        if shrink > 1:
            size_px = SIZE_PX[0] // shrink, SIZE_PX[1] // shrink
            picture = np.asarray(cv2.resize(picture, size_px, interpolation=cv2.INTER_AREA))
        yield picture
        if progress is not None:
            progress((k + 1) / count)


class Film:
    """The frames of a video.

    Args:
        footage: what is shown.
        view: from where.
        speed: simulated seconds per second of the video, for its words.
    """

    def __init__(self, footage: Footage, view: View, speed: float) -> None:
        width, height = SIZE_PX
        self._strip = Strip(footage, width, round(STRIP_SHARE * height))
        self._height = height - round(STRIP_SHARE * height)
        self._left = {"both": round(CHASE_SHARE * width), "chase": width, "overhead": 0}[view]
        self._footage, self._speed = footage, speed
        self._stage = Stage(footage, (self._left, self._height)) if self._left else None
        self._camera = chase(footage)
        right = width - self._left
        self._map = Map(footage, right, self._height) if right else None
        self._title_font, self._font = _font(24, bold=True), _font(16)

    def close(self) -> None:
        """Give back what OpenGL holds."""
        if self._stage is not None:
            self._stage.close()

    def frame(self, number: int) -> Image:
        """(height, width, 3) RGB."""
        pictures = []
        if self._stage is not None:
            self._stage.show(number)
            picture = self._stage.picture(self._camera(number), self._left, self._height)
            pictures.append(picture)
        if self._map is not None:
            pictures.append(self._map.at(number))
        upper = self._written_on(np.hstack(pictures), number)
        if len(pictures) > 1:
            upper[:, self._left - 1 : self._left + 1] = 255
        return np.vstack([upper, self._strip.at(number)])

    def _written_on(self, picture: Image, number: int) -> Image:
        """With the title, what the colours mean, and the time."""
        from PIL import Image as Pillow
        from PIL import ImageDraw

        image = Pillow.fromarray(picture)
        draw = ImageDraw.Draw(image)
        scenario = self._footage.scenario
        draw.text((20, 14), scenario.name.replace("_", " "), INK, self._title_font)
        seen = {"truth": "sees the truth", "camera": "sees by camera"}[scenario.sensing.kind]
        what = f"{scenario.plant.kind} · {scenario.controller.kind} · {seen}"
        draw.text((20, 46), what, INK, self._font)
        clock = f"{self._footage.time_s[number]:.1f} s"
        if self._speed != 1.0:
            clock += f"   ×{self._speed:g}"
        draw.text((image.width - 20, 14), clock, INK, self._title_font, anchor="ra")
        x = 20.0
        for text, colour in self._key():
            y = image.height - 26
            draw.rounded_rectangle((x, y + 5, x + 22, y + 11), 3, fill=colour)
            draw.text((x + 29, y - 2), text, INK, self._font)
            x += 29 + draw.textlength(text, self._font) + 22
        return np.array(image)

    def _key(self) -> list[tuple[str, Colour]]:
        """What is drawn, and in which colour."""
        entries = [("tractor", style.TRACTOR), ("trailer", style.TRAILER)]
        if np.isfinite(self._footage.rows.ref_q[:, 0, 0]).any():
            entries.insert(0, ("reference", style.REFERENCE_BAND))
        if self._footage.arrows_m.shape[1] and self._stage is not None:
            length_mm = 1e3 * force_scale_m_n(self._footage.scenario.robot)
            entries.append((f"contact forces, 1 N = {length_mm:g} mm", style.FORCE))
        return entries


def _font(size: int, *, bold: bool = False) -> FreeTypeFont:
    """A font that every machine with matplotlib has."""
    with importing_matplotlib():
        import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)
