"""Same scenario, machine and versions: the same bits, whatever else is so or so."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario

NOISE = ["sensing.position_noise_m=1e-3", "sensing.rate_noise_rad_s=1e-2"]
LATE = ["sensing.latency_s=0.066", "sensing.latency_jitter_s=0.033", "sensing.drop_probability=0.2"]
EXTENDED = (
    "plant.analytic.extended={wheel_radius_m=0.026, track_width_m=0.119, slip_time_s=7e-4, "
    "servo_time_constant_s=2e-5, hitch_coulomb_friction_n_m=1e-4, rolling_resistance_m=1e-5}"
)
BARE = ["duration_s=0.2", "output.recording=false", "output.figures=false"]
# every kind of sensing, and every plant
CASES: dict[str, tuple[str, list[str]]] = {
    "truth": ("lab_circle", NOISE),
    "late truth": ("lab_circle", NOISE + LATE),
    "camera": ("lab_circle_camera", []),
    "late camera": ("lab_circle_camera", LATE),
    "analytic": ("lab_circle", [*NOISE, "plant.kind=analytic"]),
    "extended": ("lab_circle", [*NOISE, "plant.kind=analytic", EXTENDED]),
    "kinetic": ("lab_circle", ["plant.kind=analytic", "control.inner_loop=computed_torque"]),
}
# what must not matter → how the process is started
WITHIN: dict[str, dict[str, str]] = {
    "hash seed": {"PYTHONHASHSEED": "1"},
    "locale": {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0"},
    "threads": {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "LP_NUM_THREADS": "2"},
    "one processor": {"TTWMR_ONE_CPU": "1"},
    "time zone": {"TZ": "Asia/Kathmandu"},
}


def scenario_of(case: str) -> Scenario:
    name, changes = CASES[case]
    return load_scenario(name, [*BARE, *changes])


def digest(rows: Trajectory, simulation: int = 0) -> str:
    """Of every column of one simulation."""
    told = hashlib.sha256()
    for name, values in rows.simulation(simulation).to_columns().items():
        told.update(name.encode() + values.tobytes())
    return told.hexdigest()


def digests() -> dict[str, str]:
    return {case: digest(Experiment(scenario_of(case)).run().trajectory) for case in CASES}


def digests_within(**env: str) -> dict[str, str]:
    """The same in another process."""
    here = Path(__file__).parent
    paths = [str(here), str(here.parent), os.environ.get("PYTHONPATH", "")]
    code = "import os, sys, json\n"
    if env.pop("TTWMR_ONE_CPU", ""):
        code += "os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
    code += "import test_determinism as t\nprint(json.dumps(t.digests()))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)} | env,
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    found: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.fixture(scope="module")
def here() -> dict[str, str]:
    return digests()


@pytest.mark.slow
def test_neither_the_process_nor_its_environment_matters(here: dict[str, str]) -> None:
    assert len(set(here.values())) == len(CASES)  # each is a run of its own
    assert digests() == here
    together = {name: value for env in WITHIN.values() for name, value in env.items()}
    assert digests_within(**together) == here


@pytest.mark.slow
@pytest.mark.parametrize("what", WITHIN)
def test_nor_any_of_it_by_itself(what: str, here: dict[str, str]) -> None:
    assert digests_within(**WITHIN[what]) == here


SEEN = [pytest.param(case, marks=[pytest.mark.slow] * ("camera" in case)) for case in CASES]


@pytest.mark.parametrize("case", SEEN)
def test_nor_who_else_is_in_the_batch(case: str) -> None:
    alone = digest(Experiment(scenario_of(case)).run().trajectory)
    for nsim in (2, 5):
        rows = Experiment(scenario_of(case), nsim=nsim).run().trajectory
        assert digest(rows) == alone
        if "sensing" in "".join(CASES[case][1]) or "camera" in case:
            assert not np.array_equal(rows.est_q[:, 0], rows.est_q[:, 1])  # noise of its own


@pytest.mark.slow
@pytest.mark.parametrize("case", ["truth", "late camera"])
def test_nor_whether_it_is_recorded(case: str, tmp_path: Path) -> None:
    name, changes = CASES[case]
    recorded = load_scenario(name, [*BARE[:1], *changes])
    run_scenario(recorded, tmp_path)
    rows = Trajectory.read(tmp_path / "trajectory.parquet")
    alone = Experiment(scenario_of(case)).run().trajectory.simulation().to_columns()
    for column, values in rows.to_columns().items():
        assert values.tobytes() == alone[column].tobytes(), column
