"""`ttwmr plan`: from points to a motion of a robot, and the scenario that drives it."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Overrides, Quiet, command_line, warn
from ttwmr_mj.errors import InputError, MachineError

if TYPE_CHECKING:
    from ttwmr_mj.planning.points import Points
    from ttwmr_mj.planning.through_points import Found, Request
    from ttwmr_mj.planning.transcription import Limits
    from ttwmr_mj.robot import RobotParameters

ITERATIONS = 100  # that a plan takes, more or less


class PlanCommand(Overrides, Quiet, name="plan"):
    """Plan a motion of tractor and trailers through points, and a scenario that drives it."""

    points: Path = argument(
        "points of P: a .csv with columns x_m, y_m, or an .svg whose first line is taken"
    )
    out: Path | None = option(
        "the plan, .csv; beside it go its scenario and its picture; default: NAME_plan.csv, here",
        metavar="FILE",
    )
    force: bool = option("replace files that are there")
    closed: bool = option(
        "return to the first point and go round and round; default: from rest "
        "to rest, unless the drawn line is closed"
    )
    duration: float | None = option(
        "time of the whole way, of a round; default: what it takes", metavar="SECONDS"
    )
    scenario: str | None = option(
        "plan for the robot and floor of this scenario, and drive it there; default: Table I",
        metavar="SCENARIO",
    )
    workspace: tuple[float, ...] = option(
        "width and height that the robot stays within; default: 1.8 1.3, what the camera sees",
        metavar="M",
        several=True,
    )
    hitch_angle: float = option("largest |θ2 − θ1|, of every hitch", 115.0, metavar="DEGREES")
    scale: float = option("size of an .svg's unit", 1e-3, metavar="METRES")

    def __call__(self) -> int:
        points, (data, robot, limits), out = self._points(), self._robot(), self._out()
        request, found = self._plan(points, robot, limits)
        from ttwmr_mj.planning.deliver import deliver

        done = deliver(out, request, found, robot, limits, data, shlex.join(command_line()))
        if not self.quiet:
            _tell(request, found, limits)
        print(f"plan: {done.plan}\npicture: {done.picture}\ndrive it: ttwmr run {done.scenario}")
        return 0

    def _points(self) -> Points:
        from ttwmr_mj.planning.points import read_points

        points = read_points(self.points, self.scale)
        if not self.quiet and points.given > len(points.points_m) + 1:
            warn([f"{points.given} points are too many; {len(points.points_m)} are taken, evenly"])
        return points

    def _out(self) -> Path:
        from ttwmr_mj.planning.deliver import scenario_name

        out = self.out or Path(f"{scenario_name(self.points)}_plan.csv")
        if out.suffix != ".csv":
            raise InputError.at("--out", got=repr(str(out)), allowed="a file that ends in .csv")
        there = [str(f) for e in (".csv", ".toml", ".png") if (f := out.with_suffix(e)).exists()]
        if there and not self.force:
            problem = f"there is {', '.join(there)} already"
            raise InputError.at("--out", problem, hint="name another, or add --force")
        return out

    def _robot(self) -> tuple[dict[str, Any], RobotParameters, Limits]:
        """Data of the scenario it is driven in, the robot and the limits."""
        try:
            from ttwmr_mj.planning.limits import limits_of
        except ModuleNotFoundError as error:
            hint = "pip install 'ttwmr-mj[planning]'"
            raise MachineError(f"planning needs CasADi, which is not installed; {hint}") from error
        from ttwmr_mj.robot import RobotParameters

        if len(self.workspace) not in (0, 2) or any(not side > 0.0 for side in self.workspace):
            got = " ".join(map(str, self.workspace))
            raise InputError.at("--workspace", got=got, allowed="width and height, two lengths > 0")
        wish: dict[str, Any] = {"hitch_angle_rad": math.radians(self.hitch_angle)}
        if self.workspace:
            wish["workspace_m"] = self.workspace
        if self.scenario is None:
            if self.overrides:
                raise InputError.at("--set", "there is no --scenario whose values it could replace")
            return {}, RobotParameters(), limits_of(RobotParameters(), 0.9, **wish)
        scenario = self.load(self.scenario)
        friction = scenario.plant.contact.floor_friction
        return self._data(), scenario.robot, limits_of(scenario.robot, friction, **wish)

    def _data(self) -> dict[str, Any]:
        """The scenario's file with the user's overrides."""
        from ttwmr_mj.scenario.file import find_scenario, read_scenario, set_value

        data = read_scenario(find_scenario(str(self.scenario)))
        for override in self.overrides:
            set_value(data, override)
        return data

    def _plan(
        self, points: Points, robot: RobotParameters, limits: Limits
    ) -> tuple[Request, Found]:
        from ttwmr_mj.planning.through_points import Request, plan_through
        from ttwmr_mj.runs.progress import progress_bar

        request = Request(points.points_m, self.closed or points.closed, self.duration)
        with progress_bar("planning", ITERATIONS, "iterations", self.quiet) as progress:
            return request, plan_through(request, robot, limits, progress)


def _tell(request: Request, found: Found, limits: Limits) -> None:
    from ttwmr_mj.planning.deliver import what_limits

    how = "a round" if request.closed else "from rest to rest"
    print(f"{found.plan.time_s[-1]:.3g} s {how}, through {len(request.points_m)} points\n")
    print("what the plan uses of its limits (* what limits it):")
    print("\n".join(f"  {line}" for line in what_limits(found, limits)) + "\n")
