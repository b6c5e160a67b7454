"""Pushes at every phase of the trailer's circle: which a law recovers from.

    python benchmarks/pushes.py --law tvlqr [--side outside] [--force-n 0.4 0.5] [--set KEY=VALUE]
    python benchmarks/pushes.py --scenario double_inverted --trailer 2 --force-n 0.05 0.1

The scenario with the true state, on contact physics, 20 s. The first trailer, or another, is pushed
along x for 0.2 s, once a run, at 6 s and i/phases of a turn later. One batch holds all phases and
forces. Each run counts as lost in two ways: by its verdict (docs/reference/verdict.md), for which
a trailer that turned over once is lost, and at the end alone: P, the last trailer's COM or an angle
of a trailer beyond their `end_*` limits in the last fifth of the time. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

from ttwmr_mj.results.accept import END_SHARE
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.pushes import Push
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import BoolArray, FloatArray

START_S, DURATION_S, END_S = 6.0, 0.2, 20.0
TURN_S = 2.0 * np.pi / 1.0  # at the scenario's angular rate


def pushed(
    scenario: Scenario, starts_s: FloatArray, forces_n: FloatArray, trailer: int = 1
) -> Result:
    """The scenario, once for each start of a push (count,) and its force (count,), in one batch."""
    force = np.stack([forces_n, np.zeros_like(forces_n)], axis=-1)
    push = Push("trailer", starts_s, np.full(starts_s.shape, DURATION_S), force, trailer)
    return Experiment(scenario, nsim=len(starts_s)).run(pushes=(push,))


def lost_at_the_end(result: Result) -> BoolArray:
    """(count,) who is beyond a limit in the last part of the run, or broke off before."""
    accept, curves = result.scenario.accept, Curves.of(result.trajectory, result.scenario.robot)
    time_s = result.trajectory.time_s
    worst = np.stack(
        [
            curves.tractor_error_m / accept.end_tractor_m,
            curves.trailer_error_m / accept.end_trailer_m,
            np.abs(curves.theta_error_rad[..., 1:]).max(axis=-1) / accept.end_theta2_rad,
        ]
    )[:, time_s >= (1.0 - END_SHARE) * END_S]
    broken = np.array([outcome.status != "ok" for outcome in result.outcomes])
    return np.asarray(broken | ~(worst.max(axis=(0, 1), initial=0.0) <= 1.0))


def main() -> None:
    """Run all phases of all forces and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="inverted_trailer")
    parser.add_argument("--law", default="tvlqr")
    parser.add_argument("--side", default="inside", choices=["inside", "outside"])
    parser.add_argument("--trailer", type=int, default=1, help="which is pushed, from the front")
    parser.add_argument("--force-n", type=float, nargs="+", default=[0.5])
    parser.add_argument("--phases", type=int, default=24)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    args = parser.parse_args()
    law = f'controller={{kind="{args.law}"}}'
    sets = [law, f'reference.side="{args.side}"', f"duration_s={END_S}", *args.set]
    scenario = load_scenario(args.scenario, sets)
    phases = np.tile(np.arange(args.phases), len(args.force_n))
    starts_s = START_S + TURN_S * phases / args.phases
    forces_n = np.repeat(args.force_n, args.phases)
    result = pushed(scenario, starts_s, forces_n, args.trailer)
    lost = lost_at_the_end(result)
    by_verdict = np.array([verdict.name != "followed" for verdict in result.verdicts])
    print("| force | phase | push at | lost at the end | verdict |\n|---|---|---|---|---|")
    for i, verdict in enumerate(result.verdicts):
        told = f"{forces_n[i]:g} N | {phases[i]} | {starts_s[i]:.2f} s"
        print(f"| {told} | {'yes' if lost[i] else 'no'} | {verdict} |")
    rows = [
        {
            "force_n": force_n,
            "lost_at_the_end": phases[lost & (forces_n == force_n)].tolist(),
            "lost": phases[by_verdict & (forces_n == force_n)].tolist(),
        }
        for force_n in args.force_n
    ]
    print(json.dumps(vars(args) | {"rows": rows}))


if __name__ == "__main__":
    main()
