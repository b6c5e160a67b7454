"""Lens, posture, sensor and delivery of the simulated camera, by exact small cases."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from vision_scene import model

from ttwmr_mj.vision.camera.delivery import DeliveryFaults
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.lens import LensMap
from ttwmr_mj.vision.camera.model import CameraModel, hang_camera
from ttwmr_mj.vision.camera.noise import SensorNoise, thinned
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions, Delivery, Noise, Window
from ttwmr_mj.vision.camera.rendering.posture import Posture
from ttwmr_mj.vision.camera.rendering.region import Region

SMALL = CameraOptions(width_px=160, height_px=120, lens=LAB_CAMERA.lens)


def small(options: CameraOptions = SMALL) -> CameraModel:
    return hang_camera(model(), options)


def fine_place(camera: CameraModel, lens: LensMap) -> np.ndarray:
    """(rows, columns, 2) where each pixel's ray meets the fine picture plane."""
    column, row = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    return camera.to_tangents(np.stack([column, row], axis=-1).astype(float)) * lens.focal_px


@pytest.mark.parametrize("supersampling", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("defocus_px", [0.0, 0.6])
def test_a_slope_of_light_is_seen_where_it_is(supersampling: int, defocus_px: float) -> None:
    """What is linear has the same value at a point, over a pixel, and blurred."""
    camera = small()
    lens = LensMap(camera, supersampling, defocus_px)
    left, top, right, bottom = lens.whole
    u, v = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    fine = np.stack([u, v, 0 * u], axis=-1).astype(np.float32)
    seen = lens.expose(fine, lens.whole, lens.sensor)
    inner = slice(4, -4)
    expected = fine_place(camera, lens)[inner, inner]
    # OpenCV interpolates in steps of 1/32 pixel; the lens's curvature under blur costs a hundredth
    assert seen[inner, inner, :2] == pytest.approx(expected, abs=1 / 64 + 0.012)


@pytest.mark.parametrize(("supersampling", "defocus_px"), [(1, 0.0), (2, 0.6), (3, 0.0), (3, 1.5)])
def test_the_source_of_a_window_is_all_that_it_sees(supersampling: int, defocus_px: float) -> None:
    camera, rng = small(), np.random.default_rng(0)
    lens = LensMap(camera, supersampling, defocus_px)
    fine = rng.integers(255, size=(*lens.whole.shape, 3), dtype=np.uint8)
    whole = lens.expose(fine, lens.whole, lens.sensor)
    for window in (Region(70, 30, 110, 50), Region(0, 0, 9, 9), Region(100, 100, 160, 120)):
        source = lens.source(window)
        part = np.ascontiguousarray(fine[source.within(lens.whole)])
        seen = lens.expose(part, source, window).astype(int)
        expected = whole[window.within(lens.sensor)]
        # places round to 1/32 pixel, a few of them to the other side
        assert np.abs(seen - expected).max() <= 255 / 32 + 1
        assert (seen == expected).mean() > 0.95
        assert source.shape[0] < lens.whole.shape[0]


def test_the_footprint_of_a_region_is_every_pixel_that_sees_it() -> None:
    camera = small()
    lens = LensMap(camera, 3, 0.6)
    place = fine_place(camera, lens)
    for region in (Region(-50, -40, 30, 25), Region(100, 60, 200, 150), Region(-900, -9, -150, 9)):
        low, high = np.array(region[:2]), np.array(region[2:])
        rows, columns = np.nonzero(((place > low) & (place < high)).all(axis=-1))
        left, top, right, bottom = lens.footprint(region)
        assert 1 <= rows.min() - top <= 7 or top == 0
        assert 1 <= bottom - 1 - rows.max() <= 7 or bottom == camera.height_px
        assert 1 <= columns.min() - left <= 7 or left == 0
        assert 1 <= right - 1 - columns.max() <= 7 or right == 160
    assert min(lens.footprint(Region(5000, 5000, 5100, 5100)).shape) <= 0


def test_the_nearest_fine_pixel_is_the_one_a_ray_falls_into() -> None:
    camera = small()
    lens = LensMap(camera, 2, 0.0)
    left, top, _, _ = lens.whole
    fine = np.random.default_rng(1).integers(255, size=lens.whole.shape, dtype=np.uint8)
    seen = lens.nearest(fine, lens.whole, lens.sensor)
    place = fine_place(camera, lens)
    column, row = np.moveaxis(np.floor(place).astype(int), -1, 0)
    clear = (np.abs(place - np.rint(place)) > 1e-3).all(axis=-1)  # not on a border of two
    assert clear.mean() > 0.99
    assert np.array_equal(seen[clear], fine[row - top, column - left][clear])


def test_a_pixel_measures_what_the_projection_says() -> None:
    camera = small(CameraOptions(height_m=2.4))
    assert camera.position_m[2] == 2.4
    hang_camera(model(), CameraOptions(height_m=1.9))  # the model is shared
    step = 1e-4
    pixels = camera.project(np.array([[0.0, 0.0, 0.3], [step, 0.0, 0.3]]))
    apart = np.linalg.norm(pixels[1] - pixels[0])
    assert camera.metres_per_pixel(0.3) == pytest.approx(step / apart, rel=1e-6)


def test_posture_and_back_and_a_motion() -> None:
    posture, rng = Posture(model()), np.random.default_rng(2)
    for _ in range(5):
        q = rng.uniform(-1.0, 1.0, 4) * [2.0, 2.0, 3.0, 3.0]
        rate, time_s = rng.uniform(-1.0, 1.0, 4), 0.3
        qpos = posture.positions(q)
        assert posture.coordinates(qpos) == pytest.approx(q, abs=1e-14)
        moved = posture.coordinates(posture.moved(qpos, rate, time_s))
        assert moved[:2] == pytest.approx(q[:2] + time_s * rate[:2], abs=1e-12)
        assert np.exp(1j * moved[2:]) == pytest.approx(np.exp(1j * (q + time_s * rate)[2:]))
        assert qpos[2] == model().key_qpos[0][2]


def test_every_row_has_noise_and_new_noise_in_every_frame() -> None:
    options = Noise(read_noise=0.03)
    sensor = SensorNoise(options, 200, 75, np.random.default_rng(0))  # 75 rows: strips end unevenly
    light = np.full((75, 200, 3), 128, dtype=np.uint8)
    first, second = (sensor.read(light, time_s)[:].astype(float) for time_s in (0.0, 1.0))
    # 600 numbers a row: 3 % of the deviation, and four of these
    assert first.std(axis=(1, 2)) == pytest.approx(np.full(75, 7.65), rel=0.12)
    assert np.abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.05
    assert np.array_equal(light, np.full_like(light, 128))


@pytest.mark.parametrize("step", [1, 2, 3, 5])  # 75 rows: 2 leaves one over, 3 and 5 none
def test_a_thinned_picture_has_the_pixels_of_the_whole_one(step: int) -> None:
    light = np.random.default_rng(3).integers(0, 255, (75, 200, 3), dtype=np.uint8)
    sensor = SensorNoise(Noise(read_noise=0.02), 200, 75, np.random.default_rng(0))
    for pixels in (sensor.read(light, 0.0), light):
        np.testing.assert_array_equal(thinned(pixels, step), pixels[:][::step, ::step])


@pytest.mark.parametrize(
    "noise", [Noise(read_noise=0.03, shot_noise=0.02, gain_drift=0.1), Noise()]
)
def test_a_part_of_a_picture_has_the_numbers_of_the_whole(noise: Noise) -> None:
    """Wherever it is looked at, in whatever order: the tracker sees what the recording shows."""
    rng = np.random.default_rng(1)
    light = rng.integers(256, size=(75, 200, 3), dtype=np.uint8)
    picture = SensorNoise(noise, 200, 75, rng).read(light, 0.0)
    corner, sparse = picture[3:40, 150:199], picture[::16, ::16]
    whole = picture[:]
    assert whole.shape == picture.shape == (75, 200, 3)
    np.testing.assert_array_equal(corner, whole[3:40, 150:199])
    np.testing.assert_array_equal(sparse, whole[::16, ::16])
    np.testing.assert_array_equal(picture[70:, 199:], whole[70:, 199:])
    assert picture[:, 200:].size == 0


def test_shot_noise_grows_with_the_root_of_light() -> None:
    sensor = SensorNoise(Noise(shot_noise=0.04), 200, 100, np.random.default_rng(0))
    deviations = []
    for level in (16, 64, 144):
        light = np.full((100, 200, 3), level, dtype=np.uint8)
        deviations.append(sensor.read(light, 0.0)[:].std())
    expected = 0.04 * 255 * np.sqrt(np.array([16, 64, 144]) / 255)
    assert deviations == pytest.approx(np.hypot(expected, np.sqrt(1 / 12)), rel=0.02)


@pytest.mark.parametrize("read_noise", [0.0, 0.001])
def test_gains_walk_about_one_with_the_asked_memory(read_noise: float) -> None:
    options = Noise(
        read_noise=read_noise, gain_drift=0.1, white_balance_drift=0.05, drift_time_s=1.0
    )
    sensor = SensorNoise(options, 8, 8, np.random.default_rng(1))
    light = np.full((8, 8, 3), 120, dtype=np.uint8)
    level = np.array([sensor.read(light, 0.1 * k)[:].mean(axis=(0, 1)) for k in range(6000)])
    walk = np.log(level / 120)
    # 300 independent stretches: 4 % of a deviation, three of these
    assert walk.std(axis=0) == pytest.approx(np.full(3, np.hypot(0.1, 0.05)), rel=0.12)
    assert np.abs(walk.mean(axis=0)).max() < 0.03
    later = [np.corrcoef(channel[1:], channel[:-1])[0, 1] for channel in walk.T]
    assert later == pytest.approx([np.exp(-0.1)] * 3, abs=0.02)
    apart = (walk - walk.mean(axis=1, keepdims=True)).std()
    assert apart == pytest.approx(0.05 * np.sqrt(2 / 3), rel=0.12)


def delivered(options: Delivery, draws: list[tuple[float, float, float]]) -> list[list[int]]:
    """Numbers of the frames that leave in each period, whose fates are drawn so."""
    fates = iter(draws)
    rng = SimpleNamespace(random=lambda count: np.array(next(fates))[:count])
    faults, taken = DeliveryFaults(options, rng), []
    leaving = []
    for k in range(len(draws)):

        def take(k: int = k) -> Frame:
            taken.append(k)
            return Frame(np.full((1, 1, 3), k, dtype=np.uint8), float(k), None)

        frames = faults.deliver(float(k), take)
        leaving.append([(round(frame.time_s), int(frame.image[0, 0, 0])) for frame in frames])
    return leaving


GOOD, DROP, FREEZE, LATE = (0.9, 0.9, 0.9), (0.1, 0.9, 0.9), (0.9, 0.1, 0.9), (0.9, 0.9, 0.1)
SOME = Delivery(dropped=0.5, frozen=0.5, late=0.5, late_periods=2)


def test_frames_that_are_lost_repeated_or_late() -> None:
    assert delivered(SOME, [GOOD, DROP, GOOD]) == [[(0, 0)], [], [(2, 2)]]
    assert delivered(SOME, [GOOD, FREEZE, FREEZE, GOOD]) == [[(0, 0)], [(1, 0)], [(2, 0)], [(3, 3)]]
    # nothing to repeat yet; and what follows a late frame waits for it
    assert delivered(SOME, [FREEZE, GOOD]) == [[(0, 0)], [(1, 1)]]
    late = delivered(SOME, [GOOD, LATE, GOOD, GOOD, GOOD])
    assert late == [[(0, 0)], [], [], [(1, 1), (2, 2), (3, 3)], [(4, 4)]]


def test_a_blackout_starts_and_ends_on_time() -> None:
    dark = Delivery(blackouts=(Window(start_s=1.0, end_s=3.0),))
    assert delivered(dark, [GOOD] * 5) == [[(0, 0)], [], [], [(3, 3)], [(4, 4)]]


def test_regions() -> None:
    region = Region.around(np.array([-1.5, 2.2]), np.array([0.0, 7.9])).grown(1)
    assert region == (-3, -1, 4, 9)
    assert region.shape == (10, 7)
    assert region.clipped(Region(-9, 0, 2, 20)) == (-3, 0, 2, 9)
    assert region.within(Region(-10, -20, 30, 40)) == (slice(19, 29), slice(7, 14))
