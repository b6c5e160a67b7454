"""What a recording costs a run, and what it costs to look on.

The same scenario as fast as it can: without a recording, with run.rrd, and with run.rrd and the web
viewer's server fed from it. The three alternate; medians of the ratios of neighbours are quoted,
because a shared machine drifts. Wall time of the whole command's work is compared, all files but
the figures; the server starts beside the run, as it does for a user. Run it as

    python benchmarks/recording_cost.py

The last line is JSON, with the machine's load at the start.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter, process_time

from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.recording.stream.viewer import web_viewer
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario

SCENARIOS = {"truth": "lab_circle", "camera": "lab_circle_camera"}
LIMITS = {"truth": (1.05, 1.15), "camera": (1.03, 1.10)}  # recorded, live
WAYS = ("plain", "recorded", "live")


def one_run(scenario: Scenario, way: str) -> tuple[float, float]:
    """Wall time and this process's own processor time of a run [s]."""
    wanted = scenario.output.model_copy(update={"recording": way != "plain"})
    scenario = scenario.model_copy(update={"output": wanted})
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        live = stack.enter_context(LiveView(web_viewer())) if way == "live" else None
        started, used = perf_counter(), process_time()
        run_scenario(scenario, folder, live=live)
        return perf_counter() - started, process_time() - used


def measure(sensing: str, rounds: int, duration_s: float | None) -> dict[str, float]:
    """Ratios to the plain run."""
    overrides = ["output.figures=false"]
    overrides += [] if duration_s is None else [f"duration_s={duration_s}"]
    scenario = load_scenario(SCENARIOS[sensing], overrides)
    for way in WAYS:
        one_run(scenario, way)  # imports and caches
    taken: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
    for _ in range(rounds):
        for way in WAYS:
            taken[way].append(one_run(scenario, way))
        print(sensing, *(f"{way} {taken[way][-1][0]:.3f} s" for way in WAYS), flush=True)
    found = {"plain_s": round(statistics.median(wall for wall, _ in taken["plain"]), 3)}
    for way, limit in zip(WAYS[1:], LIMITS[sensing], strict=True):
        pairs = list(zip(taken[way], taken["plain"], strict=True))
        found[f"{way}_ratio"] = round(statistics.median(a[0] / b[0] for a, b in pairs), 4)
        found[f"{way}_cpu_ratio"] = round(statistics.median(a[1] / b[1] for a, b in pairs), 4)
        found[f"{way}_limit"] = limit
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="runs of each kind")
    parser.add_argument("--sensing", choices=[*SCENARIOS], help="only this one")
    parser.add_argument("--duration", type=float, help="simulated time of every run [s]")
    given = parser.parse_args()
    found: dict[str, object] = {"benchmark": "recording_cost", "load": os.getloadavg()[0]}
    for sensing in [given.sensing] if given.sensing else SCENARIOS:
        found[sensing] = measure(sensing, given.rounds, given.duration)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
