"""Frames into a video file: MP4 (H.264), WebM (VP9) or an animated GIF."""

import subprocess
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import Any

import numpy as np

from ttwmr_mj.errors import InputError, MachineError, RunError
from ttwmr_mj.files import scratch_folder
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
    if suffix not in FORMATS or path.is_dir():
        raise InputError.at("-o", got=str(path), allowed=f"a file name with {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        hint = f"there is no folder {path.parent}; make it first"
        raise InputError.at("-o", got=str(path), hint=hint)
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
        MachineError: no encoder.
        RunError: the encoder fails, as on a full disk.
    """
    suffix = check_format(path)
    try:
        beside = TemporaryDirectory(prefix=".video-", dir=path.parent)
    except OSError as error:
        error.filename = str(path)  # the name that its user knows
        raise
    with beside as folder:
        inside = Path(folder).absolute()  # ffmpeg takes what stands before a colon for a protocol
        made = inside / f"film{suffix}"
        if suffix == ".gif":
            source = inside / "film.mkv"
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
    """Raises RunError if the encoder fails, which its exit code alone tells for sure."""
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", "{}x{}".format(*size_px), "-r", f"{fps}"]
    coded = ["-an", "-vcodec", settings["codec"], "-pix_fmt", "yuv420p"]
    command = [*_ffmpeg(), *raw, "-i", "-", *coded, *settings.get("output_params", ()), str(path)]
    with (
        TemporaryFile(dir=scratch_folder()) as words,
        subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=words,
            start_new_session=True,  # Ctrl-C is ours
        ) as encoder,
    ):
        assert encoder.stdin is not None
        try:
            with suppress(BrokenPipeError):  # it has ended, and says why
                for frame in frames:
                    encoder.stdin.write(np.ascontiguousarray(frame).data)
                encoder.stdin.close()
        except BaseException:
            encoder.kill()
            raise
        encoder.wait()
        words.seek(0)
        _check(encoder.returncode, words.read())


def _to_gif(source: Path, path: Path) -> None:
    """Read the film twice, once for its colours: neither pass has to keep it in memory."""
    command = [*_ffmpeg(), "-i", str(source), "-i", str(source), "-lavfi", GIF_FILTER, str(path)]
    done = subprocess.run(command, capture_output=True, check=False)
    _check(done.returncode, done.stderr)


def _ffmpeg() -> list[str]:
    import imageio_ffmpeg

    return [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error"]


def _check(code: int, words: bytes) -> None:
    if code:
        lines = words.decode(errors="replace").strip().splitlines() or [f"exit code {code}"]
        raise RunError(f"the video encoder failed, no video is left: {lines[-1]}")
