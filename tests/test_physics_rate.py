"""physics.parquet, the analytic plants' clock, and the scene an analytic run is drawn in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from comparisons import open_loop

from ttwmr_mj.assets import models_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.records import _drawable_model
from ttwmr_mj.studies.compare.pair import refuse_unlike

TURNS = ((0.3, 5.0, -5.0), (0.9, -6.0, 6.0))  # past θ1 = −π, where a quaternion wraps
COLUMNS = [
    "time_s",
    "x_m",
    "y_m",
    "theta1_rad",
    "theta2_rad",
    "x_rate_m_s",
    "y_rate_m_s",
    "theta1_rate_rad_s",
    "theta2_rate_rad_s",
    "wheel_right_rad_s",
    "wheel_left_rad_s",
]


def test_physics_parquet_is_the_run_at_every_physics_step(tmp_path: Path) -> None:
    output = {"recording": False, "figures": False, "physics_rate": True}
    start = {"theta1_rad": -2.0, "theta2_rad": -2.3}
    scenario = open_loop(*TURNS, initial=start, output=output)
    run_scenario(scenario, tmp_path)
    table = pq.read_table(tmp_path / "physics.parquet")
    assert table.column_names == COLUMNS
    rows, every = Trajectory.read(tmp_path / "trajectory.parquet"), scenario.steps_per_period
    step = scenario.plant.contact.timestep_s
    count = every * scenario.periods
    np.testing.assert_allclose(table["time_s"], step * np.arange(1, count + 1), rtol=1e-14)
    values = np.stack([table[name].to_numpy() for name in COLUMNS[1:]], axis=-1)
    sampled = np.concatenate([rows.q, rows.q_rate, rows.wheel_speed_rad_s], axis=-1)[1:, 0]
    # θ1 is unwrapped by two formulas, which round differently
    np.testing.assert_allclose(values[every - 1 :: every], sampled, rtol=0, atol=1e-14)
    # MuJoCo moves over a step at the speed of its end; it turns by a tilt of 1e-7 rad as well
    moved = np.diff(values[:, :4], axis=0) / step
    np.testing.assert_allclose(moved, values[1:, 4:8], rtol=0, atol=1e-5)
    assert np.ptp(values[:, 2]) > 1.5


def test_an_analytic_run_does_not_read_the_step_of_contact_physics(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["run", "open_loop_turn", "--quiet", "--set", "duration_s=0.3", "--force"]
    common += ["--set", "output.recording=false", "--set", "output.figures=false"]
    odd, analytic = ["--set", "plant.contact.timestep_s=0.0007"], ["--set", "plant.kind=analytic"]
    runs = []
    for i, more in enumerate((analytic, [*analytic, *odd])):
        assert main([*common, *more, "--out", str(tmp_path / str(i))]) == 0
        runs.append(Trajectory.read(tmp_path / str(i) / "trajectory.parquet").q)
    np.testing.assert_array_equal(*runs)
    assert main([*common, *odd, "--out", str(tmp_path / "contact")]) == 2
    assert "control.sampling_time_s" in capsys.readouterr().err
    plant = {"kind": "analytic", "contact": {"timestep_s": 0.0007}}
    with pytest.raises(InputError, match=r"control\.sampling_time_s"):
        refuse_unlike(open_loop((0.3, 1.0, 1.0), plant=plant))


@pytest.mark.parametrize("kind", ["contact", "analytic"])
def test_a_run_is_drawn_in_its_own_scene(tmp_path: Path, kind: str) -> None:
    robot = models_folder() / "ttwmr.xml"
    scene = tmp_path / "own.xml"
    scene.write_text(
        f'<mujoco><include file="{robot}"/><worldbody><geom name="floor" type="plane" '
        'size="5 5 1"/><geom name="post" type="cylinder" size="0.1 0.5" pos="2 0 0.5"/>'
        "</worldbody></mujoco>"
    )
    plant = {"kind": kind, "contact": {"model_path": str(scene)}}
    model = _drawable_model(Experiment(open_loop((0.1, 1.0, 1.0), plant=plant)))
    assert model.geom("post").size[0] == 0.1
