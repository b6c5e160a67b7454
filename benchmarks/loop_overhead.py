"""What the closed loop and the recording cost on top of bare physics.

The 50 s lab circle, truth sensing, everything recorded, against the same number of bare `mj_step`
on the same model, under the same wheel commands, in the same process. The two alternate; medians
of ratios are quoted, because a shared machine drifts. Run it as

    python benchmarks/loop_overhead.py

The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
from pathlib import Path
from time import perf_counter

import mujoco
import numpy as np

from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.runs.execute import Run, run_scenario
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario

OVERRIDES = ["output.figures=false"]  # drawings are no part of the loop; timed apart below


def bare_physics_s(scenario: Scenario, wheel_commands: np.ndarray) -> float:
    """Wall time of as many bare steps as the run makes, under the wheel speeds it commanded."""
    model = build_model(scenario.robot, scenario.plant.contact)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    steps = scenario.steps_per_period
    started = perf_counter()
    for command in wheel_commands[:-1]:
        data.ctrl[:] = command
        mujoco.mj_step(model, data, steps)
    return perf_counter() - started


def whole_run_s(scenario: Scenario) -> tuple[float, Run]:
    """Wall time of a run with all its files but the figures."""
    with tempfile.TemporaryDirectory() as folder:
        started = perf_counter()
        run = run_scenario(scenario, Path(folder))
        return perf_counter() - started, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="pairs of measurements")
    rounds = parser.parse_args().rounds
    scenario = load_scenario("lab_circle", OVERRIDES)
    whole_run_s(scenario)  # imports and caches
    commands = Experiment(scenario).run().trajectory.wheel_command_rad_s[:, 0]
    pairs, shares = [], []
    for _ in range(rounds):
        bare = bare_physics_s(scenario, commands)
        whole, run = whole_run_s(scenario)
        pairs.append((bare, whole))
        shares.append(run.wall_time_s)
        print(f"bare {bare:.3f} s, whole run {whole:.3f} s, ratio {whole / bare:.3f}")
    share = {
        part: statistics.median(one[part] / sum(one.values()) for one in shares)
        for part in shares[0]
    }
    for part, value in share.items():
        print(f"  {part:12s} {100 * value:5.1f} % of the run")
    bare = statistics.median(pair[0] for pair in pairs)
    print(
        json.dumps(
            {
                "benchmark": "loop_overhead",
                "rounds": rounds,
                "steps": scenario.periods * scenario.steps_per_period,
                "bare_s": round(bare, 4),
                "whole_run_s": round(statistics.median(pair[1] for pair in pairs), 4),
                "ratio": round(statistics.median(b / a for a, b in pairs), 4),
                "real_time_factor": round(
                    scenario.duration_s / statistics.median(pair[1] for pair in pairs), 1
                ),
                "share": {part: round(value, 4) for part, value in share.items()},
            }
        )
    )


if __name__ == "__main__":
    main()
