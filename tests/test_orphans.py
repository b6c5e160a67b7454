"""kill -9 of a command with workers leaves none of them behind."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import pytest
from test_pool import wait_until_gone

SWEEP = """
name = "long"
scenario = "lab_circle"
overrides = ["duration_s=3600.0"]
metric = "tractor_rmse_m"
[parameters]
"controller.alpha1" = { values = [10.0, 20.0] }
"""


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they did."""
    children = defaultdict(list)
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        children[int(words[1])].append(int(stat.parent.name))
    found, waiting = [], [pid]
    while waiting:
        mine = children[waiting.pop()]
        found += mine
        waiting += mine
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["bench", "quick", "--out", "out", "--workers", "2"],
        ["sweep", "long.toml", "--out", "out", "--workers", "2"],
        ["reproduce", "--out", "out"],
    ],
)
def test_no_worker_outlives_a_killed_command(words: list[str], tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text(SWEEP)
    process = subprocess.Popen(
        [sys.executable, "-m", "ttwmr_mj", *words, "--quiet"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    with process:
        deadline = time.monotonic() + 200
        while len(descendants(process.pid)) < 3:  # tracker, server and a worker
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.1)
        workers = descendants(process.pid)
        process.send_signal(signal.SIGKILL)
    wait_until_gone(workers)
