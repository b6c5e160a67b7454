"""The public API in a script, where nobody checks types."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.scenario.file import check_scenario
from ttwmr_mj.scenario.given import require_scenario
from ttwmr_mj.state import RobotState

SHORT = tt.load_scenario("lab_circle", ["duration_s=0.1", "plant.kind=analytic"])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"scenario": "lab_circle"}, r"scenario: got 'lab_circle'; .*load_scenario reads one"),
        ({"nsim": 0}, "nsim: got 0; allowed: 1 to 100,000"),
        ({"nsim": 2.0}, "nsim: got 2.0; it must be a whole number; allowed: 1 to 100,000"),
        ({"nsim": 1.5}, "nsim: got 1.5"),
        ({"nsim": 10**9}, "nsim: got 1000000000"),
        ({"controller": tt.Controller}, "controller: .*allowed: Controller or None; give"),
        ({"controller": "lyapunov"}, "controller: got 'lyapunov'"),
    ],
)
def test_what_cannot_be_simulated_is_told(arguments: dict[str, Any], told: str) -> None:
    with pytest.raises(tt.InputError, match=told):
        tt.simulate(**({"scenario": SHORT} | arguments))


@pytest.mark.parametrize(
    ("update", "told"),
    [
        ({"duration_s": 1e9}, r"^scenario\.duration_s: got 1000000000"),
        ({"duration_s": "a"}, r"^scenario\.duration_s: got 'a'"),
        ({"seed": -1}, r"^scenario\.seed: got -1"),
        ({"robot": None}, r"^scenario\.robot: got None; allowed: a table"),
        ({"reference": None}, r"^scenario\.reference: got None; allowed: a table"),
        ({"duration": 1.0}, r"^scenario\.duration: unknown key \(did you mean 'duration_s'"),
        (
            {"control": SHORT.control.model_copy(update={"sampling_time_s": -1.0})},
            r"^scenario\.control\.sampling_time_s: got -1\.0",
        ),
        ({"duration_s": 1e-4}, r"^scenario\.duration_s: .*at least one control period"),
    ],
)
def test_what_a_copy_is_told_wrong_is_refused(update: dict[str, Any], told: str) -> None:
    """Pydantic's model_copy looks at nothing."""
    copied = SHORT.model_copy(update=update)
    for call in (tt.simulate, tt.run, tt.compare):
        with pytest.raises(tt.InputError, match=told):
            call(copied)
    with pytest.raises(tt.InputError, match=told.replace("scenario", r"scenarios\[1\]")):
        tt.run_batch([SHORT, copied])


@pytest.mark.parametrize(
    "update",
    [
        {"seed": np.int64(3)},
        {"duration_s": np.float32(0.5)},
        {"output": SHORT.output.model_copy(update={"recording": np.False_})},
        {"reference": SHORT.reference.model_copy(update={"centre_m": np.array([0.0, 0.5])})},
    ],
)
@pytest.mark.filterwarnings("error")
def test_numbers_and_arrays_of_numpy_in_a_copy_are_as_good_as_pythons(
    update: dict[str, Any], tmp_path: Path
) -> None:
    """A run wrote its files, and met numbers that TOML and JSON lack."""
    copied = SHORT.model_copy(update=update)
    scenario = require_scenario(copied)
    assert check_scenario(json.loads(scenario.model_dump_json()), "again") == scenario
    run = tt.run(copied, tmp_path / "run")
    assert run.outcome.status == "ok"
    assert tt.load_scenario(tmp_path / "run" / "scenario.resolved.toml") == scenario
    assert tt.simulate(copied).scenario == scenario


def test_a_sound_copy_is_run_as_it_is() -> None:
    strange = {
        "array": np.arange(3.0),
        "far": float("inf"),
        "day": date(2020, 1, 1),
        "path": Path(),
    }
    own = CustomOptions(target="idle:Idle", folder="laws", options=strange)
    unkind = tt.load_scenario("sim_circle", ["world=unkind", "plant.kind=contact"])
    for whole in (SHORT.model_copy(update={"controller": own}), unkind.model_copy()):
        assert require_scenario(whole) is whole
    turned = SHORT.model_copy(update={"seed": 3, "belief": unkind.belief})
    assert require_scenario(turned) is turned
    tables = SHORT.model_copy(update={"ground": {"slope_rad": 0.1}, "world": "unkind"})
    assert require_scenario(tables).ground.slope_rad == 0.1
    assert require_scenario(tables).robot == SHORT.robot  # what its world adds, it had when read


def test_results_are_compared_by_their_values() -> None:
    """NaN is NaN; they hold arrays, so they have no hash."""
    result = tt.simulate(SHORT, 2)
    assert np.isnan(result.trajectory.labels_found).any()
    state = RobotState(result.trajectory.q[0], result.trajectory.q_rate[0])
    command = tt.Command(np.zeros((2, 2)), np.zeros(2, bool), np.zeros(2, bool), {"a": np.ones(2)})
    pair = tt.compare(tt.load_scenario("sim_circle", ["duration_s=0.1"]))
    for value in (result, result.trajectory, state, command, pair, pair.deviation, pair.residuals):
        assert value == copy.deepcopy(value)
        assert value != 1
        with pytest.raises(TypeError, match="unhashable"):
            hash(value)
    assert result.trajectory != result.trajectory.rows(0, 2)
    assert state != replace(state, q=state.q + 1.0)
    assert command != replace(command, signals={"a": np.zeros(2)})
    assert result == tt.simulate(SHORT, 2)  # which took another time
    assert result != replace(result, outcomes=())


def test_numbers_and_folders_of_other_kinds_are_taken(tmp_path: Path) -> None:
    assert tt.simulate(SHORT, np.int64(2), scenario_folder=str(tmp_path)).trajectory.nsim == 2
    done = tt.run(SHORT, str(tmp_path / "out"), scenario_folder=str(tmp_path))
    assert (done.folder / "metrics.json").is_file()
    with pytest.raises(tt.InputError, match="scenario: got None"):
        tt.run(None)
    with pytest.raises(tt.InputError, match="no such scenario file"):
        tt.load_scenario(tmp_path / "none.toml")


def test_what_is_as_good_is_taken(tmp_path: Path) -> None:
    (tmp_path / "idle.py").write_text(IDLE)
    law = 'controller={kind="custom", target="idle:Idle"}'
    own = tt.load_scenario("lab_circle", ["duration_s=0.1", law])
    assert tt.run_batch(iter([own]), str(tmp_path))[0].outcomes[0].status == "ok"
    assert len(tt.run_batch({1: SHORT, 2: SHORT}.values())) == 2
    tt.compare(own, scenario_folder=str(tmp_path))
    TRAJECTORY.write(str(tmp_path / "rows.parquet"))
    assert len(tt.Trajectory.read(str(tmp_path / "rows.parquet"))) == len(TRAJECTORY)
    (tmp_path / "fragment.toml").write_text("seed = 7")
    assert tt.load_scenario("lab_circle", fragment=str(tmp_path / "fragment.toml")).seed == 7


IDLE = """
import ttwmr_mj as tt

class Idle(tt.Controller):
    def start(self, task):
        pass

    def command(self, k, estimate):
        return self.plain([[0.0, 0.0]])
"""


def test_numbers_of_numpy_are_as_good_in_a_scenario() -> None:
    assert tt.load_scenario("lab_circle", seed=np.int64(3)).seed == 3  # type: ignore[arg-type]
    points = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
    data: dict[str, Any] = {
        "name": "mine",
        "duration_s": 1.0,
        "seed": 2,
        "reference": {"kind": "waypoints", "points_m": points, "speed_m_s": 0.5},
        "controller": {"kind": "feedforward"},
    }
    same = data | {"duration_s": np.float32(1.0), "seed": np.int32(2)}
    same["reference"] = data["reference"] | {"points_m": np.array(points)}
    assert tt.check_scenario(same, "mine") == tt.check_scenario(data, "mine")


PUSH = "{start_s=0.1, duration_s=0.1, force_n=[3, 0], random_direction=true}"


@pytest.mark.parametrize(
    "chance",
    [
        "sensing.position_noise_m=0.01",
        "sensing.latency_jitter_s=0.066",
        "sensing.drop_probability=0.5",
        "control.command_jitter_s=0.099",
        "control.command_drop_probability=0.5",
        f"plant.pushes=[{PUSH}]",
    ],
)
def test_simulations_of_a_batch_differ_by_what_is_left_to_chance(chance: str) -> None:
    scenario = tt.load_scenario("lab_circle", ["duration_s=0.5", chance])
    first, second = np.moveaxis(tt.simulate(scenario, 2).trajectory.q, 1, 0)
    np.testing.assert_array_equal(first, tt.simulate(scenario).trajectory.q[:, 0])
    assert not np.array_equal(first, second)


def within_itself() -> dict[str, Any]:
    data: dict[str, Any] = {}
    data["robot"] = [data]
    return data


def torn() -> tt.Trajectory:
    q = TRAJECTORY.q.copy()
    q[1] = np.nan
    return replace(TRAJECTORY, q=q)


TRAJECTORY = tt.simulate(SHORT).trajectory
TRAIN = tt.load_scenario("double_inverted", ["duration_s=0.1", "plant.kind=analytic"])


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: tt.run_batch(["lab_circle"]), r"scenarios\[0\]: got 'lab_circle'"),
        (lambda: tt.run_batch(SHORT), "scenarios: got .*; allowed: list; of what load_scenario"),
        (lambda: tt.run_batch("lab_circle"), "scenarios: got 'lab_circle'; allowed: list"),
        (lambda: tt.run_batch([SHORT], 5), "folder: got 5; allowed: str or Path"),
        (lambda: tt.run_batch([SHORT], nthread=-1), "nthread: got -1; allowed: 0 to 1,024"),
        (lambda: tt.run_batch([SHORT], nthread="2"), "nthread: got '2'"),
        (lambda: tt.simulate(SHORT, scenario_folder=5), "scenario_folder: got 5"),
        (lambda: tt.run(SHORT, 5), "out: got 5; allowed: str or Path"),
        (lambda: tt.run(SHORT, "a\0"), r"out: got 'a\\x00'; no file has such a name"),
        (lambda: tt.run(SHORT, "out", force="no"), "force: got 'no'; allowed: bool"),
        (lambda: tt.compare(SHORT, scenario_folder=5), "scenario_folder: got 5"),
        (lambda: tt.compare("lab_circle"), "scenario: got 'lab_circle'"),
        (lambda: tt.compare(SHORT, "open"), "mode: got 'open'; allowed: open_loop, closed_loop"),
        (lambda: tt.compare(SHORT, "closed_loop", real_wheels=True), 'with mode "open_loop" only'),
        (lambda: tt.score("run", SHORT.robot), "trajectory: got 'run'; allowed: Trajectory"),
        (lambda: tt.score(TRAJECTORY, SHORT), "robot: got .*; allowed: RobotParameters"),
        (lambda: tt.judge("run", SHORT.robot), "trajectory: got 'run'"),
        (lambda: tt.judge(TRAJECTORY, SHORT), "robot: got .*; allowed: RobotParameters"),
        (lambda: tt.judge(TRAJECTORY, SHORT.robot, status="fine"), "status: got 'fine'; .*failed"),
        (
            lambda: tt.judge(TRAJECTORY, SHORT.robot, accept={}),
            "accept: got a table; .*in scenario",
        ),
        (
            lambda: tt.score(TRAJECTORY, TRAIN.robot),
            "robot: got a robot with 2 trailers; .* with 1;",
        ),
        (
            lambda: tt.judge(tt.simulate(TRAIN).trajectory, SHORT.robot),
            "with 1 trailer; .* with 2;",
        ),
        (lambda: tt.score(TRAJECTORY.rows(0, 0), SHORT.robot), "trajectory: got no rows"),
        (lambda: tt.judge(TRAJECTORY.rows(0, 0), SHORT.robot), "trajectory: got no rows"),
        (
            lambda: tt.judge(torn(), SHORT.robot),
            "trajectory: q is not finite at 0.033 s; give .*stat",
        ),
        (lambda: TRAJECTORY.simulation(1.0), "simulation: got 1.0; .* has 1 .*; allowed: 0 to 0"),
        (lambda: TRAJECTORY.to_table("0"), "simulation: got '0'"),
        (lambda: TRAJECTORY.write(5), "path: got 5; allowed: str or Path"),
        (lambda: tt.Trajectory.read(None), "path: got None; allowed: str or Path"),
        (lambda: tt.Trajectory.read("s3:/x"), "cannot be read as a trajectory: .*No such file"),
        (
            lambda: tt.load_scenario("lab_circle", [1]),
            r"overrides\[0\]: got 1; allowed: str; as in",
        ),
        (
            lambda: tt.load_scenario("lab_circle", fragment={}),
            "fragment: got a table; allowed: str",
        ),
        (lambda: tt.check_scenario([], "mine"), r"data: got \[\]; allowed: dict"),
        (lambda: tt.check_scenario({}, None), "source: got None; allowed: str"),
        (lambda: tt.check_scenario(within_itself(), "mine"), "mine: tables and lists .* 32 deep"),
        (lambda: tt.check_scenario({None: 1}, "mine"), "mine: a key is None; allowed: text"),
        (lambda: tt.load_scenario(5), "name_or_path: got 5; allowed: str or Path"),
        (lambda: tt.load_scenario("lab_circle", "seed=7"), r"overrides: .*; as in \["),
        (lambda: tt.check_scenario("lab_circle", "mine"), "data: got 'lab_circle'; allowed: dict"),
    ],
)
def test_what_is_of_another_kind_is_told(call: Callable[[], object], told: str) -> None:
    with pytest.raises(tt.InputError, match=told):
        call()
