"""Tables of the documents, measured in the kind world and in that of the laboratory.

    python benchmarks/worlds.py laws [--only TEXT ...] [--worlds lab] [--jobs 2]

Each cell is one run of a shipped scenario, seed 0, three times: in the kind world, with
`world = "lab"` (docs/howto/world.md), and there with a law that learns slope, rolling resistance
and friction of the hitch; only the first two where the law cannot learn. A cell says what it
measures in mm, F, P or both (rms over the second half: of the trailer's centre of oscillation and
of the point between the wheels), or P, the trailer's COM [mm] and the larger angle error [°] at
the end; "lost" and the like are said where the verdict is not "followed". The tables are in
`worlds_tables.py`. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Hashable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from worlds_tables import TABLES, Cell

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.dynamics.flatness import point_behind
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.batch import batch_key, run_batch
from ttwmr_mj.runs.experiment import Result
from ttwmr_mj.runs.judgement.judged import judged
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import wrap

Place = tuple[str, int, str]  # row, column and world
LEARN = 'controller.learn=["slope", "rolling_resistance", "dry_friction", "viscous_friction"]'
WORLDS: dict[str, tuple[str, ...]] = {
    "kind": (),
    "lab": ("world=lab",),
    "lab, learning": ("world=lab", LEARN),
}
LEARNING = ("flatness", "tvlqr", "mpc")
SAID = {
    "followed": "",
    "lost": ", lost",
    "tractor_follows_trailer_lost": ", trailer lost",
    "reference_not_feasible": ", not feasible",
    "saturated_throughout": ", saturated",
}


class Found(NamedTuple):
    """Of one run."""

    values: tuple[float, ...]
    verdict: str

    def __str__(self) -> str:
        if self.verdict in ("blind", "diverged", "failed"):
            return self.verdict
        first, *rest = (f"{value:.2g}" for value in self.values)
        brackets = f" ({', '.join(rest)})" if rest else ""
        return f"{first}{brackets}{SAID.get(self.verdict, f', {self.verdict}')}"


def scenario_of(world: str, cell: Cell | None) -> Scenario | None:
    """What a cell runs in a world; None where there is none, or its law cannot learn."""
    if cell is None:
        return None
    plain = load_scenario(cell.scenario, list(cell.sets))
    learns = plain.controller.kind in LEARNING and len(plain.robot.trailers) == 1
    if world == "lab, learning" and not learns:
        return None
    return load_scenario(cell.scenario, [*cell.sets, *WORLDS[world]])


def driven(scenarios: list[Scenario], measured: list[str]) -> list[Found]:
    """Runs that share a batch."""
    results = run_batch(scenarios, scenarios_folder(), nthread=1)
    return [found(*both) for both in zip(results, measured, strict=True)]


def found(result: Result, measured: str) -> Found:
    """The numbers of a run."""
    scenario = result.scenario
    rows, robot = judged(result.trajectory, scenario), scenario.robot
    if measured == "end":
        values = at_the_end(rows, robot.trailer.com_offset_m)
    else:
        values = steady(score(rows, robot)[0], measured)
    return Found(values, result.verdicts[0].name)


def steady(numbers: Metrics, keys: str) -> tuple[float, ...]:
    """F or P in mm, or both."""
    names = {"F": "steady_centre_of_oscillation_rmse_m", "P": "steady_tractor_rmse_m"}
    values = (numbers[names[key]] for key in keys)
    return tuple(np.nan if value is None else 1e3 * value for value in values)


def at_the_end(rows: Trajectory, com_m: float) -> tuple[float, ...]:
    """Of P and the trailer's COM [mm] and of the angles [°]."""
    q, ref_q = rows.q[-1], rows.ref_q[-1]
    trailer = point_behind(q, com_m) - point_behind(ref_q, com_m)
    off = (np.hypot(*(q - ref_q)[0, :2]), np.hypot(*trailer[0]))
    angle = np.abs(wrap(q[0, 2:] - ref_q[0, 2:])).max()
    return (*(1e3 * float(value) for value in off), float(np.degrees(angle)))


def main() -> None:
    """Run a table and print its rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--only", nargs="+", default=[""], help="rows that contain one of these")
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    table = TABLES[options.table]
    names = [name for name in table.rows if any(part in name for part in options.only)]
    rows = {name: table.rows[name] for name in names}
    heads = [f"{head}: {world}" for head in table.heads for world in options.worlds]
    asked = {
        (name, i, world): (scenario, cell.measured)
        for name, cells in rows.items()
        for i, cell in enumerate(cells)
        for world in options.worlds
        if (scenario := scenario_of(world, cell)) and cell
    }
    numbers = run_all(asked, options.jobs)
    print(f"| | {' | '.join(heads)} |\n|---|{'---|' * len(heads)}")
    for name in rows:
        places = [(name, i, world) for i in range(len(table.heads)) for world in options.worlds]
        print(f"| {name} | {' | '.join(str(numbers.get(place, '')) for place in places)} |")
    told = [{"cell": place, **one._asdict()} for place, one in numbers.items()]
    print(json.dumps({"table": options.table, "cells": told}))


def run_all(asked: dict[Place, tuple[Scenario, str]], jobs: int) -> dict[Place, Found]:
    """The numbers of each cell; each is told as soon as it is known."""
    groups = defaultdict[Hashable, list[Place]](list)
    for place, (scenario, _) in asked.items():
        groups[batch_key(scenario)].append(place)
    numbers: dict[Place, Found] = {}
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        work = {}
        for places in groups.values():
            scenarios, measured = zip(*(asked[place] for place in places), strict=True)
            work[pool.submit(driven, list(scenarios), list(measured))] = places
        for done in as_completed(work):
            numbers |= zip(work[done], done.result(), strict=True)
            for place in work[done]:
                print(*place, numbers[place], sep=": ", file=sys.stderr, flush=True)
    return numbers


if __name__ == "__main__":
    main()
