"""What a camera saw in a recording: pictures, labels found, true and searched for, the estimate."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from recordings import Recording, recorder

from ttwmr_mj.recording.blueprint import _overhead_eye
from ttwmr_mj.recording.camera_view import CameraView
from ttwmr_mj.recording.layout import following_eye

NAN = np.full(2, np.nan)
FOUND = np.array([[1.0, 2.0], NAN, [3.0, 4.0], [5.0, 6.0]])
LOOKED_FOR = np.array([[1.5, 2.5], [7.0, 8.0], NAN, [5.0, 6.0]])
TRUE = np.array([[1.0, 2.0], [7.0, 8.0], [3.0, 4.0], NAN])
FIRST = np.array([0.0, 0.0, 0.0, 0.0])
POSE = np.array([0.1, -0.2, 0.3, -0.4])
# front and rear of the tractor, then of the trailer, 0.1 m and 0.12 m over the floor
LABELS = np.array([[1.0, 0.0, 0.1], [2.0, 0.0, 0.1], [3.0, 0.0, 0.12], [4.0, 0.0, 0.12]])


def estimate(q: np.ndarray, status: str = "tracking") -> SimpleNamespace:
    covariance = np.diag([4e-6, 9e-6, 1.0, 1.0])  # 2 mm along x, 3 mm along y
    return SimpleNamespace(q=q, status=status, covariance=covariance)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Three control periods, of which the second brings a frame."""
    path: Path = tmp_path_factory.mktemp("camera") / "run.rrd"
    image = np.zeros((16, 16, 3), np.uint8)
    image[:, 8:] = 255
    image[1::2] = image[:, 1::2] = 128  # left out
    frame, truth = SimpleNamespace(pixels=image), SimpleNamespace(centres_px=TRUE)
    sighting = SimpleNamespace(found_px=FOUND, predicted_px=LOOKED_FOR, search_px=2.5)
    nothing = dict.fromkeys(("frame", "truth", "sighting"))
    seen = {"frame": frame, "truth": truth, "sighting": sighting}
    records = [
        SimpleNamespace(time_s=0.0, estimate=estimate(NAN, "lost"), **nothing),
        SimpleNamespace(time_s=0.5, estimate=estimate(FIRST), **seen),
        SimpleNamespace(time_s=1.0, estimate=estimate(POSE), **nothing),
    ]
    # a camera that sees x, y, and marks its height by 1000 px per metre in x
    camera = SimpleNamespace(project=lambda p: p[..., :2] + 1000 * p[..., 2:] * [1.0, 0.0])
    layout = SimpleNamespace(
        trailers=1,
        centres_m=lambda q: LABELS + np.insert(q[..., None, :2], 2, 0.0, axis=-1),
        hitches_m=lambda q: q[None, :2],
        height_m=np.array([0.1, 0.1, 0.12, 0.12]),
        names=("tractor_front", "tractor_rear", "trailer_front", "trailer_rear"),
    )
    with recorder(path, None) as recording:
        recording.append_camera(camera, layout, records[:1])
        recording.append_camera(camera, layout, records[1:])
        recording.append_camera(camera, layout, [])
    return Recording(path)


HALF_S, ONE_S = 500_000_000, 1_000_000_000


def test_the_picture_is_the_frame(read: Recording) -> None:
    ((time_ns, (blob,)),) = read.entities["/camera/picture/frame"]["EncodedImage:blob"]
    picture = cv2.imdecode(np.array(blob, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert time_ns == HALF_S
    assert picture.shape == (8, 8, 3)
    assert picture[:, :3].max() < 64 < 192 < picture[:, 5:].min()
    # its first pixel is the camera's first, its eighth the camera's fifteenth
    entity = read.entities["/camera/picture/frame"]
    ((_, (shift,)),) = entity["Transform3D:translation"]
    ((_, (scale,)),) = entity["Transform3D:scale"]
    for kept, pixel in ((0, 0), (7, 14)):
        # pictures begin at their first pixel's edge, half a pixel before its middle
        np.testing.assert_allclose(shift[:2] + np.array(scale[:2]) * (kept + 0.5), pixel + 0.5)


def test_labels_are_where_they_were_found_and_are(read: Recording) -> None:
    for name, points in (("found", FOUND), ("true", TRUE)):
        ((time_ns, shown),) = read.entities[f"/camera/picture/{name}"]["Points2D:positions"]
        assert time_ns == HALF_S
        np.testing.assert_array_equal(shown, points[np.isfinite(points[:, 0])])


def test_labels_that_are_hidden_are_named_where_they_must_be(read: Recording) -> None:
    points = read.entities["/camera/picture/hidden"]["Points2D:positions"]
    names = read.entities["/camera/picture/hidden"]["Points2D:labels"]
    assert [time_ns for time_ns, _ in points] == [HALF_S]
    assert points[0][1] == [[102.0, 0.0]]
    assert names[0][1] == ["tractor rear"]


@pytest.mark.parametrize(
    ("missing", "texts"),
    [
        ([], []),
        ([1], ["tractor rear"]),
        ([1, 2], ["tractor rear, trailer front", ""]),
        ([0, 1, 2], ["3 labels not found", "", ""]),
        ([0, 1, 2, 3], ["no label found", "", "", ""]),
    ],
)
def test_names_of_hidden_labels_do_not_cover_each_other(
    missing: list[int], texts: list[str]
) -> None:
    """Side by side in a panel of a few hundred pixels they would."""
    names = ["tractor front", "tractor rear", "trailer front", "trailer rear"]
    view: Any = SimpleNamespace(_names=names)
    assert CameraView._named(view, np.isin(np.arange(4), missing)) == texts


def test_boxes_are_where_labels_were_looked_for(read: Recording) -> None:
    ((time_ns, centres),) = read.entities["/camera/picture/search"]["Boxes2D:centers"]
    assert time_ns == HALF_S
    np.testing.assert_array_equal(centres, LOOKED_FOR[[0, 1, 3]])
    ((_, halves),) = read.entities["/camera/picture/search"]["Boxes2D:half_sizes"]
    np.testing.assert_array_equal(halves, [[2.5, 2.5]] * 3)


def test_looks_are_said_once_for_all_times(read: Recording) -> None:
    for name, component in (
        ("found", "Points2D:colors"),
        ("true", "Points2D:colors"),
        ("search", "Boxes2D:colors"),
        ("estimate", "LineStrips2D:colors"),
        ("covariance", "LineStrips2D:colors"),
    ):
        ((time_ns, colours),) = read.entities[f"/camera/picture/{name}"][component]
        assert (time_ns, len(colours)) == (None, 1)


def test_the_estimate_runs_along_the_robot_through_its_hitch(read: Recording) -> None:
    strips = read.entities["/camera/picture/estimate"]["LineStrips2D:strips"]
    assert [time_ns for time_ns, _ in strips] == [HALF_S, ONE_S]  # nothing while it is unknown
    for (_, (line,)), q in zip(strips, (FIRST, POSE), strict=True):
        x, y = q[:2]
        # P at the labels' mean height on the tractor and the trailer
        expected = [[101 + x, y], [102 + x, y], [110 + x, y], [123 + x, y], [124 + x, y]]
        np.testing.assert_allclose(line, expected, rtol=1e-6)


def test_the_ellipse_is_three_sigma_enlarged_about_p(read: Recording) -> None:
    strips = read.entities["/camera/picture/covariance"]["LineStrips2D:strips"]
    ring = np.array(strips[1][1][0]) - POSE[:2] - [110.0, 0.0]
    # 3 σ, 50 times: 0.3 m along x and 0.45 m along y; 1e-4: the samples around the ring
    np.testing.assert_allclose(np.abs(ring).max(axis=0), [0.3, 0.45], atol=1e-4)
    np.testing.assert_allclose(((ring / [0.3, 0.45]) ** 2).sum(axis=1), 1.0, atol=1e-3)
    np.testing.assert_allclose(ring[0], ring[-1], atol=1e-5)


def test_the_trackers_state_holds_its_changes(read: Recording) -> None:
    states = read.entities["/tracker"]["StateChange:state"]
    assert states == [(0, ["lost"]), (HALF_S, ["tracking"])]


def test_the_eye_above_sees_the_whole_floor() -> None:
    tall = _overhead_eye(np.array([[-1.0, -2.0], [2.0, 4.0]]))
    assert tall.position.as_arrow_array().to_pylist() == [pytest.approx([0.5, 1.0 - 6e-3, 6.0])]
    assert tall.look_target.as_arrow_array().to_pylist() == [pytest.approx([0.5, 1.0, 0.0])]
    assert tall.eye_up.as_arrow_array().to_pylist() == [[0.0, 1.0, 0.0]]
    wide = _overhead_eye(np.array([[0.0, 0.0], [12.0, 4.0]]))
    assert wide.position.as_arrow_array().to_pylist()[0][2] == pytest.approx(10.0)


def test_the_eye_behind_follows_p() -> None:
    eye = following_eye()
    assert eye.position.as_arrow_array().to_pylist() == [pytest.approx([-0.32, -0.35, 0.34])]
    assert eye.look_target.as_arrow_array().to_pylist() == [[0.0, 0.0, 0.0]]
    assert eye.eye_up.as_arrow_array().to_pylist() == [[0.0, 0.0, 1.0]]
    assert eye.tracking_entity.as_arrow_array().to_pylist() == ["/world/tractor/P"]
    farther = following_eye(2.0).position.as_arrow_array().to_pylist()
    assert farther == [pytest.approx([-0.64, -0.7, 0.68])]
