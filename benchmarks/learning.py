"""What learning on line is worth where the robot is told nothing of the world.

    python benchmarks/learning.py [--only dry] [--law tvlqr] [--world lab]

The trailer inside the circle of `inverted_trailer`, contact physics, true states, 20 s. Each world
differs from what is believed in one thing (with `--world lab` in what the laboratory differs in,
too), and is driven without `learn`, with the one thing to learn, and with everything. Errors are
rms over the second half: of the trailer's centre of oscillation F, and of P in brackets, in mm.
The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from typing import get_args

from ttwmr_mj.controllers.shared.estimation.learning import Learnable
from ttwmr_mj.results.metrics import score
from ttwmr_mj.runs.batch import run_batch
from ttwmr_mj.runs.experiment import Result
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario

LAWS = ("flatness", "tvlqr", "mpc")
EVERYTHING = get_args(Learnable)
FRAME_S = 0.033


def slope(degrees: float) -> tuple[str, list[str]]:
    """A floor that slopes and is believed to be level."""
    tilted = f"ground.slope_rad={degrees * 0.017453292519943295}"
    return "slope", [tilted, "belief.ground.slope_rad=0.0"]


def unknown(learnable: str, key: str, value: float) -> tuple[str, list[str]]:
    """A number of the robot that is believed to be zero."""
    return learnable, [f"robot.{key}={value}", f"belief.robot.{key}=0.0"]


def late(frames: int) -> tuple[str, list[str]]:
    """Measurements that are older than told."""
    return "latency", [f"sensing.latency_s={FRAME_S * frames}", "belief.latency_s=0.0"]


WORLDS = {
    "slope 0.1°": slope(0.1),
    "slope 0.5°": slope(0.5),
    "slope 2°": slope(2.0),
    "rolling resistance 1e-4 m": unknown(
        "rolling_resistance", "casters.rolling_resistance_m", 1e-4
    ),
    "dry friction 1e-3 N·m": unknown("dry_friction", "hitch.coulomb_friction_n_m", 1e-3),
    "dry friction 3e-3 N·m": unknown("dry_friction", "hitch.coulomb_friction_n_m", 3e-3),
    "latency of one frame": late(1),
    "latency of two frames": late(2),
}


def scenario_of(law: str, unknown: list[str], learn: tuple[str, ...], preset: str) -> Scenario:
    """One run; of the laboratory's latency, one frame, the law is told."""
    names = ", ".join(f'"{name}"' for name in learn)
    controller = f'controller={{kind="{law}", learn=[{names}]}}'
    settings = [controller, "duration_s=20", f"world={preset}", *unknown]
    scenario = load_scenario("inverted_trailer", settings)
    if preset == "lab" and scenario.belief.latency_s == 0.0:
        one = f"sensing.latency_s={scenario.sensing.latency_s + FRAME_S}"
        return load_scenario("inverted_trailer", [*settings, one, f"belief.latency_s={FRAME_S}"])
    return scenario


def numbers_of(result: Result) -> dict[str, float | str | None]:
    """F and P [m] of one run, and its verdict."""
    (numbers,) = score(result.trajectory, result.scenario.robot)
    return {
        "f_m": numbers["steady_centre_of_oscillation_rmse_m"],
        "p_m": numbers["steady_tractor_rmse_m"],
        "verdict": result.verdicts[0].name,
    }


def cell(run: dict[str, float | str | None]) -> str:
    """In mm, to two digits."""
    f, p = run["f_m"], run["p_m"]
    if not isinstance(f, float) or not isinstance(p, float) or f > 0.1:
        return "lost"
    return f"{1e3 * f:.2g} ({1e3 * p:.2g})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="worlds whose name contains this")
    parser.add_argument("--law", choices=LAWS, help="one law")
    parser.add_argument(
        "--world", default="kind", choices=("kind", "lab"), help="what else there is"
    )
    options = parser.parse_args()
    laws = [options.law] if options.law else LAWS
    rows = [
        (name, words, world, learn)
        for name, (thing, world) in WORLDS.items()
        if options.only in name
        for words, learn in (("nothing", ()), ("it", (thing,)), ("everything", EVERYTHING))
    ]
    asked = [
        scenario_of(law, world, learn, options.world) for *_, world, learn in rows for law in laws
    ]
    found = iter(map(numbers_of, run_batch(asked)))
    print(f"| F (P) [mm] | learn | {' | '.join(laws)} |\n|---|---|{'---|' * len(laws)}")
    runs = []
    for name, words, *_ in rows:
        row = {law: next(found) for law in laws}
        runs += [{"world": name, "learn": words, "law": law, **run} for law, run in row.items()]
        print(f"| {name} | {words} | {' | '.join(map(cell, row.values()))} |")
    print(json.dumps(runs))


if __name__ == "__main__":
    main()
