"""What long runs, and many runs in one process, leave in memory.

    python benchmarks/long_runs.py truth 3600
    python benchmarks/long_runs.py camera 600
    python benchmarks/long_runs.py many 200

Of one run: resident memory when its first minute has been simulated, the largest until its last
sample, and the largest until all its files are written; the sizes of the files. Of many runs, each
recorded: memory, threads and open files after a tenth of them and after all. The last line is JSON.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import shutil
import tempfile
import threading
from pathlib import Path
from time import perf_counter

from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.scenario.file import load_scenario

FIRST_S = 60.0  # simulated, in which everything that a run needs is loaded
SCENARIOS = {"truth": "lab_circle", "camera": "lab_circle_camera"}


def resident_mb() -> float:
    """Memory that this process holds now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def peak_mb() -> float:
    """The most that it held since `forget_peak`."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) * 1.024e-3


def forget_peak() -> None:
    """From now on, the peak is another: what was built at the start is no growth."""
    Path("/proc/self/clear_refs").write_text("5")


def one_run(kind: str, duration_s: float) -> dict[str, object]:
    """One long run, recorded."""
    scenario = load_scenario(SCENARIOS[kind], [f"duration_s={duration_s}", "output.figures=false"])
    seen: list[float] = []

    def look(time_s: float) -> None:
        if time_s < min(FIRST_S, 0.2 * duration_s):
            return
        if not seen:
            forget_peak()
        seen.append(resident_mb())

    with tempfile.TemporaryDirectory() as folder:
        started = perf_counter()
        run = run_scenario(scenario, Path(folder), progress=look)
        took_s = perf_counter() - started
        sizes = {path.name: path.stat().st_size / 1e6 for path in Path(folder).iterdir()}
    first = seen[0]
    return {
        "kind": kind,
        "simulated_s": round(run.outcome.time_s, 1),  # less if it was stopped
        "wall_s": round(took_s, 1),
        "first_mb": round(first, 1),
        "growth_mb": round(max(seen) - first, 1),
        "with_files_mb": round(peak_mb() - first, 1),
        "files_mb": {name: round(size, 2) for name, size in sorted(sizes.items())},
    }


def many_runs(count: int) -> dict[str, object]:
    """Short runs one after the other."""
    scenario = load_scenario("lab_circle", ["duration_s=2.0", "output.figures=false"])
    held = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(count):
            into = Path(folder) / "run"
            into.mkdir()
            run_scenario(scenario, into)
            shutil.rmtree(into)
            if k + 1 in (max(count // 10, 1), count):
                gc.collect()
                tasks = len(list(Path("/proc/self/task").iterdir()))
                files = len(list(Path("/proc/self/fd").iterdir()))
                held.append((resident_mb(), tasks, files, threading.active_count()))
    names = ("growth_mb", "threads", "files", "python_threads")
    growth = {n: round(b - a, 1) for n, a, b in zip(names, *held, strict=True)}
    return {"kind": "many", "runs": count, **growth}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=[*SCENARIOS, "many"])
    parser.add_argument("amount", type=float, help="simulated seconds, or runs")
    given = parser.parse_args()
    many = given.kind == "many"
    print(json.dumps(many_runs(int(given.amount)) if many else one_run(given.kind, given.amount)))


if __name__ == "__main__":
    main()
