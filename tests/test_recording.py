"""What a recording of a run holds, written and read back with rerun's own reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import BODIES, ROBOT, Recording, circle_reference, contact_run, record

from ttwmr_mj.recording.series import time_column
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.state import FloatArray


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    run = contact_run()
    reference = circle_reference()
    return Recording(record(tmp_path_factory.mktemp("rrd") / "run.rrd", reference, run))


def test_every_row_is_there_in_exact_nanoseconds(recording: Recording) -> None:
    run = contact_run()
    expected = [33_000_000 * k for k in range(len(run))]
    for name in ("x", "y", "theta1", "theta2", "wheel_speed", "hitch_angle", "tractor_error"):
        assert recording.times_ns(f"/plots/{name}/true", "Scalars:scalars") == expected
    for body in BODIES:
        assert recording.times_ns(f"/world/{body}", "Transform3D:translation") == expected
    for path in ("/world/driven/tractor", "/world/driven/trailer"):
        assert recording.times_ns(path, "LineStrips3D:strips") == expected
    assert recording.timelines == {"sim_time"}


def test_times_are_rounded_not_truncated() -> None:
    time_s = np.array([0.57, 1.001])
    assert (1e9 * time_s).astype(int).tolist() != [570_000_000, 1_001_000_000]
    column = time_column(time_s).as_arrow_array()
    assert column.cast("int64").to_pylist() == [570_000_000, 1_001_000_000]


def test_plots_hold_the_rows(recording: Recording) -> None:
    run = contact_run()
    curves = Curves.of(run, ROBOT)

    def scalars(entity: str) -> FloatArray:
        return recording.values(f"/plots/{entity}", "Scalars:scalars")

    for i, (name, scale) in enumerate((("x", 1e3), ("y", 1e3), ("theta1", 1.0), ("theta2", 1.0))):
        np.testing.assert_array_equal(scalars(f"{name}/true"), scale * run.q[:, 0, [i]])
        np.testing.assert_array_equal(scalars(f"{name}/reference"), scale * run.ref_q[:, 0, [i]])
    np.testing.assert_array_equal(scalars("wheel_speed/true"), run.wheel_speed_rad_s[:, 0])
    np.testing.assert_array_equal(scalars("wheel_speed/command"), run.wheel_command_rad_s[:, 0])
    np.testing.assert_array_equal(scalars("tractor_error/true"), 1e3 * curves.tractor_error_m)
    np.testing.assert_array_equal(scalars("trailer_error/true"), 1e3 * curves.trailer_error_m)
    # on a log scale that ends at a micrometre: the run starts on its reference
    for name, error_m in (("tractor", curves.tractor_error_m), ("trailer", curves.trailer_error_m)):
        told_mm = 10 ** scalars(f"position_error/{name}")
        np.testing.assert_allclose(told_mm, np.maximum(1e3 * error_m, 1e-3), rtol=1e-12)
    degrees = np.degrees(curves.theta_error_rad[:, 0])
    np.testing.assert_array_equal(scalars("angle_error/theta1"), degrees[:, [0]])
    np.testing.assert_array_equal(scalars("angle_error/theta2"), degrees[:, [1]])
    np.testing.assert_array_equal(scalars("hitch_angle/true"), np.degrees(curves.hitch_angle_rad))


def test_series_are_named_and_coloured(tmp_path: Path) -> None:
    run = contact_run()
    rows = replace(run, est_q=run.est_q + 0.01)
    recording = Recording(record(tmp_path / "run.rrd", circle_reference(), rows))
    named = {
        entity.removeprefix("/plots/"): components["SeriesLines:names"][0][1]
        for entity, components in recording.entities.items()
        if entity.startswith("/plots/")
    }
    against = {"true": ["true"], "seen": ["estimated"], "reference": ["reference"]}
    angles, error = {"theta1": ["θ1"], "theta2": ["θ2"]}, {"true": ["true"]}
    known, wheels = {"seen": ["estimated"]}, {"true": ["right", "left"]}
    plots = {
        **dict.fromkeys(("x", "y", "theta1", "theta2"), against),
        **dict.fromkeys(("tractor_error", "trailer_error", "hitch_angle"), error),
        **dict.fromkeys(("angle_error", "estimate_angle_error"), angles),
        **dict.fromkeys(("estimate_error", "measurement_age"), known),
        "position_error": {"tractor": ["tractor, P"], "trailer": ["trailer, COM"]},
        "wheel_speed": wheels | {"command": ["right command", "left command"]},
    }
    expected = {
        (plot, line): names for plot, lines in plots.items() for line, names in lines.items()
    }
    assert named == {f"{plot}/{line}": names for (plot, line), names in expected.items()}
    linear = recording.entities["/plots/x/true"]["SeriesLines:interpolation_mode"]
    for entity, names in named.items():
        looks = recording.entities[f"/plots/{entity}"]
        assert len(looks["SeriesLines:colors"][0][1]) == len(names)
        # what was asked for is a wide band under the line of what happened
        wide = entity.endswith(("/reference", "/command"))
        assert looks["SeriesLines:widths"] == [(None, [5.0 if wide else 2.0] * len(names))]
        stepped = entity == "wheel_speed/command"
        assert (looks["SeriesLines:interpolation_mode"] != linear) == stepped


def test_an_estimate_equal_to_the_truth_is_not_drawn(recording: Recording) -> None:
    assert not [entity for entity in recording.entities if entity.endswith("/seen")]


def test_states_hold_their_changes(recording: Recording) -> None:
    assert recording.entities["/wheels"]["StateChange:state"] == [
        (0, ["free"]),
        (330_000_000, ["saturated"]),
        (495_000_000, ["free"]),
    ]
    assert recording.entities["/law"]["StateChange:state"] == [(0, ["regular"])]


def test_rest_is_not_called_singular(tmp_path: Path) -> None:
    """Not while the robot starts either, only a standstill that it comes to while it moves."""
    run = contact_run()
    near, q_rate = run.near_singular.copy(), run.q_rate.copy()
    near[:6], near[20:25] = True, True
    q_rate[0, 0, :2], q_rate[1:, 0, :2] = 0.0, 0.005
    rows = replace(run, near_singular=near, q_rate=q_rate)
    # a cut within the start: what came before is not forgotten
    read = Recording(record(tmp_path / "run.rrd", circle_reference(), rows, cuts=(3,)))
    assert read.entities["/law"]["StateChange:state"] == [
        (0, ["resting"]),
        (198_000_000, ["regular"]),
        (660_000_000, ["near_singular"]),
        (825_000_000, ["regular"]),
    ]


def test_report_ends_with_the_result(recording: Recording) -> None:
    (*_, (_, last)) = recording.entities["/report"]["TextDocument:text"]
    assert last == ["**ok**"]
    (*_, (_, last)) = recording.entities["/details"]["TextDocument:text"]
    assert last == ["| rms | 1 mm |\n\n# circle\nseed 7"]


def test_an_undefined_reference_gives_no_series(tmp_path: Path) -> None:
    run = contact_run()
    rows = replace(run, ref_q=np.full_like(run.ref_q, np.nan))
    recording = Recording(record(tmp_path / "run.rrd", None, rows))
    for entity in recording.entities:
        assert not entity.startswith(("/world/reference", "/world/miss")), entity
        assert not entity.endswith("/reference"), entity
        assert "_error" not in entity
    for (entity, name), values in recording.temporal().items():
        if name == "Scalars:scalars":
            assert np.isfinite([value for _, value in values]).all(), entity


def test_rows_of_a_broken_run_are_left_out(tmp_path: Path) -> None:
    run = contact_run()
    reference = circle_reference()
    rows = replace(run, q=run.q.copy())
    rows.q[40:] = np.nan
    read = Recording(record(tmp_path / "run.rrd", reference, rows, cuts=(30, 50)))
    for entity, component in (
        ("/world/tractor", "Transform3D:translation"),
        ("/plots/wheel_speed/true", "Scalars:scalars"),
    ):
        assert len(read.times_ns(entity, component)) == 40


def test_what_the_sensor_saw_is_plotted_against_the_truth(tmp_path: Path) -> None:
    run = contact_run()
    rows = replace(
        run,
        est_q=run.est_q + [0.003, 0.004, 0.01, -0.02],
        measurement_age_s=np.full_like(run.measurement_age_s, 0.05),
    )
    recording = Recording(record(tmp_path / "run.rrd", None, rows))

    def scalars(entity: str) -> FloatArray:
        return recording.values(f"/plots/{entity}", "Scalars:scalars")

    np.testing.assert_array_equal(scalars("theta2/seen"), rows.est_q[:, 0, [3]])
    np.testing.assert_allclose(scalars("estimate_error/seen"), 5.0)  # mm
    np.testing.assert_allclose(scalars("estimate_angle_error/theta1"), 10.0)  # mrad
    np.testing.assert_allclose(scalars("estimate_angle_error/theta2"), -20.0)
    np.testing.assert_allclose(scalars("measurement_age/seen"), 50.0)  # ms


def test_the_only_properties_are_the_name_and_the_scenario(recording: Recording) -> None:
    """The time of the recording is not among them: it says nothing about the run."""
    properties = {
        entity: sorted(components)
        for entity, components in recording.entities.items()
        if entity.startswith("/__properties")
    }
    assert properties == {
        "/__properties": ["RecordingInfo:name"],
        "/__properties/scenario": [],  # its name, a component of no archetype: the reader skips it
    }
