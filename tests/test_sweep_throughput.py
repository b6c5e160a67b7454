"""The benchmark of sweeps, a little of everything."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parent.parent / "benchmarks" / "sweep_throughput.py"


@pytest.mark.slow
def test_it_measures_all_that_it_is_asked_for(tmp_path: Path) -> None:
    figure = tmp_path / "work_precision.png"
    words = [sys.executable, str(BENCHMARK), "--quick", "--figure", str(figure)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["open_loop"]["simulations"] == 8
    assert found["open_loop"]["ratio"] > 0.0
    assert found["processes"]["ratio"] > 1.0  # starting Python alone takes longer
    assert found["adding_up"]["runs"] == 16
    shipped, coarse, *_, swept = found["work_precision"]
    assert shipped["error_m"] < coarse["error_m"]
    assert (swept["cone"], swept["rolling_resistance_m"]) == ("elliptic", 1.6e-5)
    assert figure.stat().st_size > 10_000
