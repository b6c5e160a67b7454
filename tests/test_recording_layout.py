"""Which tabs and plots a viewer shows, for runs, comparisons and tracked videos; signals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recordings import (
    FLOAT32_M,
    PERIOD_S,
    ROBOT,
    Recording,
    circle_reference,
    contact_run,
    record,
    recorder,
    robot_model,
    views,
)

from ttwmr_mj.errors import InputError
from ttwmr_mj.recording.run_recorder import RunRecorder
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.vision.camera.labels import read_layout

MOTION = {
    "plots/x": "x of P [mm]",
    "plots/y": "y of P [mm]",
    "plots/theta1": "θ1 of the tractor [rad]",
    "plots/theta2": "θ2 of the trailer [rad]",
    "plots/hitch_angle": "hitch angle θ2 − θ1 [°]",
    "plots/wheel_speed": "wheel speeds [rad/s]",
}
ERRORS = {
    "plots/position_error": "off the reference, log₁₀ of mm (1 = 1 cm, 2 = 10 cm)",
    "plots/tractor_error": "P, error [mm]",
    "plots/angle_error": "angle errors [°]",
}
TRAILER_ERROR = {"plots/trailer_error": "trailer's COM, error [mm]"}


def plots(path: Path) -> dict[str, str]:
    return {origin: title for origin, title in views(path) if "plots/" in origin}


def test_a_run_shows_the_plots_that_have_curves(tmp_path: Path) -> None:
    rows, reference = contact_run(), circle_reference()
    whole = record(tmp_path / "whole.rrd", reference, rows)
    assert plots(whole) == MOTION | ERRORS | TRAILER_ERROR
    assert [view for view in views(whole) if "plots/" not in view[0]] == [
        ("/", "wheels, law"),
        ("details", "Numbers"),
        ("key", "key"),
        ("report", "circle"),
        ("world", "From above"),
        ("world", "Robot"),
    ]
    aimless = replace(reference, theta=reference.theta * [1.0, np.nan])
    assert plots(record(tmp_path / "theta1.rrd", aimless, rows)) == MOTION | ERRORS
    assert plots(record(tmp_path / "none.rrd", None, rows)) == MOTION


def test_a_camera_brings_a_picture_and_the_plots_of_what_it_knows(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    with RunRecorder(
        path,
        model=robot_model(),
        robot=ROBOT,
        reference=None,
        name="seen",
        summary_markdown="",
        camera=True,
    ) as recorder:
        recorder.finish("nothing was driven")
    assert ("camera/picture", "Camera") in views(path)
    assert ("/", "wheels, law, tracker") in views(path)
    assert ("world", "From above") not in views(path)
    assert plots(path) == MOTION | {
        "plots/estimate_error": "estimation error of P [mm]",
        "plots/estimate_angle_error": "estimation errors of the angles [mrad]",
        "plots/measurement_age": "age of the newest measurement [ms]",
    }


def test_signals_are_logged_and_shown_without_knowing_the_law(tmp_path: Path) -> None:
    run = contact_run()
    v = np.exp(-run.time_s)[:, None]
    tuned = np.where(run.time_s[:, None] < 1.0, np.nan, 2.0)  # undefined for the first second
    logged = replace(run, signals={"lyapunov_v": v, "gain [1/s]": tuned})
    path = record(tmp_path / "run.rrd", None, logged, cuts=(1, 40))
    read = Recording(path)
    entity = "/plots/signals/lyapunov_v"
    np.testing.assert_array_equal(read.values(entity, "Scalars:scalars"), v)
    assert read.entities[entity]["SeriesLines:names"] == [(None, ["lyapunov_v"])]
    gain = r"/plots/signals/gain\ \[1\/s\]"
    np.testing.assert_array_equal(read.values(gain, "Scalars:scalars"), 2.0)
    first = int(np.flatnonzero(run.time_s >= 1.0)[0])
    assert read.times_ns(gain, "Scalars:scalars")[0] == round(1e9 * PERIOD_S * first)
    assert plots(path) == MOTION | {entity[1:]: "lyapunov_v", gain[1:]: "gain [1/s]"}


def test_a_law_that_logs_nothing_gets_no_tab(tmp_path: Path) -> None:
    path = record(tmp_path / "run.rrd", None, contact_run())
    assert plots(path) == MOTION
    assert not [name for name in Recording(path).entities if "signals" in name]


def test_rows_of_several_simulations_are_refused(tmp_path: Path) -> None:
    rows = Trajectory.empty(PERIOD_S * np.arange(3), nsim=2)
    with (
        recorder(tmp_path / "run.rrd", None) as recording,
        pytest.raises(InputError, match=r"simulation: got None; the trajectory has 2 simulations"),
    ):
        recording.append(rows)


def test_a_comparison_shows_both_robots_and_their_deviations(tmp_path: Path) -> None:
    from ttwmr_mj.scenario.file import load_scenario
    from ttwmr_mj.studies.compare.recording import record_comparison
    from ttwmr_mj.studies.compare.study import run_pair

    pair = run_pair(load_scenario("open_loop_turn", ["duration_s=0.5"]))
    path = tmp_path / "run.rrd"
    record_comparison(pair, path, "# compared")
    assert views(path) == [
        ("details", "Numbers"),
        ("key", "key"),
        ("plots/angles", "angles, contact − analytic [mrad]"),
        ("plots/energy", "energy lost to floor, balls and gears [mJ]"),
        ("plots/position", "P, contact − analytic [mm]"),
        ("plots/slip_along", "slip of the wheels along [mm/s]"),
        ("plots/slip_aside", "slip of the wheels to the side [mm/s]"),
        ("plots/torque", "torque missing in the trailer's equation (Eq. 17) [µN·m]"),
        ("report", "open_loop_turn"),
        ("world", "Both robots; the analytic one is translucent"),
    ]
    read = Recording(path)

    def values(plot: str) -> np.ndarray:
        return read.values(f"/plots/{plot}/true", "Scalars:scalars")

    off, rest = pair.deviation, pair.residuals
    np.testing.assert_array_equal(values("position")[:, 0], 1e3 * off.position_m)
    np.testing.assert_array_equal(values("position")[:, 2], 1e3 * off.position_curves["aside"])
    np.testing.assert_array_equal(values("angles")[:, 1], 1e3 * off.q[:, 3])
    np.testing.assert_array_equal(values("slip_along")[:, 1], 1e3 * rest.slip_along_m_s[:, 1])
    np.testing.assert_array_equal(values("slip_aside")[:, 0], 1e3 * rest.slip_aside_m_s[:, 0])
    np.testing.assert_array_equal(values("energy")[:, 0], 1e3 * rest.energy_lost_j)
    np.testing.assert_array_equal(values("torque")[:, 0], 1e6 * rest.trailer_torque_n_m)
    for root, rows in (("", pair.contact.trajectory), ("/analytic", pair.analytic)):
        p = read.values(f"/world{root}/tractor", "Transform3D:translation")[:, 0]
        np.testing.assert_allclose(p[:, :2], rows.q[:, 0, :2], atol=FLOAT32_M)
    # the largest deviation is an arrow of 150 mm from the analytic P
    arrows = read.values("/world/deviation", "Arrows3D:vectors")[:, 0]
    assert np.linalg.norm(arrows, axis=1).max() == pytest.approx(0.15)
    tails = read.values("/world/deviation", "Arrows3D:origins")[:, 0]
    np.testing.assert_allclose(tails[:, :2], pair.analytic.q[:, 0, :2], atol=FLOAT32_M)


def test_a_tracked_video_shows_picture_poses_and_uncertainty(tmp_path: Path) -> None:
    from ttwmr_mj.studies.track.recording import TrackRecorder

    path = tmp_path / "track.rrd"
    camera = SimpleNamespace(project=lambda points: points[..., :2])
    labels = read_layout(robot_model())
    q = np.array([0.1, -0.2, 0.3, -0.4])
    estimates = [
        SimpleNamespace(q=np.full(4, np.nan), status="lost", covariance=np.eye(8)),
        SimpleNamespace(q=q, status="tracking", covariance=np.diag([9e-6, 16e-6] + [1.0] * 6)),
    ]
    records = [
        SimpleNamespace(time_s=0.5 * k, frame=None, truth=None, sighting=None, estimate=estimate)
        for k, estimate in enumerate(estimates)
    ]
    with TrackRecorder(path, "v.avi", camera, labels) as recording:
        recording.append(records)
    assert views(path) == [
        ("/", "tracker"),
        ("camera/picture", "v.avi"),
        ("key", "key"),
        ("plots/angles", "angles [rad]"),
        ("plots/position", "position of P [mm]"),
        ("plots/uncertainty", "uncertainty of P [mm]"),
    ]
    read = Recording(path)
    assert read.times_ns("/plots/position", "Scalars:scalars") == [500_000_000]
    np.testing.assert_array_equal(read.values("/plots/position", "Scalars:scalars")[0], 1e3 * q[:2])
    np.testing.assert_array_equal(read.values("/plots/angles", "Scalars:scalars")[0], q[2:])
    # 3 σ of 3 mm along x and 4 mm along y
    spread = read.values("/plots/uncertainty", "Scalars:scalars")[0]
    assert spread == pytest.approx([15.0])
    assert read.entities["/tracker"]["StateChange:state"] == [
        (0, ["lost"]),
        (500_000_000, ["tracking"]),
    ]
    # 3 σ, drawn 50 times its size, about P
    ring = read.values("/camera/picture/covariance", "LineStrips2D:strips")[-1, 0]
    np.testing.assert_allclose(ring.max(axis=0) - q[:2], [0.45, 0.6], rtol=1e-5)
