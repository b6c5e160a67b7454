"""Largest latency that each law bears without being told: computed, and measured.

    python benchmarks/margins.py [--only LAW ...] [--part computed|near|shipped] [--world lab]

Computed: the sampled loop on the analytic plant, linearised at its fixed point in the frame that
turns with the circle (`turning_loop`); the largest latency with every eigenvalue inside the unit
circle, of commands to STEP_MS, of measurements in whole control periods. Measured on contact
physics: the largest with the verdict "followed", from a start 10 mm off the reference and from the
shipped one, and the largest from there that is not lost: P stays within 0.35 m, the trailer's COM
too, and θ2 within 1.5 rad. Worlds other than the kind one have noise, so nothing is computed there.
The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from turning_loop import NO_RAMPS, moduli, needed_s

from ttwmr_mj.results.accept import AcceptOptions
from ttwmr_mj.results.verdict import judge
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario

PERIOD_MS = 33.0
STEP_MS = 0.5  # a physics step
LOOP_MS = 1.0  # of the motor's firmware, in worlds that have one
MARCH_MS = 16.0  # latencies are tried so far apart until one is too long, then halved
SETTLE_S = 25.0  # poles of 0.985 fade to 1e-5
LARGEST_MS = 330.0
NEAR = 'initial={kind="on_reference", x_offset_m=0.01}'
Row = tuple[float | None, ...]
NOT_LOST = AcceptOptions(end_tractor_m=0.35, end_trailer_m=0.35, end_theta2_rad=1.5)


@dataclass(frozen=True, slots=True)
class Case:
    """A law on a circle."""

    name: str
    scenario: str
    controller: str
    trailer: bool = True  # steered
    learns: bool = False  # what cannot be linearised

    def overrides(self, command_ms: float, periods: int) -> list[str]:
        """For a latency that is not told."""
        return [
            f"controller={self.controller}",
            f"control.command_latency_s={command_ms / 1e3:.4f}",
            f"sensing.latency_s={periods * PERIOD_MS / 1e3:.3f}",
            "belief.command_latency_s=0",
            "belief.latency_s=0",
        ]


def cases() -> list[Case]:
    """Laws that do not steer the trailer on the article's circle, the others on both of theirs."""
    repaired = 'gamma="regularized", gamma_limit=10.0, anti_windup="conditional"'
    tractor = {
        "lyapunov": 'kind="lyapunov"',
        "lyapunov, α1 and α3 doubled": 'kind="lyapunov", alpha1=50.0, alpha3=50.0',
        "lyapunov_pid, repaired": f'kind="lyapunov_pid", {repaired}',
        "pure_pursuit": 'kind="pure_pursuit"',
    }
    found = [Case(name, "lab_circle", f"{{{law}}}", False) for name, law in tractor.items()]
    for circle in ("outer_circle", "inverted_trailer"):
        for kind in ("flatness", "tvlqr", "mpc"):
            own = "" if kind == "mpc" else ', recovery="own"'  # the law itself is measured
            found.append(Case(kind, circle, f'{{kind="{kind}"{own}}}'))
            learning = f'{{kind="{kind}", learn=["latency"]{own}}}'
            found.append(Case(f"{kind}, learning", circle, learning, learns=True))
    return found


def largest(borne: Callable[[float], bool], step: float, march: float, highest: float) -> float:
    """The largest multiple of a step up to which all that is tried is borne; −1: not even none."""
    if not borne(0.0):
        return -1.0
    low, high = 0.0, march
    while high <= highest and borne(high):
        low, high = high, high + march
    if high > highest:
        return low
    while high - low > 1.5 * step:
        middle = step * round(0.5 * (low + high) / step)
        low, high = (middle, high) if borne(middle) else (low, middle)
    return low


def modulus(case: Case, command_ms: float, periods: int) -> float:
    """The largest of the linearised loop, per period."""
    overrides = [
        *case.overrides(command_ms, periods),
        "plant.kind=analytic",
        'initial={kind="on_reference"}',
        f"duration_s={needed_s(SETTLE_S, PERIOD_MS / 1e3):.1f}",
        NO_RAMPS,
    ]
    with np.errstate(all="ignore"):  # beyond the margin
        found = moduli(load_scenario(case.scenario, overrides), SETTLE_S, trailer=case.trailer)
    return float(found[0])


def judged(
    case: Case, command_ms: float, periods: int, *, near: bool, world: str
) -> tuple[bool, bool]:
    """Whether a run on contact physics followed, and whether it was not lost."""
    given = [f"world={world}", *([NEAR] if near else [])]
    overrides = [*given, *case.overrides(command_ms, periods)]
    scenario = load_scenario(case.scenario, overrides)
    result = Experiment(scenario).run()
    (verdict,), (end,) = result.verdicts, result.outcomes
    loose = judge(
        result.trajectory,
        scenario.robot,
        status=end.status,
        accept=NOT_LOST,
        demands=result.demands,
    )
    return verdict.name == "followed", loose.name == "followed"


def computed_margins(case: Case) -> Row:
    """Of commands [ms] and of measurements [periods]."""
    command = largest(lambda ms: modulus(case, ms, 0) < 1.0, STEP_MS, MARCH_MS, LARGEST_MS)
    most = LARGEST_MS / PERIOD_MS
    return command, largest(lambda n: modulus(case, 0.0, round(n)) < 1.0, 1.0, 1.0, most)


def measured_margins(case: Case, *, near: bool, world: str) -> tuple[Row, Row]:
    """Of commands [ms] and of measurements [periods]: followed and, from afar, not lost."""
    run = cache(lambda ms, n: judged(case, ms, n, near=near, world=world))
    most, asked = LARGEST_MS / PERIOD_MS, (0,) if near else (0, 1)

    def command(which: int) -> float:
        step_ms = STEP_MS if world == "kind" else LOOP_MS
        return largest(lambda ms: run(ms, 0)[which], step_ms, MARCH_MS, LARGEST_MS)

    def measurement(which: int) -> float:
        return largest(lambda n: run(0.0, round(n))[which], 1.0, 1.0, most)

    return tuple(command(which) for which in asked), tuple(measurement(which) for which in asked)


def margins(case: Case, part: str | None, world: str) -> Row:
    """Of commands: computed, followed from near, followed, not lost; the same of measurements."""
    computed: Row = (None, None)
    near: tuple[Row, Row] = ((None,), (None,))
    shipped: tuple[Row, Row] = ((None, None), (None, None))
    if part in (None, "computed") and not case.learns and world == "kind":
        computed = computed_margins(case)
    if part in (None, "near"):
        near = measured_margins(case, near=True, world=world)
    if part in (None, "shipped"):
        shipped = measured_margins(case, near=False, world=world)
    return computed[0], *near[0], *shipped[0], computed[1], *near[1], *shipped[1]


def row(case: Case, values: Row) -> str:
    """Of the table."""
    cells = ("–" if v is None else "none" if v < 0 else f"{v:g}" for v in values)
    return f"| {case.name} | {case.scenario} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", help="names of laws, or of scenarios")
    parser.add_argument("--part", choices=("computed", "near", "shipped"), help="only this")
    parser.add_argument("--world", choices=("kind", "lab", "unkind"), default="kind")
    options = parser.parse_args()
    kinds = ("computed", "near", "shipped", "not lost")
    heads = [f"{late}, {kind}" for late in ("commands", "measurements") for kind in kinds]
    print(f"| law | circle | {' | '.join(heads)} |\n{'|---' * 10}|")
    report = []
    for case in cases():
        if options.only and not {case.name, case.scenario} & set(options.only):
            continue
        values = margins(case, options.part, options.world)
        print(row(case, values), flush=True)
        report.append({"law": case.name, "scenario": case.scenario, "values": values})
    print(json.dumps({"margins": report}))


if __name__ == "__main__":
    main()
