"""How much faster than real time a run by camera is, beside another checkout of this project.

Both trees run `ttwmr run lab_circle_camera`, with its recording and without its figure, in fresh
processes that take turns, since a shared machine drifts. Processor time is told too: it says more
where others use the machine. The trajectories must be the same bits. Run it as

    python benchmarks/camera_speed.py --against ../other-checkout

The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]


def one_run(tree: Path, duration_s: float, folder: Path) -> tuple[float, float]:
    """Real-time factor of a run by this tree, and its processor time [s]."""
    words = ["run", "lab_circle_camera", "--out", str(folder), "--quiet"]
    words += ["--set", f"duration_s={duration_s}", "--set", "output.figures=false"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "ttwmr_mj", *words],
        env={**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"},
        cwd=tree,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads((folder / "metrics.json").read_text())["real_time_factor"], used_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="the other checkout")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=50.0, help="simulated time [s]")
    options = parser.parse_args()
    trees = {"here": HERE} | ({"there": options.against.resolve()} if options.against else {})
    factors: dict[str, list[float]] = {name: [] for name in trees}
    used_s: dict[str, list[float]] = {name: [] for name in trees}
    rows: dict[str, bytes] = {}
    for number in range(options.rounds):
        for name, tree in trees.items():
            with tempfile.TemporaryDirectory() as folder:
                factor, used = one_run(tree, options.duration, Path(folder) / "run")
                rows[name] = (Path(folder) / "run" / "trajectory.parquet").read_bytes()
            factors[name].append(factor)
            used_s[name].append(used)
            print(f"round {number}: {name:5s} {factor:5.2f} x real time, {used:6.2f} s used")
    same = len(set(rows.values())) == 1
    print("same trajectories" if same else "trajectories differ")
    medians = {name: statistics.median(values) for name, values in factors.items()}
    spent = {name: statistics.median(values) for name, values in used_s.items()}
    print(json.dumps({"real_time_factor": medians, "processor_s": spent, "same_bits": same}))


if __name__ == "__main__":
    main()
