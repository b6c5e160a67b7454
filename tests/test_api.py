"""The public API in a script, where nobody checks types."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ttwmr_mj as tt

SHORT = tt.load_scenario("lab_circle", ["duration_s=0.1", "plant.kind=analytic"])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"scenario": "lab_circle"}, r"scenario: got 'lab_circle'; .*load_scenario reads one"),
        ({"nsim": 0}, "nsim: got 0; allowed: 1 to 100,000"),
        ({"nsim": 1.5}, "nsim: got 1.5"),
        ({"nsim": 10**9}, "nsim: got 1000000000"),
        ({"controller": tt.Controller}, "controller: .*allowed: Controller or None; give"),
        ({"controller": "lyapunov"}, "controller: got 'lyapunov'"),
    ],
)
def test_what_cannot_be_simulated_is_told(arguments: dict[str, Any], told: str) -> None:
    with pytest.raises(tt.InputError, match=told):
        tt.simulate(**({"scenario": SHORT} | arguments))


def test_numbers_and_folders_of_other_kinds_are_taken(tmp_path: Path) -> None:
    assert tt.simulate(SHORT, np.int64(2), scenario_folder=str(tmp_path)).trajectory.nsim == 2
    done = tt.run(SHORT, str(tmp_path / "out"), scenario_folder=str(tmp_path))
    assert (done.folder / "metrics.json").is_file()
    with pytest.raises(tt.InputError, match="scenario: got None"):
        tt.run(None)
    with pytest.raises(tt.InputError, match="no such scenario file"):
        tt.load_scenario(tmp_path / "none.toml")


TRAJECTORY = tt.simulate(SHORT).trajectory


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: tt.run_batch(["lab_circle"]), r"scenarios\[0\]: got 'lab_circle'"),
        (lambda: tt.run_batch(SHORT), "scenarios: got .*; allowed: Sequence; a list of them"),
        (lambda: tt.compare("lab_circle"), "scenario: got 'lab_circle'"),
        (lambda: tt.compare(SHORT, "open"), "mode: got 'open'; allowed: open_loop, closed_loop"),
        (lambda: tt.compare(SHORT, "closed_loop", real_wheels=True), 'with mode "open_loop" only'),
        (lambda: tt.score("run", SHORT.robot), "trajectory: got 'run'; allowed: Trajectory"),
        (lambda: tt.score(TRAJECTORY, SHORT), "robot: got .*; allowed: RobotParameters"),
        (lambda: tt.judge("run", SHORT.robot), "trajectory: got 'run'"),
        (lambda: tt.judge(TRAJECTORY, SHORT), "robot: got .*; allowed: RobotParameters"),
        (lambda: tt.judge(TRAJECTORY, SHORT.robot, status="fine"), "status: got 'fine'; .*failed"),
        (lambda: tt.load_scenario(5), "name_or_path: got 5; allowed: str or Path"),
        (lambda: tt.load_scenario("lab_circle", "seed=7"), r"overrides: .*; as in \["),
        (lambda: tt.check_scenario("lab_circle", "mine"), "data: got 'lab_circle'; allowed: dict"),
    ],
)
def test_what_is_of_another_kind_is_told(call: Callable[[], object], told: str) -> None:
    with pytest.raises(tt.InputError, match=told):
        call()
