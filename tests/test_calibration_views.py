"""Views that leave a camera or its place open are refused, however well they are explained."""

from __future__ import annotations

from pathlib import Path
from unittest import mock

import cv2
import numpy as np
import pytest
from PIL import Image as Pillow

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.vision.calibration import floor
from ttwmr_mj.vision.calibration.board import BoardView, board_print, find_board
from ttwmr_mj.vision.calibration.calibrate import Calibration, _held_poses, calibrate
from ttwmr_mj.vision.calibration.floor import Pose, flat_pose, rotation
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.pictures import SUFFIXES, read_picture

CAMERA = CameraModel(
    width_px=640,
    height_px=480,
    focal_px=np.array([640.0, 640.0]),
    principal_px=np.array([322.7, 237.4]),
    distortion=np.array([-0.12, 0.05, 6e-4, -4e-4, 0.0]),
    rotation=np.diag([1.0, -1.0, -1.0]),
    position_m=np.array([0.0, 0.0, 1.9]),
)
COLUMNS, ROWS = np.meshgrid(np.arange(-2.5, 3.0), np.arange(-1.5, 2.0))
CORNERS_M = 0.08 * np.column_stack([COLUMNS.ravel(), ROWS.ravel()])
NOISE_PX = 0.05  # of a corner in a good picture
FLAT = [flat_pose(*pose) for pose in ((0.5, 0.3, 0.5), (-0.5, 0.3, -0.4), (-0.5, -0.3, 2.8))]
ORIGIN = [flat_pose(0.0, 0.0, 0.0)] * 2


def seen(poses: list[Pose], folder: str, seed: int, noise_px: float = NOISE_PX) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    return [
        BoardView(
            CORNERS_M,
            CAMERA.project(middle + CORNERS_M @ turned[:, :2].T)
            + rng.normal(0.0, noise_px, CORNERS_M.shape),
            f"{folder}/{i}.png",
        )
        for i, (middle, turned) in enumerate(poses)
    ]


def held_poses() -> list[Pose]:
    return _held_poses(CAMERA, np.random.default_rng(0))


def calibrated(held: list[Pose], origin: list[Pose], flat: list[Pose]) -> Calibration:
    views = (seen(held, "held", 1), seen(origin, "origin", 2), seen(flat, "flat", 3))
    return calibrate(*views, CAMERA.width_px, CAMERA.height_px)


def test_what_calibrate_finds_is_what_track_takes() -> None:
    """Stretched pictures determine a camera as well, of pixels that none has."""
    views = (seen(held_poses(), "held", 1), seen(ORIGIN, "origin", 2), seen(FLAT, "flat", 3))
    stretched = [
        [view._replace(pixels=view.pixels * [3.75, 1.0]) for view in part] for part in views
    ]
    told = r"focal lengths of 2[\d.]+ and 6[\d.]+ px; allowed: a ratio of 3 at most; .*stretched"
    with pytest.raises(InputError, match=told):
        calibrate(*stretched, 2400, CAMERA.height_px)


def untilted(pose: Pose) -> Pose:
    """As it is spun, but parallel to the floor."""
    middle, turned = pose
    return middle, rotation(np.array([0.0, 0.0, np.arctan2(turned[1, 0], turned[0, 0])]))


def tilted_about_x(poses: list[Pose]) -> list[Pose]:
    rng = np.random.default_rng(4)
    return [(at, rotation(np.array([rng.uniform(-0.5, 0.5), 0.0, 0.0]))) for at, _ in poses]


def test_good_views_find_the_camera() -> None:
    found = calibrated(held_poses(), ORIGIN, FLAT)
    # ten times the least squares' own standard deviations at this noise
    assert found.camera.focal_px == pytest.approx(CAMERA.focal_px, abs=5.0)
    assert found.camera.position_m == pytest.approx(CAMERA.position_m, abs=0.015)


def test_the_same_views_find_the_same_bits() -> None:
    found = (calibrated(held_poses(), ORIGIN, FLAT).camera.focal_px for _ in range(6))
    assert len({focal_px.tobytes() for focal_px in found}) == 1


@pytest.mark.parametrize(
    ("held", "origin", "flat"),
    [
        ([untilted(pose) for pose in held_poses()], ORIGIN, FLAT),
        ([untilted(pose) for pose in held_poses()], ORIGIN, []),
        (tilted_about_x(held_poses()), ORIGIN, FLAT),
        # all in one place, and one pose that is tilted: the flat ones reach the borders
        ([held_poses()[5]] * 10, ORIGIN, FLAT),
        (ORIGIN * 4, ORIGIN, FLAT),
    ],
    ids=["never tilted", "never tilted nor elsewhere", "one axis", "one pose", "flat"],
)
def test_boards_that_are_not_tilted_every_way_are_refused(
    held: list[Pose], origin: list[Pose], flat: list[Pose]
) -> None:
    with pytest.raises(InputError, match=r"parallel, or tilted about one axis only.* 4° are need"):
        calibrated(held, origin, flat)


@pytest.mark.parametrize("seed", [3, 5, 10])
def test_noise_does_not_pass_for_tilt(seed: int) -> None:
    """With 1 px of it boards that lie parallel are seen as tilted by more than 4°."""
    untilted_views = seen([untilted(pose) for pose in held_poses()], "held", seed, 1.0)
    tilted_views = seen(held_poses(), "held", seed, 1.0)
    floor = seen(ORIGIN, "origin", 2, 1.0), seen(FLAT, "flat", 3, 1.0)
    size_px = CAMERA.width_px, CAMERA.height_px
    with pytest.raises(InputError, match=r"length has a standard deviation of [\d.]+%, and 7%"):
        calibrate(untilted_views, *floor, *size_px)
    found = calibrate(tilted_views, *floor, *size_px).camera
    # three times the deviation that is allowed
    assert found.focal_px == pytest.approx(CAMERA.focal_px, rel=0.21)


def test_boards_in_the_middle_of_the_picture_are_refused() -> None:
    held = [(np.array([0.0, 0.0, 0.5]), turned) for _, turned in held_poses()]
    with pytest.raises(InputError, match=r"the boards reach over \d\d% of its width and .*border"):
        calibrated(held, ORIGIN, [])


HALF_TURN = flat_pose(0.0, 0.0, np.pi)
IN_THE_HAND: Pose = (np.array([0.3, 0.2, 0.6]), rotation(np.array([0.4, 0.2, 0.7])))


@pytest.mark.parametrize(
    ("origin", "flat", "named"),
    [
        ([*ORIGIN, HALF_TURN], FLAT, "origin/2.png"),
        ([HALF_TURN, *ORIGIN], FLAT, "origin/0.png"),
        ([*ORIGIN, flat_pose(0.3, 0.2, 0.7)], [], "origin/2.png"),
        ([*ORIGIN, flat_pose(0.01, 0.0, 0.0)], FLAT, "origin/2.png"),
        ([*ORIGIN, IN_THE_HAND], FLAT, "origin/2.png"),
        (ORIGIN, [*FLAT, IN_THE_HAND], "flat/3.png"),
        ([*ORIGIN, HALF_TURN], [IN_THE_HAND, *FLAT], "origin/2.png, flat/0.png"),
        (ORIGIN[:1], [IN_THE_HAND], "flat/0.png"),
        ([IN_THE_HAND, *ORIGIN[:1]], FLAT, "origin/0.png"),
    ],
)
def test_a_picture_that_contradicts_the_others_is_named(
    origin: list[Pose], flat: list[Pose], named: str
) -> None:
    with pytest.raises(InputError, match=f"contradict each other.* agree without {named};"):
        calibrated(held_poses(), origin, flat)


@pytest.mark.parametrize(
    ("origin", "flat", "told"),
    [
        (1, 0, "none agrees with the rest;"),
        (1, 2, r"only origin/0\.png, flat/0\.png, flat/1\.png agree with each other;"),
        (0, 0, "none agrees with the rest;"),
    ],
)
def test_many_pictures_that_contradict_are_told_in_few_solutions(
    origin: int, flat: int, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside as many right ones at the origin and flat, all others are of boards in the hand."""
    solutions = mock.Mock(wraps=floor._solved)
    monkeypatch.setattr(floor, "_solved", solutions)
    held = held_poses()
    at_origin = [*ORIGIN[:origin], *([] if origin else held[:8])]
    with pytest.raises(InputError, match=rf"contradict each other, one by .* px; {told}"):
        calibrated(held, at_origin, [*FLAT[:flat], *held[8:20]])
    # all, each of the flat ones beside what is at the origin, and those that fit
    assert solutions.call_count <= 2 + 12 + flat


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_board_is_printed_at_its_true_size(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"board{suffix}"
    assert main(["calibrate", "--board", str(path)]) == 0
    assert "on A2 or larger, and measure a square: it must be 80 mm" in capsys.readouterr().out
    with Pillow.open(path) as sheet:
        per_metre = np.array(sheet.info["dpi"], dtype=np.float64) / 0.0254
        # 0.594 m × 0.42 m is A2
        assert (np.array(sheet.size) / per_metre <= [0.594, 0.4201]).all()
    view = find_board(read_picture(path))
    assert view is not None
    assert len(view.pixels) == 24
    size_px, size_m = np.ptp(view.pixels, axis=0), np.ptp(view.points_m, axis=0)
    # BMP has whole pixels to a metre, and JPEG its noise
    assert size_px / per_metre == pytest.approx(size_m, rel=1e-5)


def test_pictures_of_the_origin_that_all_contradict_are_named() -> None:
    """As are blurred ones; then there is nothing to agree with."""
    held, origin = seen(held_poses(), "held", 1), seen(ORIGIN, "origin", 2)
    rng = np.random.default_rng(5)
    blurred = [
        view._replace(pixels=view.pixels + rng.normal(0.0, 5.0, view.pixels.shape))
        for view in origin
    ]
    with pytest.raises(InputError, match=r"none agrees with the rest; allowed"):
        calibrate(held, blurred, [], CAMERA.width_px, CAMERA.height_px)


@pytest.mark.parametrize(
    ("third_row", "lost_marker", "corners"),
    [(0, False, 0), (2, True, 0), (2, False, 8)],
    ids=["a row", "a row and one more", "a row and two more"],
)
def test_corners_in_one_row_are_no_view(third_row: int, lost_marker: bool, corners: int) -> None:
    """A picture of two rows of squares and as many of the third, without the marker below left."""
    side, margin = 100, 40
    board = board_print(side)
    board[2 * side :, third_row * side :] = 255
    board[3 * side :] = 255
    if lost_marker:
        board[side : 2 * side, :side] = 255
    sheet = np.pad(board, margin, constant_values=255)
    view = find_board(np.repeat(sheet[..., None], 3, axis=2))
    assert (0 if view is None else len(view.pixels)) == corners


def test_views_that_opencv_cannot_solve_are_not_told_as_untilted() -> None:
    origin = seen(ORIGIN, "origin", 2)
    row = [BoardView(view.points_m[:6], view.pixels[:6]) for view in origin]
    with pytest.raises(InputError, match=r"from the 26 views; show more of the board") as refusal:
        calibrate(seen(held_poses(), "held", 1), row, [], CAMERA.width_px, CAMERA.height_px)
    assert "tilt" not in str(refusal.value)


def test_pictures_that_show_too_little_of_the_board_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    held, origin = seen(held_poses(), "held", 1), seen(ORIGIN, "origin", 2)
    # the shade of a picture says which view it stands for
    shown = [*held[:10], None, *held[10:], *origin]
    for i in range(len(shown)):
        folder = tmp_path / "shots" / ("held" if i <= len(held) else "origin")
        folder.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(folder / f"{i}.png"), np.full((480, 640, 3), i, np.uint8))
    (tmp_path / "shots" / "held" / "._3.png").write_bytes(b"of a Mac")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "ttwmr_mj.studies.calibrate.find_board", lambda image: shown[int(image[0, 0, 0])]
    )
    assert main(["calibrate", "--images", "shots", "--out", "mine.yaml"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("too little of the board is seen in shots/held/10.png\n26 views, rms")
