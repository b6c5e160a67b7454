"""Basin of attraction of the unstable case: circle of 0.6 m at 1 rad/s, trailer inside.

Starts on the reference but for an offset of P sideways and of the trailer's angle, on contact
physics with the fast servo; caught means that the trailer's centre of oscillation stays within
10 mm of its reference over the last fifth of 10 s. Run it as

    python benchmarks/basin_map.py [--grid N] [--out basin.png]

The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import perf_counter

import numpy as np

from ttwmr_mj.basin_figures import write_basin_figure
from ttwmr_mj.scenario_file import load_scenario
from ttwmr_mj.studies.basin import map_basin

CONTROLLERS = ("flatness", "tvlqr", "lyapunov")
REACH_M, REACH_RAD = 0.3, np.radians(90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", type=int, default=25, help="starts along each axis")
    parser.add_argument("--out", type=Path, default=Path("basin.png"))
    options = parser.parse_args()
    position = np.linspace(-REACH_M, REACH_M, options.grid)
    angle = np.linspace(-REACH_RAD, REACH_RAD, options.grid)
    basins, started = {}, perf_counter()
    for kind in CONTROLLERS:
        overrides = ["duration_s=10.0", f'controller={{kind="{kind}"}}']
        basins[kind] = map_basin(load_scenario("inverted_trailer", overrides), position, angle)
        print(
            f"{kind:10s} catches {100 * basins[kind].share:.1f} % of {position.size * angle.size}"
        )
    write_basin_figure(basins, options.out, "Trailer inside the circle: from where it is caught")
    shares = {kind: round(basin.share, 4) for kind, basin in basins.items()}
    print(
        json.dumps(
            {
                "benchmark": "basin_map",
                "grid": options.grid,
                "caught_share": shares,
                "wall_s": round(perf_counter() - started, 1),
            }
        )
    )


if __name__ == "__main__":
    main()
