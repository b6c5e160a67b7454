"""Scenarios at the edge of what is allowed, run by camera."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.vision.camera.overlays import fill

CAMERA = """name = "camera"
duration_s = 0.2
reference = { kind = "circle", radius_m = 0.43, angular_rate_rad_s = 0.3 }
controller = { kind = "lyapunov" }
sensing = { kind = "camera" }
"""
EXACT = ["sensing.tracker.calibration_noise_m=0", "sensing.tracker.label_noise_px=1e-3"]
RESTLESS = [
    "sensing.tracker.noise_time_s=0.05",
    "sensing.tracker.turn_noise_rad_s=100.0",
    "sensing.tracker.speed_noise_m_s=10.0",
    "sensing.tracker.swing_noise_rad_s2=1e3",
    "sensing.tracker.gate_chi2=1e3",
    "sensing.tracker.max_blind_s=60.0",
    "sensing.camera.faults.delivery.dropped=0.8",
]


@pytest.mark.parametrize("scenario", ["lab_circle_camera", "double_inverted_camera"])
@pytest.mark.parametrize("values", [EXACT, EXACT + RESTLESS, ["robot.looks_scale=1e-3"]])
def test_the_smallest_numbers_run(scenario: str, values: list[str]) -> None:
    run = tt.simulate(tt.load_scenario(scenario, ["duration_s=0.5", *values]))
    assert run.outcomes[0].status == "ok"


@pytest.mark.parametrize(
    ("value", "allowed"),
    [
        ("sensing.tracker.label_noise_px=1e-4", "0.001"),
        ("sensing.tracker.noise_time_s=0.04", "0.05"),
        ("robot.looks_scale=1e-4", "0.001"),
    ],
)
def test_smaller_numbers_are_refused(value: str, allowed: str) -> None:
    key = value.partition("=")[0]
    with pytest.raises(
        tt.InputError, match=f"{key}: got .*; allowed: greater than or equal to {allowed}"
    ):
        tt.load_scenario("lab_circle_camera", [value])


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (["sensing.camera.lens.defocus_px=15.0"], "got lens.defocus_px = 15.0;"),
        (["sensing.camera.height_m=20.0"], "got height_m = 20.0;"),
        (["sensing.camera.roll_rad=0.5"], "got roll_rad = 0.5;"),
    ],
)
def test_a_camera_that_cannot_be_calibrated_is_told_what_is_unusual(
    tmp_path: Path, values: list[str], told: str
) -> None:
    file = tmp_path / "camera.toml"
    file.write_text(CAMERA)
    with pytest.raises(tt.InputError) as error:
        tt.simulate(tt.load_scenario(file, values))
    assert str(error.value).startswith(f"sensing.camera: {told} before a run")
    assert "ChArUco" not in str(error.value)


@pytest.mark.parametrize("values", [[], ["sensing.camera.lens.k1=-1.0"]])
def test_a_camera_leaves_the_process_as_it_was(values: list[str]) -> None:
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(2)
        before = dict(os.environ)
        with suppress(tt.InputError):
            tt.simulate(tt.load_scenario("lab_circle_camera", ["duration_s=0.2", *values]))
        after = {key: value for key, value in os.environ.items() if before.get(key) != value}
        assert not after.keys() - {"PYOPENGL_PLATFORM"}  # which PyOpenGL needs to the end
        assert cv2.getNumThreads() == 2
    finally:
        cv2.setNumThreads(threads)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("far_px", [1e8, 1e300, np.nan])
def test_what_is_beyond_all_lenses_is_not_drawn(far_px: float) -> None:
    image = np.zeros((8, 8, 3), dtype=np.uint8)
    outline = np.array([[-4.0, -4.0], [12.0, -4.0], [12.0, 12.0], [-4.0, 12.0]])
    fill(image, np.where(outline > 0.0, far_px, outline), [255.0] * 3)
    assert not image.any()
    fill(image, outline, [255.0] * 3)
    assert image.all()
