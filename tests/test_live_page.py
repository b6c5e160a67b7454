"""What a person sees in a browser while a run goes on: Rerun's web viewer in headless Chromium."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
SCENE = np.s_[100:380, 40:620]  # of the page: where the robot is seen from behind
LIMIT_S = 240.0  # software rendering on a machine under load


@pytest.fixture(scope="module")
def page() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium here; install it: apt-get install chromium")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        yield browser.new_page(viewport={"width": 1100, "height": 680})
        browser.close()


def picture(page: Any) -> np.ndarray | None:
    """The page as (rows, columns, 3) RGB; None where it was too busy to be drawn."""
    from PIL import Image
    from playwright.sync_api import TimeoutError as Busy

    try:
        shot = page.screenshot(timeout=60_000)
    except Busy:
        return None
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"))


def robot(shot: np.ndarray) -> np.ndarray | None:
    """Where the robot is in the scene, dark on a light floor; None if there is no scene yet."""
    scene = shot[SCENE]
    dark = scene.max(axis=2) < 70
    shown = (scene.min(axis=2) > 150).mean() > 0.3 and 0.004 < dark.mean() < 0.3
    return dark if shown else None


def test_the_page_shows_the_robot_moving(page: Any, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "ttwmr_mj", "run", "lab_circle", "--live=web", "--out", "out"]
    command += ["--set", f"duration_s={LIMIT_S + 60.0}", "--set", "output.figures=false"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            address = process.stdout.readline().partition(": ")[2].strip()
            seen = _two_different(page, address)
            assert process.poll() is None  # both pictures are of a run that went on
        finally:
            process.terminate()
            process.wait(60)
    assert len(seen) == 2


def _two_different(page: Any, address: str) -> list[np.ndarray]:
    """Where the robot is at two times at which it is seen in different places."""
    _open(page, address)
    give_up_s = time.monotonic() + LIMIT_S
    seen: list[np.ndarray] = []
    while len(seen) < 2:
        assert time.monotonic() < give_up_s, "the page shows no robot that moves"
        shot = picture(page)
        place = None if shot is None else robot(shot)
        if place is not None and (not seen or (place != seen[0]).mean() > 0.004):
            seen.append(place)
        time.sleep(2.0)
    return seen


def _open(page: Any, address: str) -> None:
    """Open the page, as soon as it is served."""
    for _ in range(120):
        try:
            page.goto(address)
        except Exception:
            time.sleep(1.0)
        else:
            return
    raise AssertionError(f"{address} cannot be opened")
