"""How closely laws hold a trailer outdoors, on slopes and on rolling ground.

    python benchmarks/outdoors.py [--runs 10] [--duration 8] [--law tvlqr] [--ground "slope 5°"]
        [--learn]

The scenario `outdoor_circle`: the larger robot, its trailer outside a circle of 1.5 m, contact
physics, the true state. Slopes are planes that fall towards +x, terrain has a correlation length of
0.75 m; run i starts at i/N of the circle, on terrain of seed i. The slope is believed to be zero;
with `--learn` it is estimated on line. For each law and ground the median over the runs of F's rms
over the second half, the share of runs whose verdict is "followed" with its 95 % interval, and
which other verdicts there were. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter

import numpy as np
from scipy.stats import binomtest

import ttwmr_mj as tt
from ttwmr_mj.results.metrics import score
from ttwmr_mj.runs.batch import run_batch
from ttwmr_mj.runs.experiment import Result

LAWS = ("flatness", "tvlqr", "mpc")
GROUNDS = {
    **{f"slope {d}°": f"ground={{slope_rad={math.radians(d)}}}" for d in (2, 5, 10)},
    **{f"terrain {mm} mm": f"ground.terrain.rms_height_m={mm / 1e3}" for mm in (2, 5, 10)},
}


def runs_of(law: str, ground: str, count: int, duration_s: float, *, learn: bool) -> list[Result]:
    """All runs of a law on a ground."""
    learning = ', learn=["slope"]' if learn else ""
    sets = [
        f"duration_s={duration_s}",
        f'controller={{kind="{law}"{learning}}}',
        GROUNDS[ground],
        "belief.ground.slope_rad=0.0",
    ]
    scenarios = []
    for i in range(count):
        own = [f"reference.phase_rad={math.tau * i / count}", f"seed={i}"]
        if ground.startswith("terrain"):
            own.append(f"ground.terrain.seed={i}")
        scenarios.append(tt.load_scenario("outdoor_circle", [*sets, *own]))
    return run_batch(scenarios)


def row(results: list[Result]) -> tuple[float, int, Counter[str], float, float]:
    """Median of F's error [m], followed, verdicts, share off the ground, largest tilt."""
    metrics = [score(result.trajectory, result.scenario.robot)[0] for result in results]
    errors = [one["steady_centre_of_oscillation_rmse_m"] for one in metrics]
    names = Counter(str(result.verdicts[0].name) for result in results)
    airborne = [one["airborne_share"] or 0.0 for one in metrics]
    tilt = [one["tilt_max_rad"] or 0.0 for one in metrics]
    known = [math.inf if error is None else error for error in errors]
    return float(np.median(known)), names["followed"], names, float(np.mean(airborne)), max(tilt)


def main() -> None:
    """A row for every law and ground."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--duration", type=float, default=8.0)
    parser.add_argument("--law", choices=LAWS)
    parser.add_argument("--ground", choices=list(GROUNDS))
    parser.add_argument("--learn", action="store_true")
    args = parser.parse_args()
    print("| ground | law | F [mm] | followed | of runs (95 %) | off the ground | tilt | others |")
    print("|---|---|---|---|---|---|---|---|")
    found = []
    for ground in GROUNDS:
        for law in LAWS:
            if args.law not in (None, law) or args.ground not in (None, ground):
                continue
            results = runs_of(law, ground, args.runs, args.duration, learn=args.learn)
            error_m, followed, names, airborne, tilt = row(results)
            low, high = binomtest(followed, len(results)).proportion_ci(method="wilson")
            others = ", ".join(f"{n} {name}" for name, n in names.items() if name != "followed")
            print(
                f"| {ground} | {law} | {1e3 * error_m:.1f} | {followed}/{len(results)} "
                f"| {low:.2f}–{high:.2f} | {100 * airborne:.0f} % | {tilt:.2f} rad | {others} |",
                flush=True,
            )
            found.append([ground, law, error_m, followed, len(results), dict(names)])
    print(json.dumps(found))


if __name__ == "__main__":
    main()
