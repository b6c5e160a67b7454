"""How much faster than real time a run by camera is, beside another checkout of this project.

Both trees run `ttwmr run lab_circle_camera`, with its recording and without its figure, in fresh
processes that take turns, since a shared machine drifts. Processor time is told too: it says more
where others use the machine. So that both meet the same others, `--at-once` runs the two side by
side; then only the processor times can be compared. Ratios are medians over rounds of this tree to
the other. Run it as

    python benchmarks/camera_speed.py --against ../other-checkout [--at-once]

The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]


def started(tree: Path, duration_s: float, folder: Path) -> subprocess.Popen[bytes]:
    """A run by this tree."""
    words = ["run", "lab_circle_camera", "--out", str(folder), "--quiet"]
    words += ["--set", f"duration_s={duration_s}", "--set", "output.figures=false"]
    return subprocess.Popen(
        [sys.executable, "-m", "ttwmr_mj", *words],
        env={**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"},
        cwd=tree,
        stdout=subprocess.DEVNULL,
    )


def ended(run: subprocess.Popen[bytes], folder: Path) -> tuple[float, float]:
    """Real-time factor of a run, and its processor time [s], that of its children included."""
    _, status, used = os.wait4(run.pid, 0)
    run.returncode = os.waitstatus_to_exitcode(status)
    if run.returncode:
        raise SystemExit(f"{folder}: exit code {run.returncode}")
    factor = json.loads((folder / "metrics.json").read_text())["real_time_factor"]
    return factor, used.ru_utime + used.ru_stime


def one_round(
    trees: dict[str, Path], duration_s: float, *, at_once: bool
) -> tuple[dict[str, tuple[float, float]], bool]:
    """What `ended` says of a run by each tree, and whether their trajectories are the same."""
    found, rows = {}, set()
    with tempfile.TemporaryDirectory() as parent:
        folders = {name: Path(parent) / name for name in trees}
        runs = {}
        for name, tree in trees.items():
            runs[name] = started(tree, duration_s, folders[name])
            if not at_once:
                found[name] = ended(runs[name], folders[name])
        for name in trees:
            if at_once:
                found[name] = ended(runs[name], folders[name])
            rows.add((folders[name] / "trajectory.parquet").read_bytes())
    return found, len(rows) == 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="the other checkout")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=50.0, help="simulated time [s]")
    parser.add_argument("--at-once", action="store_true", help="run both trees side by side")
    options = parser.parse_args()
    trees = {"here": HERE} | ({"there": options.against.resolve()} if options.against else {})
    rounds, same = [], True
    for number in range(options.rounds):
        found, alike = one_round(trees, options.duration, at_once=options.at_once)
        rounds.append(found)
        same &= alike
        for name, (factor, used) in found.items():
            print(f"round {number}: {name:5s} {factor:5.2f} x real time, {used:6.2f} s used")
    result: dict[str, object] = {"benchmark": "camera_speed", "same_bits": same}
    result["load"] = os.getloadavg()[0]
    for i, what in enumerate(("real_time_factor", "processor_s")):
        result[what] = {name: statistics.median(r[name][i] for r in rounds) for name in trees}
        if options.against:
            ratio = statistics.median(r["here"][i] / r["there"][i] for r in rounds)
            result[f"{what}_ratio"] = round(ratio, 3)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
