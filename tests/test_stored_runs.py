"""Run folders whose files cannot be of one run: refused with the file's name; real ones are not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_folders import LEAN, Columns, edit, made

import ttwmr_mj as tt
from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.metrics_file import read_metrics
from ttwmr_mj.results.row_stream import ROWS_FILE, RowStream
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.execute import run_experiment
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.files.folder import write_resolved
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.run import SAME, StoredRun

INF, NAN = float("inf"), float("nan")


@pytest.fixture(scope="module")
def circle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("circle"), "lab_circle")


@pytest.fixture
def folder(circle: Path, tmp_path: Path) -> Path:
    return shutil.copytree(circle, tmp_path / "run")


def at(name: str, row: int, value: float) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        columns[name] = columns[name].astype(float)
        columns[name][row] = value
        return columns

    return change


def to_all(change: Callable[[str, Any], Any]) -> Callable[[Columns], Columns]:
    return lambda columns: {name: change(name, values) for name, values in columns.items()}


def reference(change: Callable[[Any], Any]) -> Callable[[Columns], Columns]:
    return to_all(lambda name, values: change(values) if name.startswith("ref_") else values)


def times(change: Callable[[Any], Any]) -> Callable[[Columns], Columns]:
    return to_all(lambda name, values: change(values) if name == "time_s" else values)


def twice(columns: Columns) -> Columns:
    later = {name: v + (1.023 if name == "time_s" else 0) for name, v in columns.items()}
    return {name: np.concatenate([v, later[name]]) for name, v in columns.items()}


DAMAGES: dict[str, tuple[Callable[[Columns], Columns], str]] = {
    "no reference": (reference(lambda v: NAN * v), "its reference is not that of"),
    "no reference later": (at("ref_x_m", 20, NAN), "reference .* from 0.66 s on"),
    "an infinite reference": (at("ref_x_m", 20, INF), "reference .* from 0.66 s on"),
    "the reference off": (reference(lambda v: v + 3.0 * SAME), "its reference is not that of"),
    "the reference followed": (
        lambda c: c | {f"ref_{n}": c[n] for n in ("x_m", "y_m", "theta1_rad", "theta2_rad")},
        "its reference is not that of",
    ),
    "3 rows": (to_all(lambda _, v: v[:3]), "has 3 of 31 rows"),
    "1 row": (to_all(lambda _, v: v[:1]), "has 1 of 31 rows"),
    "every second row": (to_all(lambda _, v: v[::2]), "has a row at 0.066 s where .* 0.033 s"),
    "rows twice": (twice, "has 62 rows, and a run of its scenario has 31"),
    "slower": (times(lambda v: 10.0 * v), "has a row at 0.33 s"),
    "earlier": (times(lambda v: v - 5.0), "has a row at -5 s"),
    "endless": (at("time_s", -1, INF), "its times do not increase"),
    "no flags": (at("saturated", 3, NAN), "its column saturated is not 0 or 1"),
    "other flags": (at("est_valid", 3, 7.0), "its column est_valid is not 0 or 1"),
    "x unknown": (at("x_m", 20, NAN), "its column x_m is nan at 0.66 s"),
    "x far away": (at("x_m", 20, 1e90), r"its column x_m is 1e\+90 at 0.66 s"),
    "tilt infinite": (at("tilt_rad", 3, INF), "its column tilt_rad is inf at 0.099 s"),
    "tilt unknown": (at("tilt_rad", 3, NAN), "its column tilt_rad is nan at 0.099 s"),
    "tilts unknown": (
        lambda c: c | {"tilt_rad": NAN * c["tilt_rad"]},
        "its column tilt_rad is nan",
    ),
    "tilt beyond all bounds": (at("tilt_rad", 3, 1e90), r"its column tilt_rad is 1e\+90"),
    "height beyond all bounds": (at("height_m", 3, 1e5), "its column height_m is 100000"),
    "wheels": (at("wheels_on_floor", 3, 5.0), "its column wheels_on_floor is 5"),
    "half a wheel": (at("wheels_on_floor", 3, 0.5), "its column wheels_on_floor is 0.5"),
    "tilt": (at("tilt_rad", 3, 3.2), "its column tilt_rad is 3.2"),
    "slip": (at("wheel_slip_m_s", 3, -0.05), "its column wheel_slip_m_s is -0.05"),
    "an age beyond all bounds": (at("measurement_age_s", 3, 1e30), "its column .*_age_s is 1e"),
    "an age below zero": (at("measurement_age_s", 3, -1.0), "its column .*_age_s is -1"),
    "too many labels": (
        lambda c: c | {"labels_found": np.full_like(c["labels_found"], 77.0)},
        "its column labels_found is 77 at 0 s",
    ),
    "a row 50 ns late": (
        at("time_s", 20, 0.66000005),
        r"has a row at 0\.66000005 s where its scenario has one at 0\.66 s",
    ),
    "an age before all times": (at("measurement_age_s", 3, -INF), "its column .*_age_s is -inf"),
    "commands": (at("wheel_left_cmd_rad_s", 3, NAN), "its column wheel_left_cmd_rad_s is nan"),
    "a train": (
        lambda c: (
            c
            | {
                f"{p}{n}": c["x_m"]
                for p in ("", "ref_", "est_")
                for n in ("theta3_rad", "theta3_rate_rad_s")
            }
        ),
        "is of a robot with 2 trailers, and its scenario has 1",
    ),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_rows_that_cannot_be_of_their_scenario_are_refused(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, told = DAMAGES[name]
    edit(folder, change)
    before = {path: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(InputError, match=rf"run/trajectory\.parquet: .*{told}"):
        StoredRun.read(folder)
    film = ["video", str(folder), "-o", str(folder.with_suffix(".mp4")), "--quiet"]
    for words in (["score", str(folder), "--quiet"], film):
        assert main(words) == 2
        assert "run/trajectory.parquet: " in capsys.readouterr().err
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("name", "overrides", "told"),
    [
        ("lab_circle", ["duration_s=2.0"], "has 31 of 61 rows"),
        ("lab_circle", ["duration_s=0.5"], "has 31 rows, and a run of its scenario has 16"),
        ("lab_circle", ["control.sampling_time_s=0.02"], "has a row at 0.033 s where its scenario"),
        ("lab_circle", ["reference.radius_m=0.44"], "its reference is not that of its scenario"),
        ("open_loop_turn", [], "has a reference, and its scenario has none"),
        ("two_trailers_turn", [], "is of a robot with 1 trailer, and its scenario has 2"),
    ],
)
def test_a_scenario_of_another_run_is_refused(
    name: str, overrides: list[str], told: str, folder: Path
) -> None:
    write_resolved(folder, tt.load_scenario(name, [*LEAN, *overrides]), folder)
    with pytest.raises(InputError, match=rf"run/trajectory\.parquet: .*{told}"):
        StoredRun.read(folder)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("wall_time_s", NAN),
        ("wall_time_s", True),
        ("wall_time_s", -3.0),
        ("end_time_s", INF),
        ("end_time_s", 10**400),
        ("end_time_s", -1.0),
        ("status", "foo"),
        ("status", ["ok"]),
        ("reason", None),
        ("control_overruns", 1e-300),
    ],
)
def test_metrics_that_no_run_has_count_as_damaged(key: str, value: object, folder: Path) -> None:
    file = folder / "metrics.json"
    said = json.loads(file.read_text())
    file.write_text(json.dumps(said | {key: value}))
    with pytest.raises(InputError, match=r"run/metrics\.json: "):
        read_metrics(file)
    assert main(["score", str(folder), "--quiet"]) == 0  # from the rows, which are all there
    now = json.loads(file.read_text())
    assert now["verdict_reason"] == said["verdict_reason"]
    assert now["wall_time_s"] is None


def test_rows_that_end_before_their_run_are_refused(folder: Path) -> None:
    file = folder / "metrics.json"
    said = json.loads(file.read_text())
    file.write_text(json.dumps(said | {"end_time_s": 0.01}))
    with pytest.raises(InputError, match=r"ends at 0\.99 s, though metrics\.json .* 0\.01 s"):
        StoredRun.read(folder)
    said |= {"status": "failed", "reason": "the law", "end_time_s": 0.5}
    file.write_text(json.dumps(said))
    StoredRun.read(folder)  # a run of several goes on when one of them has failed
    edit(folder, to_all(lambda _, v: v[:10]))
    with pytest.raises(InputError, match=r"ends at 0\.297 s, though metrics\.json .* 0\.5 s"):
        StoredRun.read(folder)
    file.unlink()
    assert len(StoredRun.read(folder).rows) == 10  # killed, for all that is known


LAW = """
import numpy as np
from ttwmr_mj import Command, Controller
class Law(Controller):
    def start(self, task):
        {start}
    def command(self, k, estimate):
        if k == 7:
            {end}
        return Command(np.full((1, 2), 2.0), np.zeros(1, bool), np.zeros(1, bool))
"""


@pytest.mark.parametrize("plant", ["contact", "analytic"])
@pytest.mark.parametrize(
    ("start", "end", "status", "rows"),
    [
        ("pass", "raise ValueError('no more')", "failed", 8),
        ("raise ValueError('never')", "pass", "failed", 1),
        ("pass", "raise KeyboardInterrupt", "interrupted", 8),
        ("pass", "pass", "ok", 31),
    ],
)
def test_runs_that_ended_early_are_read(
    start: str, end: str, status: str, rows: int, plant: str, tmp_path: Path
) -> None:
    module = f"{tmp_path.name}_law"  # Python keeps what it imported under a name
    (tmp_path / f"{module}.py").write_text(LAW.format(start=start, end=end))
    law = f'controller={{kind="custom", target="{module}:Law"}}'
    folder = tmp_path / "run"
    folder.mkdir()
    made(folder, "lab_circle", law, f"plant.kind={plant}", beside=tmp_path)
    run = StoredRun.read(folder)
    assert run.metrics is not None
    assert (run.metrics["status"], len(run.rows)) == (status, rows)
    assert main(["score", str(folder), "--quiet"]) == 0


def test_a_robot_that_tipped_over_and_one_that_no_camera_sees_are_read(tmp_path: Path) -> None:
    push = "plant.pushes=[{start_s=0.3, duration_s=0.2, force_n=[80.0, 0.0]}]"
    for name, overrides, status in (
        ("lab_circle", [push], "diverged"),
        ("lab_circle_camera", ["initial.x_m=5.0", "duration_s=0.3"], "ok"),
    ):
        (tmp_path / name).mkdir()
        run = StoredRun.read(made(tmp_path / name, name, *overrides))
        assert run.metrics is not None
        assert run.metrics["status"] == status


def test_one_of_several_simulations_and_rows_of_a_killed_run_are_read(tmp_path: Path) -> None:
    scenario = tt.load_scenario("lab_circle", [*LEAN, "sensing.position_noise_m=1e-3"])
    rows = Experiment(scenario, nsim=3).run().trajectory
    for i in range(3):
        (folder := tmp_path / str(i)).mkdir()
        write_resolved(folder, scenario, folder)
        rows.write(folder / "trajectory.parquet", simulation=i)
        assert np.array_equal(StoredRun.read(folder).rows.q, rows.simulation(i).q)
    (folder / "trajectory.parquet").unlink()
    stream = RowStream(folder / ROWS_FILE)
    for start, stop in ((0, 9), (9, 17)):
        stream.append(rows.simulation(2).rows(start, stop))
    stream.close()
    assert len(StoredRun.read(folder).rows) == 17


class Stopped(Pace):
    """A person who stops after so many rows."""

    rows = 1

    def hold(self, time_s: float) -> bool:
        return time_s < (self.rows - 0.5) * 0.033


def test_simulations_that_fell_before_the_others_are_read(tmp_path: Path) -> None:
    push = "{start_s=0.1,duration_s=0.2,force_n=[45.0,0.0],random_direction=true}"
    scenario = tt.load_scenario("lab_circle", [*LEAN, "duration_s=2.0", f"plant.pushes=[{push}]"])
    result = tt.simulate(scenario, nsim=3)
    ends = {outcome.time_s for outcome in result.outcomes}
    assert len(ends) > 1
    assert max(ends) < 2.0
    for i in range(3):
        (tmp_path / str(i)).mkdir()
        write_resolved(tmp_path / str(i), scenario, tmp_path)
        result.trajectory.write(tmp_path / str(i) / "trajectory.parquet", simulation=i)
        assert len(StoredRun.read(tmp_path / str(i)).rows) == len(result.trajectory)


@pytest.mark.parametrize("count", [1, 2, 20])
def test_a_run_that_was_driven_by_hand_is_read(count: int, tmp_path: Path) -> None:
    scenario = tt.load_scenario("lab_circle", LEAN)
    (pace := Stopped()).rows = count

    def driven(result: Result) -> Scenario:
        return scenario.model_copy(
            update={"duration_s": max(len(result.trajectory) - 1, 1) * 0.033}
        )

    run_experiment(Experiment(scenario), tmp_path, pace=pace, replayed=driven)
    assert len(StoredRun.read(tmp_path).rows) == count


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides", [(), ("world=lab",), ("world=unkind",), ("plant.kind=analytic",)]
)
@pytest.mark.parametrize("name", sorted(path.stem for path in scenarios_folder().glob("*.toml")))
def test_every_shipped_scenario_s_run_is_read(
    name: str, overrides: tuple[str, ...], tmp_path: Path
) -> None:
    if name == "outdoor_circle" and overrides == ("plant.kind=analytic",):
        pytest.skip("its terrain is of contact physics")
    made(tmp_path, name, "duration_s=0.5", *overrides)
    run = StoredRun.read(tmp_path)
    assert np.array_equal(run.rows.q, Trajectory.read(tmp_path / "trajectory.parquet").q)
    said = (tmp_path / "metrics.json").read_bytes()
    assert main(["score", str(tmp_path), "--quiet"]) == 0
    assert (tmp_path / "metrics.json").read_bytes() == said


@pytest.mark.parametrize("lag_s", [2e-5, 0.005, 0.1])
def test_servos_that_lag_behind_are_read(lag_s: float, tmp_path: Path) -> None:
    """The extended model's rates jump with the acceleration of their setpoints between two rows."""
    extended = f"{{wheel_radius_m=0.026, track_width_m=0.119, servo_time_constant_s={lag_s}}}"
    plant = ("plant.kind=analytic", f"plant.analytic.extended={extended}")
    made(tmp_path, "rest_to_rest", "duration_s=3.0", *plant)
    assert main(["score", str(tmp_path), "--quiet"]) == 0
