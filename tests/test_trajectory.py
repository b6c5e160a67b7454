"""Trajectories go to Parquet and come back with the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from trajectories import different

from ttwmr_mj.errors import InputError
from ttwmr_mj.results.parquet import write_parquet
from ttwmr_mj.results.trajectory import Trajectory, physics_rate_table
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import RobotState

# the contract with everyone who reads run folders
COLUMNS = """time_s x_m y_m theta1_rad theta2_rad x_rate_m_s y_rate_m_s theta1_rate_rad_s
theta2_rate_rad_s ref_x_m ref_y_m ref_theta1_rad ref_theta2_rad ref_x_rate_m_s ref_y_rate_m_s
ref_theta1_rate_rad_s ref_theta2_rate_rad_s est_x_m est_y_m est_theta1_rad est_theta2_rad
est_x_rate_m_s est_y_rate_m_s est_theta1_rate_rad_s est_theta2_rate_rad_s wheel_right_cmd_rad_s
wheel_left_cmd_rad_s wheel_right_rad_s wheel_left_rad_s est_valid measurement_age_s labels_found
saturated
near_singular
tilt_rad
height_m
wheels_on_floor
wheel_slip_m_s
lyapunov_v
lyapunov_v_rate_1_s
lyapunov_v_rate_eq36_1_s""".split()


@pytest.fixture(scope="module")
def run() -> Trajectory:
    overrides = ["duration_s=1.0", "plant.kind=analytic", "reference.theta2=none"]
    return Experiment(load_scenario("lab_circle", overrides)).run().trajectory


def test_columns_are_the_documented_ones_in_float64(run: Trajectory) -> None:
    table = run.to_table()
    assert table.column_names == COLUMNS
    assert set(table.schema.types) == {pa.float64()}
    assert np.isnan(table["ref_theta2_rad"].to_numpy()).all()


# 31 rows: all at once, with a rest, and in pieces of equal size
@pytest.mark.parametrize(("piece", "groups"), [(100, 1), (10, 4), (1, 31)])
def test_parquet_round_trip_is_exact(
    piece: int, groups: int, run: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ttwmr_mj.results.trajectory.PIECE_ROWS", piece)
    path = tmp_path / "trajectory.parquet"
    run.write(path)
    again = Trajectory.read(path)
    assert different(again, run) == []
    assert pq.read_metadata(path).num_row_groups == groups
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("trailers", [2, 3])
def test_every_trailer_has_its_columns(trailers: int, tmp_path: Path) -> None:
    rows, width = Trajectory.empty(np.arange(4.0), 1, trailers=trailers), 3 + trailers
    assert rows.q.shape == (4, 1, width)
    for i, name in enumerate(("q", "q_rate", "ref_q", "ref_q_rate", "est_q", "est_q_rate")):
        getattr(rows, name)[:] = 100 * i + np.arange(4.0 * width).reshape(4, 1, width)
    table = rows.to_table()
    extra = [f"theta{i}" for i in range(3, width - 1)]
    expected = list(COLUMNS[:-3])
    for prefix in ("", "ref_", "est_"):
        for unit in ("_rad", "_rate_rad_s"):
            place = expected.index(f"{prefix}theta2{unit}") + 1
            expected[place:place] = [f"{prefix}{angle}{unit}" for angle in extra]
    assert table.column_names == expected
    assert table[f"theta{width - 2}_rad"].to_pylist() == rows.q[:, 0, -1].tolist()
    assert table["est_theta3_rate_rad_s"].to_pylist() == rows.est_q_rate[:, 0, 4].tolist()
    write_parquet(table, tmp_path / "rows.parquet")
    again = Trajectory.read(tmp_path / "rows.parquet")
    assert different(again, rows) == []
    lacking = table.drop_columns(["theta2_rad"])
    pq.write_table(lacking, tmp_path / "lacking.parquet")
    with pytest.raises(InputError, match="it lacks theta2_rad"):
        Trajectory.read(tmp_path / "lacking.parquet")


def test_a_signal_that_is_called_as_a_trailers_angle_widens_no_train(run: Trajectory) -> None:
    table = run.to_table()  # as of an older version, which let laws have such names
    table = table.append_column("theta3_rad", table["tilt_rad"])
    again = Trajectory.of_table(table, "old.parquet")
    assert again.q.shape == run.q.shape
    assert list(again.signals) == [*run.signals, "theta3_rad"]


def test_the_physics_rate_table_names_what_it_holds() -> None:
    q, rate, wheels = (shift + np.arange(20.0).reshape(1, 4, 5) for shift in (0.0, 100.0, 200.0))
    table = physics_rate_table(np.arange(4.0), RobotState(q[0], rate[0]), wheels[0, :, :2])
    names = "x_m y_m theta1_rad theta2_rad theta3_rad".split()
    rates = "x_rate_m_s y_rate_m_s theta1_rate_rad_s theta2_rate_rad_s theta3_rate_rad_s".split()
    expected = ["time_s", *names, *rates, "wheel_right_rad_s", "wheel_left_rad_s"]
    assert table.column_names == expected
    columns = np.column_stack([table[name].to_numpy() for name in expected])
    np.testing.assert_array_equal(
        columns, np.column_stack([np.arange(4.0), q[0], rate[0], wheels[0, :, :2]])
    )


def test_damaged_and_foreign_files_are_refused(run: Trajectory, tmp_path: Path) -> None:
    torn = tmp_path / "torn.parquet"
    write_parquet(run.to_table(), torn)
    torn.write_bytes(torn.read_bytes()[:-100])
    with pytest.raises(InputError, match="cannot be read as a trajectory"):
        Trajectory.read(torn)
    with pytest.raises(InputError, match="cannot be read"):
        Trajectory.read(tmp_path / "missing.parquet")
    table = run.to_table()
    doubled = table.append_column("x_m", table["x_m"])
    pq.write_table(doubled, torn)
    with pytest.raises(InputError, match="as a trajectory: it has the column x_m twice"):
        Trajectory.read(torn)
    foreign = tmp_path / "foreign.parquet"
    pq.write_table(run.to_table().drop_columns(["y_m"]), foreign)
    with pytest.raises(InputError, match="it lacks y_m"):
        Trajectory.read(foreign)
    pq.write_table(run.to_table().drop_columns(["theta2_rad"]), foreign)
    with pytest.raises(InputError, match="it lacks theta2_rad"):
        Trajectory.read(foreign)


def test_slices_are_views(run: Trajectory) -> None:
    part = run.rows(3, 7)
    assert len(part) == 4
    assert np.shares_memory(part.q, run.q)
    two = Trajectory.empty(np.arange(3.0), 2)
    two.q[:, 1], two.saturated[:, 1] = 7.0, True
    second = two.simulation(1)
    assert (second.nsim, len(second)) == (1, 3)
    assert np.shares_memory(second.q, two.q)
    assert (second.q == 7.0).all()
    assert second.saturated.all()
    assert not two.simulation(0).saturated.any()
