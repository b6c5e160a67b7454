"""Trajectories go to Parquet and come back with the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from trajectories import different

from ttwmr_mj.errors import InputError
from ttwmr_mj.files import write_parquet
from ttwmr_mj.results.trajectory import Trajectory, read_parquet
from ttwmr_mj.run.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario

# the contract with everyone who reads run folders
COLUMNS = """time_s x_m y_m theta1_rad theta2_rad x_rate_m_s y_rate_m_s theta1_rate_rad_s
theta2_rate_rad_s ref_x_m ref_y_m ref_theta1_rad ref_theta2_rad ref_x_rate_m_s ref_y_rate_m_s
ref_theta1_rate_rad_s ref_theta2_rate_rad_s est_x_m est_y_m est_theta1_rad est_theta2_rad
est_x_rate_m_s est_y_rate_m_s est_theta1_rate_rad_s est_theta2_rate_rad_s wheel_right_cmd_rad_s
wheel_left_cmd_rad_s wheel_right_rad_s wheel_left_rad_s est_valid measurement_age_s labels_found
saturated
near_singular
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


def test_parquet_round_trip_is_exact(run: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "trajectory.parquet"
    write_parquet(run.to_table(), path)
    again = read_parquet(path)
    assert different(again, run) == []
    assert list(tmp_path.iterdir()) == [path]


def test_damaged_and_foreign_files_are_refused(run: Trajectory, tmp_path: Path) -> None:
    torn = tmp_path / "torn.parquet"
    write_parquet(run.to_table(), torn)
    torn.write_bytes(torn.read_bytes()[:-100])
    with pytest.raises(InputError, match="cannot be read as a trajectory"):
        read_parquet(torn)
    with pytest.raises(InputError, match="cannot be read"):
        read_parquet(tmp_path / "missing.parquet")
    foreign = tmp_path / "foreign.parquet"
    pq.write_table(run.to_table().drop_columns(["y_m"]), foreign)
    with pytest.raises(InputError, match="it lacks y_m"):
        read_parquet(foreign)


def test_slices_are_views(run: Trajectory) -> None:
    part = run.rows(3, 7)
    assert len(part) == 4
    assert np.shares_memory(part.q, run.q)
    assert run.simulation(0).q.shape == run.q.shape
