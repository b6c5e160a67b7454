"""Memory, threads and files of long runs and of many: proxies of benchmarks/long_runs.py."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parent.parent / "benchmarks" / "long_runs.py"


def measured(kind: str, amount: int) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, SCRIPT, kind, str(amount)], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""  # nothing that a library thinks of it
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


@pytest.mark.slow
def test_a_run_grows_by_nothing_once_it_is_under_way() -> None:
    found = measured("truth", 300)
    # Rerun and the allocators settle within some MB; a table of contents of the recording, which
    # is what grew, took 0.14 MB for each of the reports, some hundred here
    assert found["growth_mb"] < 8.0
    assert set(found["files_mb"]) == {
        "manifest.json",
        "metrics.json",
        "run.rrd",
        "scenario.resolved.toml",
        "trajectory.parquet",
    }


@pytest.mark.slow
def test_runs_in_one_process_leave_nothing_behind() -> None:
    found = measured("many", 30)
    assert (found["threads"], found["files"], found["python_threads"]) == (0, 0, 0)
    assert found["growth_mb"] < 27.0  # 1 MB a run: a stream that stays held 3 and more
