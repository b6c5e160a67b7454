"""How closely trains are held on their circles: by truth, by camera, with hitch friction.

    python benchmarks/trains.py [--only "two inside"] [--sensing camera] [--friction 0.3e-3]
                                [--law mpc] [--believed 1.0] [--duration 12]

P on 0.6 m at 1 rad/s, Table I's trailers with d = 0.23 m, `tvlqr` or `mpc`, contact physics, 33 ms,
started 10 mm and 3° off, 20 s; the camera is the laboratory's, hung as high as it must to see the
train. Dry friction in every hitch is believed to be 30 % less than it is. Errors are
`steady_centre_of_oscillation_rmse_m` of the last trailer [mm]. The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence

import ttwmr_mj as tt
from ttwmr_mj.results.metrics import score

CASES = {
    "two outside": (("outside", "outside"), 2.9),
    "two inside": (("inside", "inside"), 1.9),
    "three inside": (("inside", "inside", "inside"), 1.9),
    "first inside, second outside": (("inside", "outside"), 1.9),
    "first outside, second inside": (("outside", "inside"), 2.3),
}
BELIEVED = 0.7  # share of the friction


def scenario_of(
    sides: tuple[str, ...],
    height_m: float,
    sensing: str,
    friction_n_m: float,
    hitch_m: float = 0.23,
    law: str = "tvlqr",
    duration_s: float = 20.0,
    believed: float = BELIEVED,
    more: Sequence[str] = (),
) -> tt.Scenario:
    """A train on its circle; believed is the share of the friction that is believed in."""
    count = len(sides)
    towing = [{"next_hitch_offset_m": hitch_m}] * (count - 1)
    tables = {
        "robot.trailers": [*towing, {}],
        "robot.hitches": [{"coulomb_friction_n_m": friction_n_m}] * count,
        "belief.robot.trailers": [*towing, {}],
        "belief.robot.hitches": [{"coulomb_friction_n_m": believed * friction_n_m}] * count,
        "reference.side": list(sides),
        "initial.more_trailers_offset_rad": [0.05, 0.0, 0.0, 0.0][: count - 1],
        "duration_s": duration_s,
        "controller.kind": law,
        "sensing": {"kind": "truth"},
    }
    if sensing == "camera":
        # calibrated before the run: a height of its own
        camera = {"height_m": height_m}
        tables["sensing"] = {"kind": "camera", "latency_s": 0.033, "camera": camera}
    sets = [f"{key}={toml(v)}" for key, v in tables.items()]
    return tt.load_scenario("double_inverted", [*sets, *more])


def toml(value: object) -> str:
    """A value as `--set` takes it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def main() -> None:
    """A row for every case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=list(CASES))
    parser.add_argument("--sensing", choices=["truth", "camera"])
    parser.add_argument("--friction", type=float)
    parser.add_argument("--law", choices=["tvlqr", "mpc"], default="tvlqr")
    parser.add_argument("--believed", type=float, default=BELIEVED, help="share of the friction")
    parser.add_argument("--duration", type=float, default=20.0, help="[s]")
    args = parser.parse_args()
    told = {"law": args.law, "duration_s": args.duration, "believed": args.believed}
    rows = []
    print("| train | sensing | hitch friction [N·m] | F, rms [mm] | verdict |")
    print("|---|---|---|---|---|")
    for name, (sides, height_m) in CASES.items():
        for sensing in ("truth", "camera"):
            for friction in (0.0, 0.3e-3):
                unwanted = args.only not in (None, name) or args.sensing not in (None, sensing)
                if unwanted or args.friction not in (None, friction):
                    continue
                result = tt.simulate(scenario_of(sides, height_m, sensing, friction, **told))
                (metrics,) = score(result.trajectory, result.scenario.robot)
                error_m = metrics["steady_centre_of_oscillation_rmse_m"]
                verdict = result.verdicts[0].name
                shown = "–" if error_m is None else f"{1e3 * error_m:.3f}"
                print(f"| {name} | {sensing} | {friction:g} | {shown} | {verdict} |", flush=True)
                rows.append([name, sensing, friction, error_m, verdict])
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
