"""The public API in a script, where nobody checks types."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ttwmr_mj as tt

SHORT = tt.load_scenario("lab_circle", ["duration_s=0.1", "plant.kind=analytic"])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"scenario": "lab_circle"}, r"scenario: got 'lab_circle'; .*tt.load_scenario reads one"),
        ({"nsim": 0}, "nsim: got 0; allowed: 1 to 100,000"),
        ({"nsim": 1.5}, "nsim: got 1.5"),
        ({"nsim": 10**9}, "nsim: got 1000000000"),
        ({"controller": tt.Controller}, "controller: .*allowed: an instance of a Controller"),
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
