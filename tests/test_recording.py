"""Real recordings, written and read back with rerun's own reader."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pytest

from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact import CONTACTS, ContactPlant, read_contacts
from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.plants.mjcf import build_model
from ttwmr_mj.recording import RunRecorder
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.curves import Curves, trailer_com
from ttwmr_mj.results.lyapunov_log import lyapunov_log
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, RobotState

ROBOT = RobotParameters()
PERIOD_S = 0.033
BODIES = ("tractor", "wheel_right", "wheel_left", "caster_tractor", "trailer")
FLOAT32_M = 1e-6  # rerun stores positions in single precision


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return build_model(ROBOT, ContactOptions())


@pytest.fixture(scope="module")
def reference() -> ReferencePath:
    circle = Circle(radius_m=0.43, angular_rate_rad_s=0.125, phase_rad=0.35, theta2="outward")
    return circle.sample(PERIOD_S * np.arange(61))


@pytest.fixture(scope="module")
def run(reference: ReferencePath) -> Trajectory:
    """Two seconds of the contact plant, started from rest with constant wheel commands."""
    plant = ContactPlant(ROBOT, ContactOptions())
    q = reference.q[0, 0]
    plant.reset(RobotState.at_rest(*q))
    rows = Trajectory.empty(reference.time_s, 1, plant.model.nq, len(CONTACTS))
    rows.ref_q[:], rows.ref_q_rate[:] = reference.q, reference.q_rate
    rows.wheel_command_rad_s[:] = 2.35, 1.78
    rows.saturated[10:15] = True
    for k in range(len(rows)):
        state = plant.state()
        rows.q[k], rows.q_rate[k] = state.q, state.q_rate
        rows.wheel_speed_rad_s[k] = plant.wheel_speed_rad_s()
        rows.joint_positions[k] = plant.joint_positions()
        rows.contact_readings[k] = plant.contact_readings()
        plant.advance(rows.wheel_command_rad_s[k], round(PERIOD_S / plant.time_step_s))
    rows.est_q[:], rows.est_q_rate[:] = rows.q, rows.q_rate
    return rows


def analytic(run: Trajectory) -> Trajectory:
    """The same rows as the analytic plant would give them."""
    n = len(run)
    return replace(
        run, joint_positions=np.zeros((n, 1, 0)), contact_readings=np.zeros((n, 1, 0, 15))
    )


def recorder(path: Path, model: mujoco.MjModel, reference: ReferencePath | None) -> RunRecorder:
    return RunRecorder(
        path,
        model=model,
        robot=ROBOT,
        reference=reference,
        name="circle",
        summary_markdown="# circle\nseed 7",
    )


def record(
    path: Path,
    model: mujoco.MjModel,
    reference: ReferencePath | None,
    rows: Trajectory,
    cuts: Sequence[int] = (),
) -> Path:
    """Record rows, in pieces that start at the cuts."""
    ends = [0, *cuts, len(rows)]
    with recorder(path, model, reference) as recording:
        for start, stop in pairwise(ends):
            recording.append(rows.rows(start, stop))
        recording.finish("**ok**")
    return path


class Recording:
    """What a file holds: entity → component → (time [ns] or None if static, value) rows."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        self.entities: dict[str, dict[str, list[tuple[int | None, list]]]] = {}
        self.timelines: set[str] = set()
        for chunk in RrdReader(str(path)).stream().to_chunks():
            batch = chunk.to_record_batch()
            times: list[int | None] = [None] * batch.num_rows
            if "sim_time" in batch.schema.names:
                times = batch.column("sim_time").cast("int64").to_pylist()
            self.timelines |= {f.name for f in batch.schema if pa.types.is_temporal(f.type)}
            entity = self.entities.setdefault(chunk.entity_path, {})
            for field, column in zip(batch.schema, batch.columns, strict=True):
                if ":" in field.name:
                    rows = zip(times, column.to_pylist(), strict=True)
                    entity.setdefault(field.name, []).extend(rows)

    def times_ns(self, entity: str, component: str) -> list[int | None]:
        return [time for time, _ in self.entities[entity][component]]

    def values(self, entity: str, component: str) -> FloatArray:
        """(n, instances, ...) of a component with as many instances in every row."""
        return np.array([value for _, value in self.entities[entity][component]], dtype=float)

    def temporal(self) -> dict[tuple[str, str], list[tuple[int | None, list]]]:
        return {
            (entity, name): sorted(row for row in rows if row[0] is not None)
            for entity, components in self.entities.items()
            for name, rows in components.items()
            if any(time is not None for time, _ in rows)
        }


@pytest.fixture(scope="module")
def recording(
    tmp_path_factory: pytest.TempPathFactory,
    model: mujoco.MjModel,
    reference: ReferencePath,
    run: Trajectory,
) -> Recording:
    return Recording(record(tmp_path_factory.mktemp("rrd") / "run.rrd", model, reference, run))


def test_every_row_is_there_in_exact_nanoseconds(recording: Recording, run: Trajectory) -> None:
    expected = [33_000_000 * k for k in range(len(run))]
    for name in ("x", "y", "theta1", "theta2", "wheel_speed", "hitch_angle", "tractor_error"):
        assert recording.times_ns(f"/plots/{name}/true", "Scalars:scalars") == expected
    for body in BODIES:
        assert recording.times_ns(f"/world/{body}", "Transform3D:translation") == expected
    for path in ("/world/driven/tractor", "/world/driven/trailer"):
        assert recording.times_ns(path, "LineStrips3D:strips") == expected
    assert recording.timelines == {"sim_time"}


def test_times_are_rounded_not_truncated() -> None:
    from ttwmr_mj.recording.timeline import time_column

    time_s = np.array([0.57, 1.001])
    assert (1e9 * time_s).astype(int).tolist() != [570_000_000, 1_001_000_000]
    column = time_column(time_s).as_arrow_array()
    assert column.cast("int64").to_pylist() == [570_000_000, 1_001_000_000]


def test_plots_hold_the_rows(recording: Recording, run: Trajectory) -> None:
    curves = Curves.of(run, ROBOT)

    def scalars(entity: str) -> FloatArray:
        return recording.values(f"/plots/{entity}", "Scalars:scalars")

    for i, name in enumerate(("x", "y", "theta1", "theta2")):
        np.testing.assert_array_equal(scalars(f"{name}/true"), run.q[:, 0, [i]])
        np.testing.assert_array_equal(scalars(f"{name}/reference"), run.ref_q[:, 0, [i]])
    np.testing.assert_array_equal(scalars("wheel_speed/true"), run.wheel_speed_rad_s[:, 0])
    np.testing.assert_array_equal(scalars("wheel_speed/command"), run.wheel_command_rad_s[:, 0])
    np.testing.assert_array_equal(scalars("tractor_error/true"), 1e3 * curves.tractor_error_m)
    np.testing.assert_array_equal(scalars("trailer_error/true"), 1e3 * curves.trailer_error_m)


def test_series_are_named_and_coloured(recording: Recording) -> None:
    for entity, components in recording.entities.items():
        if entity.startswith("/plots/"):
            assert components["SeriesLines:names"], entity
            assert components["SeriesLines:colors"], entity


def test_an_estimate_equal_to_the_truth_is_not_drawn(recording: Recording) -> None:
    assert not [entity for entity in recording.entities if entity.endswith("/seen")]


def test_flags_hold_their_changes(recording: Recording) -> None:
    assert recording.entities["/flags/saturated"]["StateChange:state"] == [
        (0, ["no"]),
        (330_000_000, ["yes"]),
        (495_000_000, ["no"]),
    ]


def test_bodies_are_where_mujoco_puts_them(
    recording: Recording, run: Trajectory, model: mujoco.MjModel
) -> None:
    data = mujoco.MjData(model)
    for k in (0, 17, len(run) - 1):
        data.qpos[:] = run.joint_positions[k, 0]
        mujoco.mj_kinematics(model, data)
        for body in BODIES:
            translation = recording.values(f"/world/{body}", "Transform3D:translation")[k, 0]
            quaternion = recording.values(f"/world/{body}", "Transform3D:quaternion")[k, 0]
            np.testing.assert_allclose(translation, data.body(body).xpos, atol=FLOAT32_M)
            np.testing.assert_allclose(quaternion, data.body(body).xquat[[1, 2, 3, 0]], atol=1e-6)


def test_every_visual_geom_is_drawn_once(recording: Recording, model: mujoco.MjModel) -> None:
    for i in np.flatnonzero(model.geom_group == 2):
        geom = model.geom(int(i))
        body = model.body(geom.bodyid[0]).name
        components = recording.entities[f"/world/{body}/{geom.name}"]
        (shape,) = {name.split(":")[0] for name in components}
        (colour,) = components[f"{shape}:colors"]
        rgba = [(colour[1][0] >> shift) & 255 for shift in (24, 16, 8, 0)]
        np.testing.assert_allclose(rgba, 255 * model.mat_rgba[geom.matid[0]], atol=1)


def test_contact_forces_carry_the_robot(recording: Recording, run: Trajectory) -> None:
    vectors = recording.values("/world/contact_forces", "Arrows3D:vectors")
    origins = recording.values("/world/contact_forces", "Arrows3D:origins")
    contacts = read_contacts(run.contact_readings[:, 0])
    np.testing.assert_allclose(origins, contacts.position_m, atol=FLOAT32_M)
    np.testing.assert_allclose(vectors, 0.03 * contacts.force_n, atol=1e-6)
    weight = 9.81 * (ROBOT.tractor.mass_kg + ROBOT.trailer.mass_kg)
    np.testing.assert_allclose(vectors[-1, :, 2].sum() / 0.03, weight, rtol=0.02)


def test_driven_paths_are_connected(recording: Recording, run: Trajectory) -> None:
    for path, points in (
        ("/world/driven/tractor", run.q[:, 0, :2]),
        ("/world/driven/trailer", trailer_com(run.q, ROBOT)[:, 0]),
    ):
        rows = [
            row for row in recording.entities[path]["LineStrips3D:strips"] if row[0] is not None
        ]
        strips = np.array([strip for _, strip in rows])[:, 0]
        np.testing.assert_allclose(strips[:, 1, :2], points, atol=FLOAT32_M)
        np.testing.assert_array_equal(strips[1:, 0], strips[:-1, 1])


def test_report_ends_with_the_result(recording: Recording) -> None:
    (*_, (_, last)) = recording.entities["/report"]["TextDocument:text"]
    assert last == ["**ok**\n\n# circle\nseed 7"]


@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_chunks_equal_one_piece(
    plant: str, tmp_path: Path, model: mujoco.MjModel, reference: ReferencePath, run: Trajectory
) -> None:
    rows = analytic(run) if plant == "analytic" else run
    rows = replace(rows, ref_q=rows.ref_q.copy(), est_q=rows.est_q + 0.01)
    rows.ref_q[20:31, :, 3] = np.nan  # θ2 undefined for a while, across a cut
    whole = Recording(record(tmp_path / "whole.rrd", model, reference, rows))
    parts = Recording(record(tmp_path / "parts.rrd", model, reference, rows, cuts=(1, 20, 25, 60)))
    assert whole.temporal() == parts.temporal()
    gap = dict(whole.entities["/plots/theta2/reference"]["Scalars:scalars"])
    assert gap[20 * 33_000_000] == []  # ends the line
    assert 21 * 33_000_000 not in gap


def test_analytic_rows_stand_on_their_wheels(
    tmp_path: Path, model: mujoco.MjModel, reference: ReferencePath, run: Trajectory
) -> None:
    rows = analytic(run)
    recording = Recording(record(tmp_path / "run.rrd", model, reference, rows))
    assert "Arrows3D:vectors" not in recording.entities["/world/contact_forces"]
    p = recording.values("/world/tractor", "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(p[:, :2], rows.q[:, 0, :2], atol=FLOAT32_M)
    np.testing.assert_allclose(p[:, 2], ROBOT.tractor.wheel_radius_m, atol=FLOAT32_M)
    x, y, z, w = recording.values("/world/trailer", "Transform3D:quaternion")[:, 0].T
    np.testing.assert_allclose([x, y], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.cos(2 * np.arctan2(z, w) - rows.q[:, 0, 3]), 1.0, atol=1e-6)
    # the wheel has turned by the integral of its speed: its spoke points there
    turned = recording.values("/world/wheel_right", "Transform3D:quaternion")[-1, 0]
    yaw = np.array([np.cos(rows.q[-1, 0, 2] / 2), 0, 0, np.sin(rows.q[-1, 0, 2] / 2)])
    angle = np.trapezoid(rows.wheel_speed_rad_s[:, 0, 0], rows.time_s)
    expected = np.empty(4)
    mujoco.mju_mulQuat(expected, yaw, np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0]))
    assert abs(turned @ expected[[1, 2, 3, 0]]) == pytest.approx(1.0, abs=1e-6)


def test_an_undefined_reference_gives_no_series(
    tmp_path: Path, model: mujoco.MjModel, run: Trajectory
) -> None:
    rows = replace(run, ref_q=np.full_like(run.ref_q, np.nan))
    recording = Recording(record(tmp_path / "run.rrd", model, None, rows))
    for entity in recording.entities:
        assert not entity.startswith("/world/reference"), entity
        assert not entity.endswith("/reference"), entity
        assert "_error" not in entity
    for (entity, name), values in recording.temporal().items():
        if name == "Scalars:scalars":
            assert np.isfinite([value for _, value in values]).all(), entity


def test_rows_of_a_broken_run_are_left_out(
    tmp_path: Path, model: mujoco.MjModel, reference: ReferencePath, run: Trajectory
) -> None:
    rows = replace(run, q=run.q.copy())
    rows.q[40:] = np.nan
    read = Recording(record(tmp_path / "run.rrd", model, reference, rows, cuts=(30, 50)))
    for entity, component in (
        ("/world/tractor", "Transform3D:translation"),
        ("/plots/wheel_speed/true", "Scalars:scalars"),
    ):
        assert len(read.times_ns(entity, component)) == 40


def test_an_exception_leaves_a_complete_file(
    tmp_path: Path, model: mujoco.MjModel, reference: ReferencePath, run: Trajectory
) -> None:
    path = tmp_path / "run.rrd"
    recording = recorder(path, model, reference)

    def fail() -> None:
        with recording:
            recording.append(run.rows(0, 20))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    with warnings.catch_warnings(action="error"):  # a missing footer warns
        read = Recording(path)
    assert len(read.times_ns("/plots/x/true", "Scalars:scalars")) == 20


def test_nothing_can_be_added_after_closing(
    tmp_path: Path, model: mujoco.MjModel, reference: ReferencePath, run: Trajectory
) -> None:
    recording = recorder(tmp_path / "run.rrd", model, reference)
    recording.close()
    recording.close()
    with pytest.raises(ValueError, match="closed"):
        recording.append(run)
    with pytest.raises(ValueError, match="closed"):
        recording.finish("late")


def test_a_missing_folder_is_named(
    tmp_path: Path, model: mujoco.MjModel, reference: ReferencePath
) -> None:
    with pytest.raises(InputError, match=r"nowhere/run\.rrd"):
        recorder(tmp_path / "nowhere" / "run.rrd", model, reference)


KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.plants.mjcf import build_model
from ttwmr_mj.recording import RunRecorder
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.results.trajectory import Trajectory

robot = RobotParameters()
rows = Trajectory.empty(0.033 * np.arange(90), 1)
for values in (rows.q, rows.wheel_speed_rad_s, rows.wheel_command_rad_s):
    values[:] = np.linspace(0.0, 1.0, 90)[:, None, None]
recording = RunRecorder(
    Path(sys.argv[1]),
    model=build_model(robot, ContactOptions()),
    robot=robot,
    reference=None,
    name="killed",
    summary_markdown="",
)
for start in (0, 30, 60):
    recording.append(rows.rows(start, start + 30))
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_kill_9_loses_no_appended_row(tmp_path: Path) -> None:
    path = tmp_path / "killed.rrd"
    died = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert died.returncode == -signal.SIGKILL
    read = Recording(path)
    expected = [33_000_000 * k for k in range(90)]
    assert read.times_ns("/plots/hitch_angle/true", "Scalars:scalars") == expected
    assert read.times_ns("/world/trailer", "Transform3D:translation") == expected


def test_importing_the_package_does_not_import_rerun() -> None:
    code = "import sys, ttwmr_mj.recording; sys.exit('rerun' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))


def test_v_is_plotted_as_logged_however_the_rows_come(
    model: mujoco.MjModel, reference: ReferencePath, run: Trajectory, tmp_path: Path
) -> None:
    law = LyapunovOptions(kind="lyapunov")
    path = tmp_path / "run.rrd"
    with RunRecorder(
        path,
        model=model,
        robot=ROBOT,
        reference=reference,
        name="v",
        summary_markdown="",
        lyapunov=law,
    ) as recorder:
        recorder.append(run.rows(0, 20))
        recorder.append(run.rows(20, len(run)))
    read, log = Recording(path), lyapunov_log(run, law)

    def values(name: str) -> FloatArray:
        return read.values(f"/plots/{name}", "Scalars:scalars")[:, 0]

    assert values("lyapunov/true") == pytest.approx(np.log10(log.v / log.v[0]), abs=1e-12)
    # from sample to sample, so the first has none
    measured = log.v_rate[:-1] / log.v[:-1]
    assert values("lyapunov_rate/true") == pytest.approx(measured, rel=1e-9)
    assert values("lyapunov_rate/claimed") == pytest.approx(log.v_rate_claimed / log.v, rel=1e-12)
