"""Pushes at every phase of the trailer's circle: which a law recovers from.

    python benchmarks/pushes.py --law tvlqr [--side outside] [--force-n 0.4] [--set KEY=VALUE]

The scenario `inverted_trailer` with the true state, on contact physics, 20 s. The trailer is pushed
along x for 0.2 s, once a run, at 6 s and i/phases of a turn later. One batch holds all phases. Each
run counts as lost in two ways: by its verdict (docs/reference/verdict.md), for which a trailer that
turned over once is lost, and at the end alone: P, the trailer's COM or θ2 beyond their `end_*`
limits in the last fifth of the time. The last line is JSON.
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


def pushed(scenario: Scenario, starts_s: FloatArray, force_n: float) -> Result:
    """The scenario, once for each start of the push (count,), in one batch."""
    force = np.tile([force_n, 0.0], (len(starts_s), 1))
    push = Push("trailer", starts_s, np.full(starts_s.shape, DURATION_S), force)
    return Experiment(scenario, nsim=len(starts_s)).run(pushes=(push,))


def lost_at_the_end(result: Result) -> BoolArray:
    """(count,) who is beyond a limit in the last part of the run, or broke off before."""
    accept, curves = result.scenario.accept, Curves.of(result.trajectory, result.scenario.robot)
    time_s = result.trajectory.time_s
    worst = np.stack(
        [
            curves.tractor_error_m / accept.end_tractor_m,
            curves.trailer_error_m / accept.end_trailer_m,
            np.abs(curves.theta_error_rad[..., 1]) / accept.end_theta2_rad,
        ]
    )[:, time_s >= (1.0 - END_SHARE) * END_S]
    broken = np.array([outcome.status != "ok" for outcome in result.outcomes])
    return np.asarray(broken | ~(worst.max(axis=(0, 1), initial=0.0) <= 1.0))


def main() -> None:
    """Run all phases and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--law", default="tvlqr")
    parser.add_argument("--side", default="inside", choices=["inside", "outside"])
    parser.add_argument("--force-n", type=float, default=0.5)
    parser.add_argument("--phases", type=int, default=24)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    args = parser.parse_args()
    law = f'controller={{kind="{args.law}"}}'
    sets = [law, f'reference.side="{args.side}"', f"duration_s={END_S}", *args.set]
    scenario = load_scenario("inverted_trailer", sets)
    starts_s = START_S + TURN_S * np.arange(args.phases) / args.phases
    result = pushed(scenario, starts_s, args.force_n)
    lost = lost_at_the_end(result)
    print("| phase | push at | lost at the end | verdict |\n|---|---|---|---|")
    for i, verdict in enumerate(result.verdicts):
        print(f"| {i} | {starts_s[i]:.2f} s | {'yes' if lost[i] else 'no'} | {verdict} |")
    by_verdict = [i for i, v in enumerate(result.verdicts) if v.name != "followed"]
    told = vars(args) | {"lost_at_the_end": np.flatnonzero(lost).tolist(), "lost": by_verdict}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
