"""Make the shipped plans again: `python -m ttwmr_mj.planning [NAME ...] [--out DIR]`."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ttwmr_mj.planning.figure_eight import plan_figure_eight
from ttwmr_mj.planning.knots import write_knots
from ttwmr_mj.planning.limits import limits_of
from ttwmr_mj.planning.request import Request
from ttwmr_mj.planning.rest_to_rest import plan_rest_to_rest
from ttwmr_mj.planning.through_points import plan_through
from ttwmr_mj.planning.transcription import Limits, Plan
from ttwmr_mj.robot import Hitch, RobotParameters, Trailer

ROBOT = RobotParameters()
# Shares of the servo presets' limits, so that feedback has the rest: of the fast one's 40 rad/s and
# 100 rad/s², and of the lab one's 6.5 rad/s and 50 rad/s².
FAST = Limits(wheel_speed_rad_s=25.0, wheel_acceleration_rad_s2=30.0)
FAST_MOVING = Limits(wheel_speed_rad_s=25.0, wheel_acceleration_rad_s2=30.0, speed_m_s=(0.08, 1.0))
LAB = Limits(wheel_speed_rad_s=5.2, wheel_acceleration_rad_s2=15.0)
LAB_MOVING = Limits(wheel_speed_rad_s=5.2, wheel_acceleration_rad_s2=15.0, speed_m_s=(0.03, 1.0))
START, ASIDE, CORNER = (-0.4, -0.2, 0.0), (0.4, 0.2, 0.0), (0.35, 0.2, 0.5 * np.pi)

COURSE = ((0.45, 0.0), (0.3, 0.35), (-0.1, 0.2), (-0.45, 0.3), (-0.4, -0.25), (0.15, -0.35))
DAMPED = RobotParameters(hitch=Hitch(damping_n_m_s_rad=1e-3))  # as scenarios/waypoints.toml has it
TRAILERS = (Trailer(next_hitch_offset_m=0.23), Trailer())
TWO = RobotParameters(trailers=TRAILERS, hitches=(Hitch(), Hitch()))
ROOM_M, BEDS_RAD = (2.4, 1.8), 1.4  # of two trailers: space, and hitch angles
FAST_TWO = replace(FAST, workspace_m=ROOM_M, hitch_angle_rad=BEDS_RAD)
FAST_MOVING_TWO = replace(FAST_MOVING, workspace_m=ROOM_M, hitch_angle_rad=BEDS_RAD)
WEST, EAST, BACK = (-0.5, -0.2, 0.0), (0.6, 0.2, 0.0), (-0.5, 0.3, np.pi)

PLANS: dict[str, Callable[[], Plan]] = {
    "figure_eight": lambda: plan_figure_eight(ROBOT, FAST_MOVING, 12.0),
    "figure_eight_lab": lambda: plan_figure_eight(ROBOT, LAB_MOVING, 30.0),
    "rest_to_rest": lambda: plan_rest_to_rest(ROBOT, FAST, START, ASIDE, 6.0, 0.1),
    "rest_to_rest_lab": lambda: plan_rest_to_rest(ROBOT, LAB, START, ASIDE, 12.0, 0.05),
    "waypoints_lab": lambda: (
        plan_through(Request(np.array(COURSE), closed=True), DAMPED, limits_of(DAMPED, 0.9)).plan
    ),
    "quarter_turn": lambda: plan_rest_to_rest(ROBOT, FAST, START, CORNER, 6.0, 0.1),
}
DOUBLE: dict[str, Callable[[], Plan]] = {
    "double_eight": lambda: plan_figure_eight(TWO, FAST_MOVING_TWO, 16.0),
    "double_rest_to_rest": lambda: plan_rest_to_rest(TWO, FAST_TWO, WEST, EAST, 8.0, 0.1),
    "double_u_turn": lambda: plan_rest_to_rest(TWO, FAST_TWO, WEST, BACK, 12.0, 0.1),
}


def main() -> None:
    """Solve and write."""
    known = PLANS | DOUBLE
    parser = argparse.ArgumentParser(prog="python -m ttwmr_mj.planning", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"any of {', '.join(known)}; default: all")
    shipped = Path(__file__).parents[1] / "references" / "data"
    parser.add_argument("--out", type=Path, default=shipped, help="folder for the plans")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.names if name not in known]
    if unknown:
        parser.error(f"no plan called {', '.join(unknown)}; there are {', '.join(known)}")
    for name in arguments.names or known:
        plan = known[name]()
        path = arguments.out / f"{name}.csv"
        robot = TWO if name in DOUBLE else ROBOT
        write_knots(path, plan, robot, f"python -m ttwmr_mj.planning {name}")
        print(f"{path}: {plan.time_s.size} knots, {plan.iterations} iterations")


if __name__ == "__main__":
    main()
