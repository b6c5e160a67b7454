"""Basins of attraction of the unstable cases: P on a circle of 0.6 m at 1 rad/s, trailers inside.

Starts on the reference but for two offsets, on contact physics with the fast servo; caught means
that the last trailer's centre of oscillation stays within 10 mm of its reference over the last
fifth of 10 s. One trailer: P to the left, towards the circle's centre, and the trailer's angle; the
laws are on their own (`flatness` and `tvlqr` hand nothing over). Trains: P to the left and the
whole train turned about P, then the angles of the first and of the last trailer. Run it as

    python benchmarks/basin_map.py [--scenario double_inverted] [--cells N]
        [--only CONTROLLER ...] [--out basin.png] [--set KEY=VALUE]

`--cells` is 8, 16, 32, ...: every start of a grid of 8 by 8 cells is simulated, then those of finer
grids where the basin's edge is. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np
from basin import THETA2, TO_THE_LEFT, Direction, map_basin
from basin_figures import Panel, write_basin_figure

from ttwmr_mj.scenario.file import load_scenario

COARSE_CELLS = 8
ALONE = ', recovery="own"'


class Slice(NamedTuple):
    """A plane of starts."""

    directions: tuple[Direction, Direction]
    reach: tuple[float, float]  # to either side [m] or [rad]
    labels: tuple[str, str]
    start: tuple[float, float] | None = None  # of the shipped scenario [mm, °]


class Case(NamedTuple):
    """A scenario, the laws that are tried on it, and the planes of starts."""

    title: str
    laws: dict[str, str]  # kind → its options
    slices: tuple[Slice, ...]


def _train(count: int) -> tuple[Slice, ...]:
    last, bent = (*[0.0] * (count - 1), 1.0), np.radians(16)
    return (
        Slice(
            (TO_THE_LEFT, Direction(turned=(1.0,) * count)),
            (0.2, bent),
            ("P off to the left [mm]", "train turned [°]"),
        ),
        Slice(
            (THETA2, Direction(turned=last)), (bent, bent), ("θ2 off [°]", f"θ{count + 1} off [°]")
        ),
    )


CASES = {
    "inverted_trailer": Case(
        "Trailer inside the circle: from where it is caught   (○ start of the shipped scenario)",
        {"mpc": "", "flatness": ALONE, "tvlqr": ALONE, "lyapunov": ""},
        (
            Slice(
                (TO_THE_LEFT, THETA2),
                (0.3, np.radians(60)),
                ("P off to the left [mm]", "θ2 off [°]"),
                (-50.0, np.degrees(0.2)),
            ),
        ),
    ),
    "double_inverted": Case(
        "Two trailers inside the circle: from where they are caught",
        {"tvlqr": "", "mpc": ""},
        _train(2),
    ),
    "triple_inverted": Case(
        "Three trailers inside the circle: from where they are caught",
        {"tvlqr": "", "mpc": ""},
        _train(3),
    ),
}


def main() -> None:
    """Map and draw the basins."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", choices=CASES, default="inverted_trailer")
    parser.add_argument("--cells", type=int, default=32, help="along each axis, 8 times 2ⁿ")
    parser.add_argument("--only", nargs="+", help="kinds of controllers")
    parser.add_argument("--out", type=Path, default=Path("basin.png"))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    case = CASES[options.scenario]
    panels, told = [], []
    for kind in options.only or case.laws:
        law = f'controller={{kind="{kind}"{case.laws[kind]}}}'
        scenario = load_scenario(options.scenario, ["duration_s=10.0", law, *options.set])
        for plane in case.slices:
            started = process_time()
            axes = [np.linspace(-reach, reach, options.cells + 1) for reach in plane.reach]
            stride = options.cells // COARSE_CELLS
            basin = map_basin(scenario, axes[0], axes[1], stride, plane.directions)
            cpu_s = round(process_time() - started, 1)
            panels.append(Panel(kind, basin, plane.labels, plane.start))
            row = {"law": kind, "plane": plane.labels, "caught_share": round(basin.share, 4)}
            told.append(row | {"simulated": int(basin.simulated.sum()), "cpu_s": cpu_s})
            print(told[-1], flush=True)
            write_basin_figure(panels, options.out, case.title)
    asked = {"scenario": options.scenario, "cells": options.cells, "set": options.set}
    print(json.dumps({"benchmark": "basin_map", **asked, "basins": told}))


if __name__ == "__main__":
    main()
