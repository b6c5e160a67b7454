"""Frames into a video file: MP4 (H.264), WebM (VP9) or an animated GIF."""

from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.vision.camera.frame import Image

FORMATS: dict[str, dict[str, Any]] = {
    ".mp4": {
        "codec": "libx264",
        "output_params": ["-crf", "21", "-preset", "veryfast", "-movflags", "+faststart"],
    },
    ".webm": {
        "codec": "libvpx-vp9",
        "output_params": ["-crf", "33", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "7"],
    },
    ".gif": {},
}
GIF_SOURCE: dict[str, Any] = {"codec": "libx264", "output_params": ["-crf", "8"]}
# one palette for the whole film; no dithering, which flickers and doubles the size
GIF_FILTER = "[0:v]palettegen=stats_mode=full[p];[1:v][p]paletteuse=dither=none"


def check_format(path: Path) -> str:
    """The suffix that says which format is meant.

    Raises:
        InputError: it is none of those that can be written.
        MachineError: the encoder is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError.at("-o", got=str(path), allowed=f"a file name with {', '.join(FORMATS)}")
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError as error:
        raise MachineError(
            "no encoder for videos; install it: pip install 'ttwmr-mj[video]'"
        ) from error
    return suffix


def write_video(path: Path, frames: Iterable[Image], size_px: tuple[int, int], fps: float) -> None:
    """Write a video; the file appears whole or not at all.

    Args:
        path: its suffix says the format; overwritten.
        frames: (height, width, 3) RGB each.
        size_px: width and height, both even.
        fps: frames per second.

    Raises:
        InputError: no such format.
        MachineError: no encoder, or it fails.
    """
    suffix = check_format(path)
    with TemporaryDirectory(prefix=".video-", dir=path.parent) as folder:
        made = Path(folder) / f"film{suffix}"
        if suffix == ".gif":
            source = Path(folder) / "film.mkv"
            _encode(source, frames, size_px, fps, GIF_SOURCE)
            _to_gif(source, made)
        else:
            _encode(made, frames, size_px, fps, FORMATS[suffix])
        made.replace(path)


def _encode(
    path: Path,
    frames: Iterable[Image],
    size_px: tuple[int, int],
    fps: float,
    settings: dict[str, Any],
) -> None:
    import imageio_ffmpeg

    writer = imageio_ffmpeg.write_frames(
        str(path), size_px, fps=fps, quality=None, macro_block_size=2, **settings
    )
    writer.send(None)
    try:
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
    except OSError as error:
        raise MachineError(f"the video encoder fails: {error}") from error
    finally:
        writer.close()


def _to_gif(source: Path, path: Path) -> None:
    """Read the film twice, once for its colours: neither pass has to keep it in memory."""
    import subprocess

    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", source, "-i", source]
    done = subprocess.run(
        [*map(str, command), "-lavfi", GIF_FILTER, str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise MachineError(f"the video encoder fails: {done.stderr.strip()}")
