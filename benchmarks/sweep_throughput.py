"""What many different closed-loop simulations cost: against open-loop physics, processes, memory.

All on contact physics with truth sensing, the lab circle with different robots, floors and gains:

- steps/s of 1,024 simulations of 512 parameter sets in one batch, against `mujoco.rollout` of as
  many steps of the same models under the same wheel speeds;
- runs/s of batches, their metrics and verdicts included, against one `ttwmr run` process each,
  without figures and recording;
- time and memory per finished run, of whom metrics and verdict are kept, as runs add up; ratios of
  time are of times over that of a fixed piece of work beside them, as the machine's speed changes;
- a work-precision diagram of contact physics itself (`work_precision`).

The contenders alternate in one process; medians are quoted. Wall time is what counts, CPU time
tells what a busy machine did to it. Run it as

    python benchmarks/sweep_throughput.py [--quick] [--adding-up]
                                          [--figure docs/images/work_precision.png]

The last line is JSON.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from work_precision import draw, measured

from ttwmr_mj.assets import models_folder
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.runs.batch import run_batch
from ttwmr_mj.runs.metrics import metrics_of
from ttwmr_mj.runs.simulations import Simulations
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray

THREADS = len(os.sched_getaffinity(0))
WITHOUT = ["output.figures=false", "output.recording=false"]


class Sizes(NamedTuple):
    """How much is measured."""

    rounds: int
    simulations: int  # in the batch that is compared with open loop
    periods: int  # of it
    run_s: float  # simulated, of a run compared with a process
    processes: int
    short_s: float  # simulated, of a run where they add up
    batch: int  # of these
    few: int  # runs after which memory and cost are looked at,
    many: int  # and again


FULL = Sizes(5, 1024, 10, 10.0, 2, 0.2, 100, 1_000, 10_000)
QUICK = Sizes(1, 8, 3, 0.3, 1, 0.1, 4, 8, 16)


class Took(NamedTuple):
    """Seconds."""

    wall: float
    cpu: float


def timed(work: Callable[[], object]) -> Took:
    gc.collect()
    began, began_cpu = perf_counter(), process_time()
    work()
    return Took(perf_counter() - began, process_time() - began_cpu)


def parameter_sets(count: int, duration_s: float, seed: int = 0) -> list[Scenario]:
    """The lab circle as many times, with different numbers."""
    rng = np.random.default_rng(seed)
    return [
        load_scenario(
            "lab_circle",
            [
                f"duration_s={duration_s}",
                f"robot.trailer.mass_kg={rng.uniform(0.28, 0.38)}",
                f"robot.trailer.com_offset_m={rng.uniform(0.13, 0.15)}",
                f"robot.hitch.damping_n_m_s_rad={rng.uniform(1e-4, 1e-3)}",
                f"plant.contact.floor_friction={rng.uniform(0.7, 1.0)}",
                f"controller.alpha1={rng.uniform(20.0, 30.0)}",
                f"seed={i}",
                *WITHOUT,
            ],
        )
        for i in range(count)
    ]


def against_open_loop(sizes: Sizes) -> dict[str, object]:
    """Steps/s of the closed loop and of `mujoco.rollout`, same models, same wheel speeds."""
    period_s = load_scenario("lab_circle").control.sampling_time_s
    half = parameter_sets(sizes.simulations // 2, (sizes.periods + 0.5) * period_s)
    began = perf_counter()
    simulations = Simulations([*half, *half], Path(), nthread=THREADS)
    setup_s = perf_counter() - began
    plant, steps = simulations.plant, half[0].steps_per_period
    assert isinstance(plant, ContactPlant)
    commands = simulations.run(drawable=False).rows.wheel_command_rad_s[:-1]
    control = np.repeat(np.swapaxes(commands, 0, 1), steps, axis=1)
    pairs = []
    with Rollout(nthread=THREADS) as pool:
        roll_out = open_loop(plant, control, pool)
        for _ in range(sizes.rounds):
            opened = timed(roll_out)
            closed = timed(lambda: simulations.run(drawable=False))
            pairs.append((opened, closed))
            print(f"open loop {opened.wall:.2f} s, closed loop {closed.wall:.2f} s", flush=True)
    total = control.shape[0] * control.shape[1]
    return {
        "simulations": sizes.simulations,
        "steps_each": control.shape[1],
        "ratio": median(o.wall / c.wall for o, c in pairs),
        "cpu_ratio": median(o.cpu / c.cpu for o, c in pairs),
        "open_loop_steps_s": median(total / o.wall for o, _ in pairs),
        "closed_loop_steps_s": median(total / c.wall for _, c in pairs),
        "setup_ms_per_parameter_set": 1e3 * setup_s / len(half),
    }


def open_loop(plant: ContactPlant, control: FloatArray, pool: Rollout) -> Callable[[], object]:
    """What rolls out all simulations, at rest in their contacts, under inputs (nsim, n, 2)."""
    models, qpos = plant.models, plant.joint_positions()
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
    data = [mujoco.MjData(models[0]) for _ in range(THREADS)]
    state = np.zeros((len(models), mujoco.mj_stateSize(models[0], spec)))
    for model, row, posture in zip(models, state, qpos, strict=True):
        standing = mujoco.MjData(model)
        standing.qpos[:] = posture
        mujoco.mj_getState(model, standing, row, spec)
    shape = (len(models), control.shape[1])
    out = np.zeros((*shape, state.shape[1])), np.zeros((*shape, models[0].nsensordata))
    return lambda: pool.rollout(models, data, state, control, state=out[0], sensordata=out[1])


def summed_up(scenarios: Sequence[Scenario]) -> list[dict[str, object]]:
    """What is kept of runs in a batch."""
    return [
        metrics_of(result, scenario, 1.0)
        for scenario, result in zip(scenarios, run_batch(scenarios), strict=True)
    ]


def against_processes(sizes: Sizes) -> dict[str, object]:
    """Runs/s of a batch and of processes, one after the other."""
    scenarios = parameter_sets(sizes.batch, sizes.run_s)
    ratios, batches, processes = [], [], []
    for _ in range(sizes.rounds):
        batches.append(timed(lambda: summed_up(scenarios)).wall / sizes.batch)
        processes.append(
            statistics.mean(a_process_s(sizes.run_s, i) for i in range(sizes.processes))
        )
        ratios.append(processes[-1] / batches[-1])
        print(f"batch {batches[-1]:.3f} s a run, process {processes[-1]:.2f} s", flush=True)
    return {
        "simulated_s": sizes.run_s,
        "ratio": median(ratios),
        "batch_runs_s": median(1.0 / s for s in batches),
        "process_runs_s": median(1.0 / s for s in processes),
    }


def a_process_s(duration_s: float, seed: int) -> float:
    """Wall time of one `ttwmr run`."""
    changes = [f"--set={change}" for change in (f"duration_s={duration_s}", *WITHOUT)]
    with tempfile.TemporaryDirectory() as folder:
        words = ["run", "lab_circle", *changes, f"--seed={seed}", "--out", folder, "--quiet"]
        began = perf_counter()
        subprocess.run([sys.executable, "-m", "ttwmr_mj", *words], check=True)
        return perf_counter() - began


def as_runs_add_up(sizes: Sizes) -> dict[str, object]:
    """Memory and cost per finished run, few of them and many."""
    scenarios = parameter_sets(sizes.batch, sizes.short_s)
    kept = [summed_up(scenarios)]  # what loads and grows once has done so
    costs, relative, memory = [], [], [resident_bytes()]
    work = yardstick()
    while len(kept) * sizes.batch < sizes.many + sizes.batch:
        before = timed(work).cpu
        costs.append(timed(lambda: kept.append(summed_up(scenarios))).cpu / sizes.batch)
        relative.append(costs[-1] / (before + timed(work).cpu))
        memory.append(resident_bytes())
    few, first = sizes.few // sizes.batch, max(1, sizes.few // sizes.batch // 10)
    return {
        "runs": sizes.many,
        "memory_kb_per_run_up_to_few": (memory[few] - memory[0]) / 1e3 / sizes.few,
        "memory_kb_per_run_from_few_on": (memory[-1] - memory[few])
        / 1e3
        / (sizes.many - sizes.few),
        "cpu_ms_per_run_first": 1e3 * median(costs[:first]),
        "cpu_ms_per_run_few": 1e3 * median(costs[:few]),
        "cpu_ms_per_run_last": 1e3 * median(costs[-few:]),
        "few_over_first": median(relative[:few]) / median(relative[:first]),
        "last_over_few": median(relative[-few:]) / median(relative[:few]),
    }


def yardstick() -> Callable[[], object]:
    """Work that is always the same, half of it physics: how fast the machine is just now."""
    model = mujoco.MjModel.from_xml_path(str(models_folder() / "ttwmr.xml"))
    data = mujoco.MjData(model)

    def work() -> None:
        mujoco.mj_resetData(model, data)
        mujoco.mj_step(model, data, nstep=2000)
        row = np.zeros(8)
        for _ in range(20_000):
            row = row + 1.0

    return work


def resident_bytes() -> int:
    """Memory of this process."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def median(values: Iterable[float]) -> float:
    """Four digits of it."""
    return float(f"{statistics.median(values):.4g}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a little of everything")
    parser.add_argument("--figure", type=Path, help="where to draw the work-precision diagram")
    parser.add_argument("--adding-up", action="store_true", help="only time and memory per run")
    given = parser.parse_args()
    sizes = QUICK if given.quick else FULL
    if given.adding_up:
        print(json.dumps({"benchmark": "sweep_throughput", "adding_up": as_runs_add_up(sizes)}))
        return
    settings = measured(quick=given.quick)
    if given.figure:
        draw(settings, given.figure)
    answer = {
        "benchmark": "sweep_throughput",
        "threads": THREADS,
        "rounds": sizes.rounds,
        "open_loop": against_open_loop(sizes),
        "processes": against_processes(sizes),
        "adding_up": as_runs_add_up(sizes),
        "work_precision": [setting.told() for setting in settings],
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
