"""Basin of attraction of the unstable case: circle of 0.6 m at 1 rad/s, trailer inside.

Starts on the reference but for an offset of P to the left, towards the circle's centre, and of the
trailer's angle, on contact physics with the fast servo; caught means that the trailer's centre of
oscillation stays within 10 mm of its reference over the last fifth of 10 s. The laws are on their
own: `flatness` and `tvlqr` hand nothing over. Run it as

    python benchmarks/basin_map.py [--cells N] [--only CONTROLLER ...] [--out basin.png]
        [--set KEY=VALUE]

`--cells` is 8, 16, 32, ...: every start of a grid of 8 by 8 cells is simulated, then those of finer
grids where the basin's edge is. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import process_time

import numpy as np
from basin import map_basin
from basin_figures import write_basin_figure

from ttwmr_mj.scenario.file import load_scenario

CONTROLLERS = {
    "mpc": "",
    "flatness": ', recovery="own"',
    "tvlqr": ', recovery="own"',
    "lyapunov": "",
}  # kind → its options
REACH_M, REACH_RAD = 0.3, np.radians(60)
COARSE_CELLS = 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=32, help="along each axis, 8 times 2ⁿ")
    parser.add_argument("--only", nargs="+", default=list(CONTROLLERS), choices=CONTROLLERS)
    parser.add_argument("--out", type=Path, default=Path("basin.png"))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    position = np.linspace(-REACH_M, REACH_M, options.cells + 1)
    angle = np.linspace(-REACH_RAD, REACH_RAD, options.cells + 1)
    basins, cpu_s = {}, {}
    for kind in options.only:
        started = process_time()
        law = f'controller={{kind="{kind}"{CONTROLLERS[kind]}}}'
        scenario = load_scenario("inverted_trailer", ["duration_s=10.0", law, *options.set])
        basin = map_basin(scenario, position, angle, options.cells // COARSE_CELLS)
        basins[kind], cpu_s[kind] = basin, round(process_time() - started, 1)
        print(
            f"{kind:10s} catches {100 * basin.share:.1f} % of {basin.caught.size} starts, "
            f"{basin.simulated.sum()} of them simulated, {cpu_s[kind]} s of CPU",
            flush=True,
        )
    write_basin_figure(basins, options.out, "Trailer inside the circle: from where it is caught")
    shares = {kind: round(basin.share, 4) for kind, basin in basins.items()}
    result = {"benchmark": "basin_map", "caught_share": shares, "cpu_s": cpu_s}
    result |= {"set": options.set}
    print(json.dumps(result | {"starts": (options.cells + 1) ** 2}))


if __name__ == "__main__":
    main()
