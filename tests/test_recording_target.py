"""Where the robot should be, in a recording; the axes, the key and the words of the screen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import (
    FLOAT32_M,
    ROBOT,
    Recording,
    circle_reference,
    contact_run,
    record,
    robot_model,
)

from ttwmr_mj.plants.model.outline import chassis, outline
from ttwmr_mj.recording.layout import plot_view, roomy
from ttwmr_mj.recording.scene.target import distance, miss_text, spaced
from ttwmr_mj.recording.words import drawable
from ttwmr_mj.results.curves import Curves


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("rrd") / "run.rrd"
    return Recording(record(path, circle_reference(), contact_run(), cuts=(2, 31)))


def test_arrows_lead_from_the_reference_to_the_robot(read: Recording) -> None:
    run = contact_run()
    curves = Curves.of(run, ROBOT)
    tails = read.values("/world/miss/arrows", "Arrows3D:origins")
    heads = tails + read.values("/world/miss/arrows", "Arrows3D:vectors")
    wanted = np.stack([run.ref_q[:, 0, :2], curves.ref_trailer_com_m[:, 0]], axis=1)
    there = np.stack([run.q[:, 0, :2], curves.trailer_com_m[:, 0]], axis=1)
    np.testing.assert_allclose(tails[..., :2], wanted, atol=FLOAT32_M)
    np.testing.assert_allclose(heads[..., :2], there, atol=FLOAT32_M)


def test_every_third_row_says_how_far_off_it_is_whatever_the_chunks(read: Recording) -> None:
    run = contact_run()
    curves = Curves.of(run, ROBOT)
    texts = [
        row for row in read.entities["/world/miss/text"]["Points3D:labels"] if row[0] is not None
    ]
    assert [time for time, _ in texts] == [99_000_000 * k for k in range(21)]
    errors = zip(curves.tractor_error_m[::3, 0], curves.trailer_error_m[::3, 0], strict=True)
    assert [words for _, words in texts] == [[miss_text(*error)] for error in errors]


def test_distances_are_read_at_a_glance() -> None:
    assert [distance(d) for d in (4.56e-5, 0.00123, 0.0123, 0.987, 1.234)] == [
        "46 µm",
        "1.2 mm",
        "12 mm",
        "987 mm",
        "1.23 m",
    ]
    assert miss_text(0.0123, 0.2) == "tractor 12 mm off, trailer 200 mm"
    assert miss_text(0.0123, np.nan) == "tractor 12 mm off"


def test_places_are_where_the_robot_should_stand(read: Recording) -> None:
    run = contact_run()
    place = "/world/reference/place_tractor"
    at = read.values(place, "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(at[:, :2], run.ref_q[:, 0, :2], atol=FLOAT32_M)
    for name, column in (("tractor", 2), ("trailer", 3)):
        place = f"/world/reference/place_{name}"
        assert not read.values(place, "Transform3D:translation")[:, 0, 2].any()
        x, y, z, w = read.values(place, "Transform3D:quaternion")[:, 0].T
        np.testing.assert_allclose([x, y], 0.0, atol=1e-6)
        turned = 2.0 * np.arctan2(z, w) - run.ref_q[:, 0, column]
        np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-6)


def test_a_trailer_without_a_reference_has_no_place(tmp_path: Path) -> None:
    run, reference = contact_run(), circle_reference()
    ref_q = run.ref_q.copy()
    ref_q[..., 3] = np.nan
    aimless = replace(reference, theta=reference.theta * [1.0, np.nan])
    read = Recording(record(tmp_path / "run.rrd", aimless, replace(run, ref_q=ref_q)))
    moved = "Transform3D:translation"
    assert len(read.times_ns("/world/reference/place_tractor", moved)) == len(run)
    assert moved not in read.entities.get("/world/reference/place_trailer", {})
    # and one arrow, that of P
    assert read.values("/world/miss/arrows", "Arrows3D:vectors").shape[1] == 1


def test_the_outline_surrounds_the_chassis_and_its_wheels_with_a_margin() -> None:
    model = robot_model()
    bodies = chassis(model)
    assert list(bodies) == ["tractor", "trailer"]
    half_track = abs(float(model.body("wheel_left").pos[1]))
    wheel = model.geom_aabb[model.geom_group == 2]
    assert len(wheel)
    close, wide = (outline(model, bodies["tractor"], margin) for margin in (1e-6, 0.02))
    assert close[:, 1].max() > half_track  # the wheels are in it
    for i, sign in ((0, -1), (0, 1), (1, -1), (1, 1)):
        gained = (sign * wide[:, i]).max() - (sign * close[:, i]).max()
        assert gained == pytest.approx(0.02, rel=1e-3)


def test_a_path_is_thinned_to_its_steps_and_keeps_its_ends() -> None:
    points = np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros(101)])
    thin = spaced(points, 0.1)
    assert thin[[0, -1], 0].tolist() == [0.0, 1.0]
    assert 0.09 < np.diff(thin[:-1, 0]).min() <= np.diff(thin[:, 0]).max() < 0.12
    assert len(spaced(np.zeros((5, 2)), 0.1)) == 1  # a robot that stays has no path


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 500.0), (-100.0, 47.0), (-2.9, 2.6), (1e-6, 3e-6), (-990.0, 990.0)]
)
def test_an_axis_ends_between_two_ticks(low: float, high: float) -> None:
    bottom, top = roomy((low, high))
    span = high - low
    assert bottom < low < high < top
    assert max(low - bottom, top - high) < 0.15 * span
    tick = 10.0 ** (np.floor(np.log10(span)) - 1.0)
    np.testing.assert_allclose(np.array([bottom, top]) / tick % 1.0, 0.5, atol=1e-6)


def test_an_axis_of_one_value_shows_it() -> None:
    assert roomy((2.0, 2.0)) == (1.0, 3.0)
    assert roomy((0.0, 0.0)) == (-1.0, 1.0)


def test_a_legend_gets_room_over_the_curves() -> None:
    from rerun.blueprint import Corner2D

    def top(legend: Corner2D | None) -> float:
        axis = plot_view("p", "p", legend, values=(0.0, 10.0)).properties["ScalarAxis"]
        return float(axis.range.as_arrow_array().to_pylist()[0][1])

    assert top(None) < 12.0
    assert top(Corner2D.RightTop) > 15.0


def test_the_key_names_what_is_drawn(tmp_path: Path, read: Recording) -> None:
    def names(recording: Recording) -> list[str]:
        ((_, labels),) = recording.entities["/key/names"]["Points2D:labels"]
        return labels

    free = Recording(record(tmp_path / "run.rrd", None, contact_run()))
    assert names(free) == ["tractor, P", "trailer, COM", "force, 30 mm/N"]
    assert names(read) == [
        "reference",
        "tractor, P",
        "trailer, COM",
        "off reference",
        "force, 30 mm/N",
    ]


def test_what_the_viewer_cannot_draw_is_no_part_of_its_text() -> None:
    """It ends itself over a character that its font lacks."""
    kept = "θ2 − θ1 ≤ 0.2 rad · P’s “way”: 3 µm², log₁₀, é, ж → …"
    assert drawable(kept) == kept
    assert drawable("😀 走 │") == "? ? ?"
