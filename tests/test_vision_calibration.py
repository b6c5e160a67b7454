"""Calibration finds the camera back; its file is checked on the way in."""

from __future__ import annotations

import re
import shutil
import weakref
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from vision_scene import lab_calibration, model

from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.calibrate import calibrate_from_images
from ttwmr_mj.vision.calibration.board import THICKNESS_M, BoardCamera, BoardView, find_board
from ttwmr_mj.vision.calibration.calibrate import FLAT_POSES, _held_poses, calibrate
from ttwmr_mj.vision.calibration.file import CONTENT, load_calibration, save_calibration
from ttwmr_mj.vision.calibration.floor import flat_pose
from ttwmr_mj.vision.camera.model import hang_camera
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions


def test_board_corners_are_found_to_a_hundredth_of_a_pixel() -> None:
    source = BoardCamera(CameraOptions(), np.random.default_rng(0))
    # at 1.9 m a square measures 27 px; three places in a pixel
    for x in (0.0, 0.0007, 0.0013):
        view = find_board(source.take(np.array([x, 0.0, 0.003]), np.eye(3), 0.0))
        assert view is not None
        assert len(view.pixels) == 24
        points = np.column_stack([view.points_m, np.full(24, 0.003)]) + [x, 0.0, 0.0]
        error = view.pixels - source.true.project(points)
        assert np.abs(error).max() < 0.0125


def test_calibration_recovers_the_true_camera() -> None:
    calibration, true = lab_calibration(), hang_camera(model(), LAB_CAMERA)
    found = calibration.camera
    assert calibration.views >= 20
    assert calibration.reprojection_rms_px < 0.15
    assert calibration.floor_rms_px < 0.15
    # 24 corners in some 30 views at 0.02 px: a tenth of a pixel in focal length and axis
    assert found.focal_px == pytest.approx(true.focal_px, abs=0.5)
    assert found.principal_px == pytest.approx(true.principal_px, abs=0.5)
    assert found.distortion[:2] == pytest.approx(true.distortion[:2], abs=0.01)
    assert found.position_m == pytest.approx(true.position_m, abs=2e-3)


def test_calibrated_rays_meet_the_floor_within_a_fifth_of_a_millimetre() -> None:
    found, true = lab_calibration().camera, hang_camera(model(), LAB_CAMERA)
    x, y = np.meshgrid(np.linspace(-0.65, 0.65, 9), np.linspace(-0.6, 0.6, 9))
    points = np.column_stack([x.ravel(), y.ravel(), np.full(81, 0.0696)])
    error = found.to_plane(true.project(points), 0.0696) - points[:, :2]
    assert np.linalg.norm(error, axis=1).max() < 2e-4


def test_a_file_brings_every_number_back(tmp_path: Path) -> None:
    path = tmp_path / "camera.yml"
    save_calibration(lab_calibration(), path)
    loaded, saved = load_calibration(path), lab_calibration()
    assert loaded.camera.matrix == pytest.approx(saved.camera.matrix, abs=1e-12)
    assert loaded.camera.distortion == pytest.approx(saved.camera.distortion, abs=1e-14)
    assert loaded.camera.rotation == pytest.approx(saved.camera.rotation, abs=1e-14)
    assert loaded.camera.position_m == pytest.approx(saved.camera.position_m, abs=1e-14)
    assert loaded.views == saved.views


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "cannot be read"),
        ("not: [yaml", "cannot be read"),
        ("%YAML:1.0\n---\nimage_width: 640\n", "image_height: is missing"),
        ("\x00\x01\x02", "cannot be read"),
    ],
)
def test_unreadable_files_say_what_to_do(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "camera.yml"
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        load_calibration(path)
    assert "ttwmr calibrate" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image_width: 640", "image_width: -640", "image_width: got -640; allowed: a whole"),
        ("image_width: 640", "image_width: 0", "whole number"),
        ("image_width: 640", "image_width: 640.5", "whole number"),
        ("views: ", "views: 0 # ", "views: got 0"),
        ("image_width: 640", "image_width: wide", "neither a number nor a matrix"),
        ("floor_rms_px: ", "floor_rms_px: .NaN # ", "floor_rms_px: .* finite"),
        ("rows: 3", "rows: 2", "damaged|shape|cannot be read"),
        ("image_height", "image_hight", "image_height: is missing"),
    ],
)
def test_damaged_values_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "camera.yml"
    save_calibration(lab_calibration(), path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        load_calibration(path)


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("rotation_world_to_camera", 1.001, "is not a rotation"),
        ("camera_matrix", -1.0, "focal length that is not positive"),
        ("camera_position_m", np.inf, "camera_position_m: .* finite"),
    ],
)
def test_impossible_cameras_are_refused(
    tmp_path: Path, key: str, change: float, message: str
) -> None:
    path = tmp_path / "camera.yml"
    save_calibration(lab_calibration(), path)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    values = {name: storage.getNode(name) for name in CONTENT}
    values = {name: n.mat() if n.isMap() else n.real() for name, n in values.items()}
    storage.release()
    writer = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        writer.write(name, np.asarray(value) * change if name == key else value)
    writer.release()
    with pytest.raises(InputError, match=message):
        load_calibration(path)


@pytest.mark.parametrize(
    ("place", "number", "message"),
    [
        ((2, 2), 0.0, r"allowed: \[\[fx, 0, cx\], \[0, fy, cy\], \[0, 0, 1\]\]"),
        ((2, 0), 100.0, r"allowed: \[\[fx, 0, cx\]"),
        ((0, 1), 50.0, r"allowed: \[\[fx, 0, cx\]"),
        ((1, 0), 50.0, r"allowed: \[\[fx, 0, cx\]"),
        ((0, 2), 2000.0, "principal point at 2000, .* 640 × 480 px"),
        ((1, 2), -500.0, "principal point at"),
        ((0, 0), 6400.0, "focal lengths of 6400 and .* ratio of 3"),
        ("reprojection_rms_px", -5.0, "got -5; allowed: 0 or more"),
        ("floor_rms_px", -1e-3, "allowed: 0 or more"),
    ],
)
def test_numbers_of_a_calibration_that_no_camera_has_are_refused(
    place: tuple[int, int] | str, number: float, message: str, tmp_path: Path
) -> None:
    saved = lab_calibration()
    if isinstance(place, str):
        saved = replace(saved, **{place: number})  # type: ignore[arg-type]  # floats, both
    save_calibration(saved, path := tmp_path / "camera.yml")
    if not isinstance(place, str):
        matrix = saved.camera.matrix
        matrix[place] = number
        numbers = ", ".join(f"{float(value)!r}" for value in matrix.ravel())
        text = re.sub(r"(camera_matrix:[^\[]*\[)[^\]]*", rf"\g<1>{numbers}", path.read_text())
        path.write_text(text)
    with pytest.raises(InputError, match=rf"camera\.yml: 1 error\n  .*{message}"):
        load_calibration(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rotation": np.eye(3)}, "rotation_world_to_camera: .* does not look down"),
        ({"rotation": np.eye(3)[[0, 2, 1]] * [1, 1, -1]}, "does not look down at the floor"),
        (
            {"distortion": np.array([-1.9, 0.05, 0.0, 0.0, 0.0])},
            "got k1 = -1.9, .* folds the image",
        ),
        (
            {"distortion": np.array([1e5, 0.05, 0.0, 0.0, 0.0])},
            "distortion_coefficients: got k1 = 100000, .* reaches 0.029 times as far as without",
        ),
    ],
)
def test_a_camera_that_cannot_look_at_the_floor_is_refused(
    change: dict[str, np.ndarray], message: str, tmp_path: Path
) -> None:
    camera = replace(lab_calibration().camera, **change)  # type: ignore[arg-type]  # arrays, all
    save_calibration(replace(lab_calibration(), camera=camera), tmp_path / "camera.yml")
    with pytest.raises(InputError, match=rf"camera\.yml: 1 error\n  .*{message}.*ttwmr calibrate"):
        load_calibration(tmp_path / "camera.yml")


@pytest.mark.parametrize("between", ["", "...\n---\n"], ids=["document", "two documents"])
@pytest.mark.parametrize("key", ["image_width", "camera_position_m"])
def test_a_key_that_is_there_twice_is_refused(key: str, between: str, tmp_path: Path) -> None:
    save_calibration(lab_calibration(), path := tmp_path / "camera.yml")
    again = re.search(rf"^{key}:.*\n(?: .*\n)*", path.read_text(), re.M)
    assert again is not None
    path.write_text(path.read_text() + between + again[0].replace("1.", "3."))
    with pytest.raises(InputError, match=f"{key}: is there 2 times; allowed: once"):
        load_calibration(path)


def test_one_view_is_a_number_of_views(tmp_path: Path) -> None:
    save_calibration(replace(lab_calibration(), views=1), tmp_path / "camera.yml")
    assert load_calibration(tmp_path / "camera.yml").views == 1


def test_boards_of_known_pose_give_the_camera_back() -> None:
    """Corners projected by a camera, without noise: every number comes back."""
    true = hang_camera(model(), LAB_CAMERA)
    columns, rows = np.meshgrid(np.arange(-3, 4), np.arange(-2, 3))
    board = 0.08 * np.column_stack([columns.ravel(), rows.ravel()])

    def view(rotation: np.ndarray, position: np.ndarray) -> BoardView:
        points = position + board @ rotation[:, :2].T
        return BoardView(board, true.project(points))

    rng = np.random.default_rng(0)
    low, high = [-0.6, -0.4, 0.4], [0.6, 0.4, 1.0]
    held = [
        view(cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))[0], rng.uniform(low, high)) for _ in range(12)
    ]
    flat = [
        view(cv2.Rodrigues(np.array([0.0, 0.0, angle]))[0], np.array([x, y, THICKNESS_M]))
        for x, y, angle in ((0.6, 0.4, 0.5), (-0.6, 0.4, -2.5), (-0.5, -0.4, 2.8))
    ]
    origin = [view(np.eye(3), np.array([0.0, 0.0, THICKNESS_M]))]
    found = calibrate(held, origin, flat, 640, 480)
    # OpenCV takes corners in single precision: 1e-5 px
    assert found.reprojection_rms_px < 1e-4
    assert found.floor_rms_px < 1e-3
    assert found.views == 16
    assert found.camera.focal_px == pytest.approx(true.focal_px, abs=1e-2)
    assert found.camera.principal_px == pytest.approx(true.principal_px, abs=1e-2)
    assert found.camera.distortion == pytest.approx(true.distortion, abs=1e-4)
    assert found.camera.position_m == pytest.approx(true.position_m, abs=1e-5)
    assert found.camera.rotation == pytest.approx(true.rotation, abs=1e-5)


def test_held_boards_reach_every_part_of_the_picture() -> None:
    camera = hang_camera(model(), LAB_CAMERA)
    poses = _held_poses(camera, np.random.default_rng(0))
    places = np.array([camera.project(position) for position, _ in poses])
    assert places.min(axis=0) == pytest.approx([0.18 * 640, 0.2 * 480], abs=1e-6)
    assert places.max(axis=0) == pytest.approx([0.82 * 640, 0.8 * 480], abs=1e-6)
    assert len(np.unique(places.round(3), axis=0)) == 12
    for position, rotation in poses:
        assert 0.5 <= position[2] <= 1.2
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
        assert 0.15 <= np.arccos(rotation[2, 2]) <= 0.6


def test_missing_file_and_unwritable_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such calibration file"):
        load_calibration(tmp_path / "none.yml")
    with pytest.raises(FileNotFoundError):
        save_calibration(lab_calibration(), tmp_path / "none" / "camera.yml")


def album(folder: Path, **sizes: tuple[int, int]) -> Path:
    """Grey pictures of these rows and columns, one in each of the folders named."""
    for name, size in sizes.items():
        (folder / name).mkdir()
        cv2.imwrite(str(folder / name / "a.png"), np.full((*size, 3), 200, dtype=np.uint8))
    return folder


def test_no_boards_no_calibration(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="board was found in 0 views"):
        calibrate([], [], [], 640, 480)
    with pytest.raises(InputError, match="board was found in 0 views"):
        calibrate_from_images(album(tmp_path, held=(480, 640), origin=(480, 640)))


def test_what_else_opencv_has_written_beside_a_calibration_does_no_harm(tmp_path: Path) -> None:
    save_calibration(lab_calibration(), tmp_path / "lab.yaml")
    source = cv2.FileStorage(str(tmp_path / "lab.yaml"), cv2.FILE_STORAGE_READ)
    target = cv2.FileStorage(str(tmp_path / "more.yaml"), cv2.FILE_STORAGE_WRITE)
    for key in source.root().keys():  # noqa: SIM118  # it is no dictionary
        node = source.getNode(key)
        target.write(key, node.mat() if node.isMap() else node.real())
    target.write("rvecs", np.zeros((12, 3)))
    target.write("points", np.zeros((2, 150), np.float32))
    target.release()
    found = load_calibration(tmp_path / "more.yaml").camera
    assert found.focal_px == pytest.approx(lab_calibration().camera.focal_px, rel=1e-12)
    text = (tmp_path / "more.yaml").read_text()
    (tmp_path / "more.yaml").write_text(text.replace("rows: 12", "rows: 13"))
    with pytest.raises(InputError, match="a matrix that does not have as many numbers as it says"):
        load_calibration(tmp_path / "more.yaml")


def test_images_of_two_sizes_or_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"needs pictures in .*held \(got 0\)"):
        calibrate_from_images(tmp_path)
    album(tmp_path, held=(480, 640), origin=(480, 640), flat=(240, 320))
    with pytest.raises(InputError, match=r"flat/a\.png: got 320×240 px; .* has 640×480"):
        calibrate_from_images(tmp_path)
    (tmp_path / "flat" / "a.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="cannot be read as an image"):
        calibrate_from_images(tmp_path)


def test_pictures_are_looked_at_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Forty large ones together would take 4 GB."""
    album(tmp_path, held=(48, 64), origin=(48, 64), flat=(48, 64))
    for i in range(9):
        shutil.copy(tmp_path / "held" / "a.png", tmp_path / "held" / f"{i}.png")
    kept: list[weakref.ref[np.ndarray]] = []

    def look(image: np.ndarray) -> None:
        kept.append(weakref.ref(image))
        assert sum(one() is not None for one in kept) == 1

    monkeypatch.setattr("ttwmr_mj.studies.calibrate.find_board", look)
    with pytest.raises(InputError, match="board was found in 0 views"):
        calibrate_from_images(tmp_path)
    assert len(kept) == 12


@pytest.mark.slow
def test_a_photographed_board_calibrates_like_a_simulated_one(tmp_path: Path) -> None:
    """Pictures on disk of a camera whose geometry is known, and one without a board."""
    source, rng = BoardCamera(CameraOptions(), np.random.default_rng(0)), np.random.default_rng(1)
    album(tmp_path, held=(480, 640), origin=(480, 640), flat=(480, 640))
    shots = {"held": _held_poses(source.true, rng), "origin": [flat_pose(0.0, 0.0, 0.0)] * 2}
    shots["flat"] = [flat_pose(*pose) for pose in FLAT_POSES]
    for name, poses in shots.items():
        for i, pose in enumerate(poses):
            cv2.imwrite(str(tmp_path / name / f"{i}.JPG"), source.take(*pose, 0.0))
    found, _ = calibrate_from_images(tmp_path)
    assert len(shots["flat"]) + 20 <= found.views <= 30
    # JPEG and the corners' 0.01 px
    assert found.camera.focal_px == pytest.approx(source.true.focal_px, abs=0.5)
    assert found.camera.position_m == pytest.approx(source.true.position_m, abs=2e-3)
    assert found.camera.rotation == pytest.approx(source.true.rotation, abs=2e-3)
