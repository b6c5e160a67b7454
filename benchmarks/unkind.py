"""How laws fare in the unkind world: a draw of it for each seed (docs/world.md, "Worlds").

    python benchmarks/unkind.py --law tvlqr --seeds 200 [--first 10000] [--scenario NAME]
        [--no-learning] [--set KEY=VALUE]

Each run is `inverted_trailer_camera` for 20 s, in a world of its own, with a law that learns. Of
all runs: the share that followed, with its exact binomial interval at 95 %, and quantiles of F, the
rms distance of the trailer's centre of oscillation from its reference over the second half, in the
camera's frame. Runs that did not follow are listed with what decided. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.results.metrics import score
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.judged import judged
from ttwmr_mj.scenario.file import load_scenario

FORCES = ["slope", "rolling_resistance", "dry_friction", "viscous_friction"]
STEERING = ("flatness", "tvlqr", "mpc")
METRIC = "steady_centre_of_oscillation_rmse_m"


class Row(NamedTuple):
    """One run."""

    seed: int
    verdict: str
    sentence: str
    centre_m: float  # F; infinite where undefined


def overrides(law: str, camera: bool, learns: bool) -> list[str]:
    """What a scenario is changed by, but for its seed."""
    learn = FORCES if camera else [*FORCES, "latency"]
    named = f"controller.kind={law}" if law not in STEERING or not learns else ""
    options = named or f"controller={{kind={json.dumps(law)}, learn={json.dumps(learn)}}}"
    found = f"sensing.tracker.learn_latency={str(learns).lower()}"
    return ["world=unkind", "duration_s=20.0", options, *([found] if camera else [])]


def run(seed: int, name: str, sets: list[str]) -> Row:
    """The run of one seed."""
    scenario = load_scenario(name, [*sets, f"seed={seed}"])
    result = Experiment(scenario, shipped_scenarios()[name].parent).run()
    (verdict,) = result.verdicts
    (numbers,) = score(judged(result.trajectory, scenario), scenario.robot)
    centre = numbers[METRIC]
    return Row(seed, verdict.name, str(verdict), np.inf if centre is None else centre)


def table(rows: list[Row]) -> dict[str, Any]:
    """The numbers of all runs."""
    followed = sum(row.verdict == "followed" for row in rows)
    interval = binomtest(followed, len(rows)).proportion_ci()
    centre = np.array([row.centre_m for row in rows])
    quantiles = np.quantile(1e3 * centre, [0.5, 0.9], method="inverted_cdf").tolist()
    return {
        "runs": len(rows),
        "followed": followed,
        "share": followed / len(rows),
        "share_interval": [interval.low, interval.high],
        "centre_median_mm": quantiles[0],
        "centre_90_percent_mm": quantiles[1],
    }


def lines(rows: list[Row]) -> Iterator[str]:
    """Runs that did not follow."""
    for row in rows:
        if row.verdict != "followed":
            yield f"seed {row.seed}: {row.sentence}"


def main() -> None:
    """Run all seeds and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--law", default="tvlqr")
    parser.add_argument("--scenario", default="inverted_trailer_camera")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=10_000)
    parser.add_argument("--no-learning", action="store_true")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    given = parser.parse_args()
    camera = load_scenario(given.scenario).sensing.kind == "camera"
    sets = [*overrides(given.law, camera, not given.no_learning), *given.set]
    seeds = range(given.first, given.first + given.seeds)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        rows = list(pool.map(partial(run, name=given.scenario, sets=sets), seeds))
    print(*lines(rows), sep="\n")
    print(json.dumps({"law": given.law, "scenario": given.scenario, "sets": sets} | table(rows)))


if __name__ == "__main__":
    main()
