"""docs/howto/live.md: its commands parse, its Python runs, its clip is small and moves."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from ttwmr_mj.cli.command_line import parse
from ttwmr_mj.recording.stream import live, viewer
from ttwmr_mj.recording.video.film import FPS, SIZE_PX
from ttwmr_mj.runs.closed_loop.pace import BEHIND_S

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "live.md"
TEXT = PAGE.read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, flags=re.M | re.S)


def test_every_command_parses() -> None:
    lines = [line.split("#")[0].split() for block in blocks("sh") for line in block.splitlines()]
    assert len(lines) >= 12
    for words in lines:
        assert words[0] == "ttwmr"
        parse(words[1:])


@pytest.mark.slow
@pytest.mark.parametrize("code", blocks("python"))
def test_its_python_runs(code: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "overhead" / "run.mp4").stat().st_size > 10_000


def test_its_numbers_are_the_codes() -> None:
    words = " ".join(TEXT.split())
    assert (viewer.SERVER_MEMORY, viewer.WINDOW_MEMORY) == ("1GB", "2GB")
    assert "at most 1 GB" in words
    assert "a window keeps 2 GB" in words
    assert live.DRAIN_S == 5.0
    assert "five seconds" in words
    assert f"more than {BEHIND_S:g} s late" in words
    assert f"{SIZE_PX[0]}×{SIZE_PX[1]} pixels and {FPS['.mp4']:.0f} frames" in words
    assert f"640×360 and {FPS['.gif']:g}" in words


def test_its_clip_is_small_and_moves() -> None:
    (name,) = re.findall(r"\]\((\.\./images/[^)]+\.gif)\)", TEXT)
    clip = PAGE.parent / name
    assert clip.stat().st_size < 3_000_000
    stream = cv2.VideoCapture(str(clip))
    first = stream.read()[1]
    later = [stream.read()[1] for _ in range(20)][-1]
    assert (first != later).any()
