"""Which bodies of a folded train touch on its circle, and on which circles it is held.

    python benchmarks/folded.py [--hitch 0.23 0.30] [--drive] [--law mpc] [--sensing camera]

First the hulls that overlap at the relative equilibrium itself, before any motion: the contacts
that MuJoCo finds with the train set on the reference at t = 0, deepest first. The trailers then lie
along one radius, whatever the circle, so that only the place of the hitches decides. With --drive
each is run, as `benchmarks/trains.py` runs trains, from 10 mm and 3° off.
"""

from __future__ import annotations

import argparse

import mujoco
import numpy as np
from trains import CASES, scenario_of

import ttwmr_mj as tt
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.results.metrics import score
from ttwmr_mj.scenario.motion import sample_reference
from ttwmr_mj.state import FloatArray

FOLDED = [name for name in CASES if name.startswith("first")]


def overlaps(scenario: tt.Scenario, q: FloatArray) -> list[dict[str, float]]:
    """Of poses q (n, 3 + trailers): pairs of the robot's geoms that touch, and how deep [m]."""
    model = build_model(scenario.robot, scenario.plant.contact)
    data, joints = mujoco.MjData(model), Joints(model)
    rows = []
    for qpos in joints.standing(np.array(model.qpos0), q):
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        found: dict[str, float] = {}
        for contact in data.contact:
            pair = sorted(model.geom(int(geom)).name for geom in contact.geom)
            if "floor" not in pair:
                name = ", ".join(pair)
                found[name] = max(-float(contact.dist), found.get(name, 0.0))
        rows.append(found)
    return rows


def first_touch(scenario: tt.Scenario, rows: tt.Trajectory) -> str:
    """When bodies first touch in a run, at its samples, and which."""
    for time_s, found in zip(rows.time_s, overlaps(scenario, rows.q[:, 0]), strict=True):
        if found:
            return f"{time_s:.2f} s: {'; '.join(found)}"
    return "never"


def main() -> None:
    """A row for every train and hitch."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hitch", type=float, nargs="+", default=[0.23, 0.26, 0.28, 0.30])
    parser.add_argument("--drive", action="store_true")
    parser.add_argument("--sensing", choices=["truth", "camera"], default="truth")
    parser.add_argument("--law", choices=["tvlqr", "mpc"], default="tvlqr")
    parser.add_argument("--duration", type=float, default=20.0, help="[s]")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--only", choices=FOLDED)
    parser.add_argument("--height", type=float, help="of the camera [m]")
    args = parser.parse_args()
    print("| train | d [m] | overlap at t = 0 | bodies touch | verdict | F, rms [mm] |")
    print("|---|---|---|---|---|---|")
    for name in FOLDED if args.only is None else [args.only]:
        sides, height_m = CASES[name]
        for hitch in args.hitch:
            height = args.height or height_m
            given = sides, height, args.sensing, args.friction, hitch, args.law, args.duration
            scenario = scenario_of(*given, more=args.set)
            reference = sample_reference(scenario)
            assert reference is not None, "scenario_of gives a circle"
            (found,) = overlaps(scenario, reference.q[0])
            deep = "; ".join(f"{pair}: {1e3 * size:.0f} mm" for pair, size in found.items())
            row = [name, f"{hitch:g}", deep or "none"]
            if args.drive:
                result = tt.simulate(scenario)
                error_m = score(result.trajectory, scenario.robot)[0][
                    "steady_centre_of_oscillation_rmse_m"
                ]
                verdict = f"{result.verdicts[0].name} after {result.trajectory.time_s[-1]:.1f} s"
                row += [first_touch(scenario, result.trajectory), verdict]
                row += ["–" if error_m is None else f"{1e3 * error_m:.3f}"]
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
