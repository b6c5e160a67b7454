"""The sampled loop and what leaves it: signals, pushes, reports, ends, files, the public API."""

from __future__ import annotations

import json
import pickle
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from drawn import labels
from logging_laws import BAD
from recordings import Recording
from trajectories import different

import ttwmr_mj as tt
from ttwmr_mj.errors import Fault
from ttwmr_mj.runs.build import generators
from ttwmr_mj.runs.closed_loop.loop import Outcome
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.process.background import Background
from ttwmr_mj.runs.pushes import Push, forces
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import PushOptions

HERE = Path(__file__).parent
PERIOD_S = 0.033
SCENARIO = """
name = "mine"
duration_s = 0.3
plant.kind = "analytic"
reference.kind = "none"
[controller]
kind = "custom"
target = "logging_laws:Logger"
"""


def scenario(case: str = "well", **changes: Any) -> tt.Scenario:
    data = tomllib.loads(SCENARIO) | changes
    data["controller"]["options"] = {"case": case}
    return tt.check_scenario(data, "mine.toml")


def test_signals_are_rows_of_every_simulation() -> None:
    result = tt.simulate(scenario(), nsim=3, scenario_folder=HERE)
    signals = result.trajectory.signals
    assert list(signals) == ["sample", "seen_x_m"]
    np.testing.assert_array_equal(signals["sample"], 10.0 * np.arange(10)[:, None] + np.arange(3))
    np.testing.assert_array_equal(signals["seen_x_m"], result.trajectory.q[:, :, 0])
    columns = result.trajectory.to_columns(2)
    assert columns["sample"].tolist() == [10.0 * k + 2 for k in range(10)]
    assert list(columns)[-2:] == ["sample", "seen_x_m"]


def test_signals_reach_every_file_of_a_run(tmp_path: Path) -> None:
    plotted = scenario(output={"paper_plots": True})
    run = tt.run(plotted, tmp_path / "out", scenario_folder=HERE)
    assert run.outcome.status == "ok"
    expected = 10.0 * np.arange(10)
    table = pq.read_table(run.folder / "trajectory.parquet")
    assert table.column_names[-2:] == ["sample", "seen_x_m"]
    assert table["sample"].to_numpy().tolist() == expected.tolist()
    again = tt.Trajectory.read(run.folder / "trajectory.parquet")
    assert different(again, tt.simulate(scenario(), scenario_folder=HERE).trajectory) == []
    recording = Recording(run.folder / "run.rrd")
    values = recording.values("/plots/signals/sample", "Scalars:scalars")
    assert values[:, 0].tolist() == expected.tolist()
    assert {"sample", "seen_x_m"} <= set(labels(run.folder / "figures" / "signals.svg"))


NAMES = "a signal is called {!r}; allowed: lower-case letters, digits and _"
REASONS = {
    "taken": NAMES.format("est_x_m"),
    "capital": NAMES.format("Gain"),
    "bracket": NAMES.format("gain [1/s]"),
    "long": "signal gain_1_s has shape (2,), allowed: (1,)",
    "deep": "signal gain_1_s has shape (1, 1), allowed: (1,)",
    "more": "the signals are ['sample', 'seen_x_m', 'third']; at the first sample they were",
    "fewer": "the signals are ['sample']; at the first sample they were ['sample', 'seen_x_m']",
    "renamed": "the signals are ['sample', 'x_seen_m']; at the first sample they were",
}


@pytest.mark.parametrize("case", list(REASONS))
def test_bad_signals_end_the_run_with_the_reason(case: str) -> None:
    result = tt.simulate(scenario(case), scenario_folder=HERE)
    (outcome,) = result.outcomes
    sample = 0 if case in BAD else 4
    assert (outcome.status, outcome.time_s) == ("failed", pytest.approx(sample * PERIOD_S))
    assert outcome.reason.startswith(f"controller.command() raised ValueError: {REASONS[case]}")
    assert len(result.trajectory) == sample + 1
    assert np.isfinite(result.trajectory.wheel_command_rad_s).all(axis=(1, 2)).sum() == sample


def test_every_column_name_is_taken() -> None:
    from ttwmr_mj.results.trajectory import column_names

    rows = tt.Trajectory.empty(np.arange(2.0), 1)
    assert column_names(4) == tuple(rows.to_columns())


def test_one_simulation_of_several_is_named() -> None:
    rows = tt.simulate(scenario(), nsim=3, scenario_folder=HERE).trajectory
    for read in (rows.to_columns, rows.to_table, rows.simulation):
        with pytest.raises(tt.InputError, match="got None; the trajectory has 3 simulations; "):
            read()
        for index in (-1, 3):
            with pytest.raises(tt.InputError, match=rf"simulation: got {index}; .*allowed: 0 to 2"):
                read(index)
    rows.q[:, 2] += 1.0
    assert rows.to_table(2)["x_m"].to_pylist() == (rows.q[:, 2, 0]).tolist()
    assert rows.to_table(0)["x_m"].to_pylist() != rows.to_table(2)["x_m"].to_pylist()
    np.testing.assert_array_equal(rows.simulation(2).q, rows.q[:, 2:])


def test_to_pandas_says_what_it_needs_or_holds_the_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = tt.simulate(scenario(), nsim=2, scenario_folder=HERE).trajectory
    frames: list[Any] = []
    pandas = SimpleNamespace(DataFrame=lambda columns: frames.append(columns) or "a frame")
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    assert rows.to_pandas(1) == "a frame"
    (columns,) = frames
    assert columns["sample"].tolist() == [10.0 * k + 1 for k in range(10)]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(tt.MachineError, match="to_pandas needs pandas: pip install pandas"):
        rows.to_pandas(1)


def test_simulations_differ_by_their_noise_and_are_scored_each() -> None:
    noisy = scenario(
        reference={"kind": "straight_line", "speed_m_s": 0.1},
        sensing={"kind": "truth", "position_noise_m": 0.01},
    )
    result = tt.simulate(noisy, nsim=3, scenario_folder=HERE)
    assert [outcome.status for outcome in result.outcomes] == ["ok"] * 3
    scores = tt.score(result.trajectory, noisy.robot)
    noise = [metrics["estimator_position_rmse_m"] for metrics in scores]
    assert len(set(noise)) == 3
    alone = [tt.score(result.trajectory.simulation(i), noisy.robot) for i in range(3)]
    assert [one for (one,) in alone] == list(scores)


def test_a_comparison_drives_both_plants_by_the_same_commands() -> None:
    circle = tt.load_scenario("lab_circle", ["duration_s=0.5"])
    pair = tt.compare(circle)
    contact = pair.contact.trajectory
    np.testing.assert_array_equal(pair.analytic.q[0], contact.q[0])
    np.testing.assert_array_equal(
        pair.analytic.wheel_command_rad_s[:-1], contact.wheel_command_rad_s[:-1]
    )
    assert 0.0 < np.abs(pair.deviation.q).max() < 1e-3
    closed = tt.compare(circle, "closed_loop")
    assert not np.array_equal(closed.analytic.q, pair.analytic.q)
    assert different(closed.contact.trajectory, contact) == []


def test_a_run_leaves_its_folder_and_spares_what_is_there(tmp_path: Path) -> None:
    quiet = scenario(output={"recording": False, "figures": False})
    out = tmp_path / "out"
    first = tt.run(quiet, out, scenario_folder=HERE)
    assert {path.name for path in out.iterdir()} == {
        "manifest.json",
        "metrics.json",
        "scenario.resolved.toml",
        "trajectory.parquet",
    }
    assert json.loads((out / "metrics.json").read_text()) == first.metrics
    told = r"^out: got .*; the folder is not empty; give another one, or force=True to replace the"
    with pytest.raises(tt.InputError, match=told):
        tt.run(quiet, out, scenario_folder=HERE)
    (out / "metrics.json").unlink()
    assert tt.run(quiet, out, force=True, scenario_folder=HERE).outcome == first.outcome
    assert (out / "metrics.json").is_file()


def test_a_run_without_a_folder_makes_a_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    quiet = scenario(output={"recording": False, "figures": False}, seed=7)
    folder = tt.run(quiet, scenario_folder=HERE).folder
    assert folder.parts[:2] == ("results", "mine")
    assert folder.name.endswith("Z-7")
    manifest = json.loads((folder / "manifest.json").read_text())
    assert (manifest["seed"], manifest["plant"]) == (7, "analytic")
    assert manifest["ttwmr_mj"] == tt.__version__
    assert manifest["libraries"]["numpy"] == np.__version__
    assert manifest["gl_backend"] is None


def test_what_a_law_raised_stays_in_its_process() -> None:
    """Its module may not be known to another."""

    class OfALawError(Exception):
        """Which cannot be pickled."""

    outcome = Outcome("failed", "no gain", 1.0, OfALawError())
    copy = pickle.loads(pickle.dumps(outcome))  # our own bytes
    assert copy == outcome
    assert copy.cause is None


def test_an_input_error_crosses_processes_whole() -> None:
    faults = (Fault(key=("robot", "trailers", 1), got="3", allowed="a table"), Fault(problem="odd"))
    error = pickle.loads(pickle.dumps(tt.InputError(*faults, file="mine.toml")))  # our own bytes
    assert type(error) is tt.InputError
    assert (error.faults, error.file) == (faults, "mine.toml")
    assert str(error).splitlines() == [
        "mine.toml: 2 errors",
        "  robot.trailers.1: got 3; allowed: a table",
        "  odd",
    ]


def test_pushes_add_up_while_they_act() -> None:
    pushes = (
        PushOptions(start_s=1.0, duration_s=0.5, force_n=(1.0, 2.0)),
        PushOptions(start_s=1.2, duration_s=1.0, force_n=(10.0, 0.0)),
        PushOptions(start_s=1.0, duration_s=0.1, force_n=(0.0, -3.0), on="tractor"),
        PushOptions(start_s=1.4, duration_s=0.8, force_n=(0.0, 7.0), trailer=2),
    )
    drawn = Push.drawn(pushes, [np.random.default_rng(0)])

    def acting(time_s: float) -> dict[str, list[float]]:
        return {
            half: force[0].tolist() for half, force in forces(drawn, time_s).items() if force.any()
        }

    assert acting(0.99) == {}
    # at its start and no longer at its end, whatever way k·T rounds
    assert acting(1.0 - 1e-12) == acting(1.0) == {"trailer": [1.0, 2.0], "tractor": [0.0, -3.0]}
    assert acting(1.1 - 1e-12) == acting(1.1) == {"trailer": [1.0, 2.0]}
    assert acting(1.3) == {"trailer": [11.0, 2.0]}
    assert acting(1.5) == {"trailer": [10.0, 0.0], "trailer_2/trailer": [0.0, 7.0]}
    beside = Push.beside([drawn, drawn])
    assert forces(beside, 1.5)["trailer_2/trailer"].tolist() == [[0.0, 7.0]] * 2
    assert [push.told().get("trailer") for push in drawn] == [1, 1, None, 2]
    assert acting(2.2) == {}


def test_reports_hold_every_row_once() -> None:
    pieces: list[tt.Trajectory] = []
    result = Experiment(scenario(), HERE).run(pieces.append)
    assert np.concatenate([piece.time_s for piece in pieces]).tolist() == (
        result.trajectory.time_s.tolist()
    )
    parts = {"plant", "sensing", "controller", "loop", "report", "pace"}
    assert set(result.wall_time_s) == parts
    assert result.control_time_s.shape == (10,)
    assert (result.control_time_s > 0).all()


def test_every_second_of_a_run_has_its_period() -> None:
    result = tt.simulate(scenario(), scenario_folder=HERE)
    np.testing.assert_allclose(result.trajectory.time_s, PERIOD_S * np.arange(10), rtol=1e-15)
    assert result.outcomes[0].time_s == pytest.approx(9 * PERIOD_S)
    # the last command is asked for and not driven: nothing comes after the last row
    assert np.isfinite(result.trajectory.wheel_command_rad_s[-1]).all()


def test_a_state_out_of_bounds_ends_its_simulation_only() -> None:
    experiment = Experiment(scenario(), HERE, nsim=2)
    start = initial_state(experiment.scenario, None, 2)
    far = replace(start, q=start.q + [[0.0] * 4, [2e4, 0.0, 0.0, 0.0]])
    result = experiment.run(initial=far)
    assert [outcome.status for outcome in result.outcomes] == ["ok", "diverged"]
    assert result.outcomes[1].reason == "the state diverged beyond 10000 m or 10000 rad"
    assert result.outcomes[1].time_s == 0.0
    assert len(result.trajectory) == 10


def test_a_start_on_the_reference_is_its_first_sample_and_the_offsets() -> None:
    offsets = {"x_offset_m": 0.1, "y_offset_m": -0.2, "theta1_offset_rad": 0.3}
    given = ", ".join(f"{key} = {value}" for key, value in offsets.items())
    overrides = [f'initial={{kind = "on_reference", {given}}}']
    circle = tt.load_scenario("lab_circle", overrides)
    reference = sample_reference(circle)
    assert reference is not None
    start = initial_state(circle, reference, nsim=2)
    np.testing.assert_array_equal(start.q, [reference.q[0, 0] + [0.1, -0.2, 0.3, 0.0]] * 2)
    # it moves along its own heading, as fast as the reference, and wheels do not slide sideways
    speed_m_s, theta1 = np.hypot(*reference.q_rate[0, 0, :2]), reference.q[0, 0, 2] + 0.3
    along = [speed_m_s * np.cos(theta1), speed_m_s * np.sin(theta1)]
    np.testing.assert_allclose(start.q_rate[:, :2], [along] * 2, rtol=1e-12)
    np.testing.assert_array_equal(start.q_rate[:, 2:], [reference.q_rate[0, 0, 2:]] * 2)
    aimless = tt.load_scenario("lab_circle", [*overrides, "reference.theta2=none"])
    start = initial_state(aimless, sample_reference(aimless))
    assert start.q[0, 3] == pytest.approx(start.q[0, 2] - 0.3)  # aligned, without θ1's offset
    assert start.q_rate[0, 3] == start.q_rate[0, 2]


def test_the_age_of_what_was_seen_is_a_column() -> None:
    late = scenario(sensing={"kind": "truth", "latency_s": 0.066})
    rows = tt.simulate(late, nsim=2, scenario_folder=HERE).trajectory
    ages = PERIOD_S * np.minimum(np.arange(10), 2)
    np.testing.assert_allclose(rows.measurement_age_s, np.stack([ages, ages], 1), atol=1e-15)
    np.testing.assert_array_equal(rows.est_q[2:], rows.q[:-2])
    assert rows.est_valid.all()
    assert np.isnan(rows.labels_found).all()


def test_generators_are_independent_of_each_other() -> None:
    one, both = generators(3, ("sensor",)), generators(3, ("controller", "sensor"))
    assert one["sensor"].random() == both["sensor"].random()
    assert generators(3, ("controller",))["controller"].random() != one["sensor"].random()
    assert generators(4, ("sensor",))["sensor"].random() != both["sensor"].random()


def test_work_in_the_background_keeps_its_order_and_raises() -> None:
    before, done = sys.getswitchinterval(), []
    with Background() as background:
        assert sys.getswitchinterval() < before
        for i in range(5):
            background.do(lambda i=i: done.append(i))
    assert (done, sys.getswitchinterval()) == ([0, 1, 2, 3, 4], before)
    with pytest.raises(ZeroDivisionError), Background() as background:
        background.do(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError), Background() as background:  # noqa: PT012
        background.do(lambda: 1 / 0)
        background.do(lambda: done.append(5))
    # what broke the context comes first
    with pytest.raises(KeyError), Background() as background:  # noqa: PT012
        background.do(lambda: 1 / 0)
        raise KeyError
    assert (done[-1], sys.getswitchinterval()) == (4, before)
