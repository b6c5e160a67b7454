"""`ttwmr plan`: from points to a motion of a robot, and the scenario that drives it."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import NewFiles, Overrides, Quiet, command_line, warn
from ttwmr_mj.errors import Fault, InputError, MachineError, to_copy

if TYPE_CHECKING:
    from ttwmr_mj.planning.points import Points
    from ttwmr_mj.planning.request import Request
    from ttwmr_mj.planning.through_points import Found
    from ttwmr_mj.planning.transcription import Limits
    from ttwmr_mj.robot import RobotParameters

MM = 1e-3
ITERATIONS = 100  # that a plan takes, more or less


class PlanCommand(Overrides, NewFiles, Quiet, name="plan"):
    """Plan a motion of tractor and trailers through points, and a scenario that drives it."""

    points: Path = argument(
        "points of P: a .csv with columns x_m, y_m, or an .svg whose first line is taken"
    )
    out: Path | None = option(
        "the plan, .csv; beside it go its scenario and its picture; default: NAME_plan.csv, here",
        metavar="FILE",
    )
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
    scale: float = option("size of an .svg's unit", MM, metavar="METRES")

    def __call__(self) -> int:
        _need_casadi()
        out = self._out()
        numbers, changes = self._faults_of_numbers(), self._faults_of_changes()
        if faults := [*numbers, *changes, *self._faults_of_files(out)]:
            raise InputError(*faults)
        points, (data, robot, limits) = self._points(), self._robot()
        self._refuse_what_is_lost(data, rests=not (self.closed or points.closed))
        request, found = self._plan(points, robot, limits)
        from ttwmr_mj.planning.deliver import deliver

        done = deliver(out, request, found, robot, limits, data, shlex.join(command_line()))
        if not self.quiet:
            _tell(request, found, limits)
        print(
            f"plan: {done.plan}\npicture: {done.picture}\ndrive it: {to_copy('run', done.scenario)}"
        )
        return 0

    def _points(self) -> Points:
        from ttwmr_mj.planning.points import read_points

        points = read_points(self.points, self.scale)
        if not self.quiet and points.given > len(points.points_m) + 1:
            warn([f"{points.given} points are too many; {len(points.points_m)} are taken, evenly"])
        return points

    def _out(self) -> Path:
        from ttwmr_mj.planning.deliver import scenario_name

        return self.out or Path(f"{scenario_name(self.points)}_plan.csv")

    def _faults_of_numbers(self) -> list[Fault]:
        """Options whose numbers make no sense."""
        from ttwmr_mj.planning.limits import DURATIONS_S, HITCH_ANGLES_DEG, SCALES_M, SIDES_M

        duration = [] if self.duration is None else [self.duration]
        given = {
            "--duration": (duration, DURATIONS_S, "s"),
            "--hitch-angle": ([self.hitch_angle], HITCH_ANGLES_DEG, "degrees"),
            "--scale": ([self.scale], SCALES_M, "m"),
            "--workspace": (self.workspace, SIDES_M, "m"),
        }
        faults = []
        for name, (values, (least, most), unit) in given.items():
            two = name == "--workspace" and len(values) not in (0, 2)
            if two or not all(least <= value <= most for value in values):
                allowed = f"{least:g} to {most:g} {unit}"
                if name == "--workspace":
                    allowed = f"width and height, each {allowed}"
                got = " ".join(f"{value:g}" for value in values)
                faults.append(Fault(key=(name,), got=got, allowed=allowed))
        told = any(fault.key == ("--scale",) for fault in faults)
        if self.scale != MM and self.points.suffix.lower() != ".svg" and not told:
            problem = f"{self.points} is no .svg; a table is in metres"
            faults.append(Fault(key=("--scale",), problem=problem))
        return faults

    def _faults_of_changes(self) -> list[Fault]:
        """Options that change a scenario where there is none."""
        if self.scenario is not None:
            return []
        problem = "there is no --scenario whose values it could replace"
        seed = self.seed is not None
        given = {"--set": self.overrides, "--fragment": self.fragments, "--seed": seed}
        return [Fault(key=(name,), problem=problem) for name, value in given.items() if value]

    def _faults_of_files(self, out: Path) -> list[Fault]:
        """What stands in the way of writing the plan and what belongs to it."""
        from ttwmr_mj.files import is_file

        key = ("--out",)
        if out.suffix != ".csv":
            return [Fault(key=key, got=repr(str(out)), allowed="a file that ends in .csv")]
        if not out.parent.is_dir():
            problem, hint = f"there is no folder {out.parent}", "make it first"
            return [Fault(key=key, problem=problem, hint=hint)]
        files = [out.with_suffix(suffix) for suffix in (".csv", ".toml", ".png")]
        there = [file for file in files if file.exists()]
        named = [self.points, *self.fragments, Path(self.scenario or "")]
        sources = [source for source in named if is_file(source)]
        if lost := [str(f) for f in there if any(f.samefile(source) for source in sources)]:
            problem = f"it would replace {', '.join(lost)}, which it is made from"
            return [Fault(key=key, problem=problem, hint="name another")]
        return self.in_the_way("--out", *there)

    def _robot(self) -> tuple[dict[str, Any], RobotParameters, Limits]:
        """Data of the scenario it is driven in, the robot that is believed in, and the limits."""
        from ttwmr_mj.planning.deliver import located, replaced
        from ttwmr_mj.planning.limits import limits_of
        from ttwmr_mj.robot import RobotParameters
        from ttwmr_mj.scenario.file import check_scenario, find_scenario

        wish: dict[str, Any] = {"hitch_angle_rad": math.radians(self.hitch_angle)}
        if self.workspace:
            wish["workspace_m"] = self.workspace
        if self.scenario is None:
            return {}, RobotParameters(), limits_of(RobotParameters(), 0.9, **wish)
        file = find_scenario(self.scenario)
        data = self._data(file)
        scenario = check_scenario(data | replaced(data), str(file), file.parent)
        friction = scenario.plant.contact.floor_friction
        data = located(data, scenario.model_dump())
        robot = scenario.believed_robot
        return data, robot, limits_of(robot, friction, **wish)

    def _refuse_what_is_lost(self, data: dict[str, Any], *, rests: bool) -> None:
        """What was set on this command line is not to be lost without a word."""
        from ttwmr_mj.planning.deliver import lost
        from ttwmr_mj.scenario.file import paths_set, read_scenario

        chosen = {f"--set {o}": {next(paths_set(o)).partition(".")[0]: o} for o in self.overrides}
        chosen |= {f"--fragment {file}": read_scenario(file) for file in self.fragments}
        faults = [
            Fault(key=(where,), problem=f"the plan replaces {key}", hint=hint)
            for where, tables in chosen.items()
            for key, hint in lost(tables, data, rests=rests)
        ]
        if faults:
            raise InputError(*faults)

    def _data(self, file: Path) -> dict[str, Any]:
        """The scenario's file with the user's fragments, overrides and seed.

        What the scenario accepts is of its own motion; what the user sets is of the plan.
        """
        from ttwmr_mj.scenario.file import read_scenario, set_value, with_fragment

        data = {key: value for key, value in read_scenario(file).items() if key != "accept"}
        for fragment in self.fragments:
            data = with_fragment(data, fragment)
        for override in self.overrides:
            set_value(data, override)
        return data if self.seed is None else data | {"seed": self.seed}

    def _plan(
        self, points: Points, robot: RobotParameters, limits: Limits
    ) -> tuple[Request, Found]:
        from ttwmr_mj.planning.request import Request
        from ttwmr_mj.planning.through_points import plan_through
        from ttwmr_mj.runs.process.progress import progress_bar

        request = Request(points.points_m, self.closed or points.closed, self.duration)
        if faults := request.faults(robot, limits):
            raise InputError(*faults, file=str(self.points))
        with progress_bar("planning", ITERATIONS, "iterations", self.quiet) as progress:
            return request, plan_through(request, robot, limits, progress)


def _need_casadi() -> None:
    """Raises MachineError where it is not installed."""
    try:
        import casadi  # noqa: F401
    except ModuleNotFoundError as error:
        hint = "pip install 'ttwmr-mj[planning]'"
        raise MachineError(f"planning needs CasADi, which is not installed; {hint}") from error


def _tell(request: Request, found: Found, limits: Limits) -> None:
    from ttwmr_mj.planning.deliver import what_limits

    how = "a round" if request.closed else "from rest to rest"
    print(f"{found.plan.time_s[-1]:.3g} s {how}, through {len(request.points_m)} points\n")
    print("what the plan uses of its limits (* what limits it):")
    print("\n".join(f"  {line}" for line in what_limits(found, limits)) + "\n")
