"""What a plan is delivered as: the table of knots, the scenario that drives it, and a picture."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ttwmr_mj.figures.plan import write_plan_figure
from ttwmr_mj.files import resolved, together, write_text
from ttwmr_mj.planning.knots import write_knots
from ttwmr_mj.planning.request import Request
from ttwmr_mj.planning.through_points import UNITS, Found
from ttwmr_mj.planning.transcription import Limits
from ttwmr_mj.references.planned import Planned
from ttwmr_mj.robot import RobotParameters

FINE_S = 0.02  # samples of the picture
ROUNDS, HOLD_S = 2, 2.0  # that the scenario drives of a closed way; stands after one with an end
STEERING = ("flatness", "mpc", "tvlqr")  # laws that follow with the trailer
CIRCLE = {"kind": "flat_circle", "radius_m": 20.0, "angular_rate_rad_s": 0.01}
PLANS_OWN = {  # of a scenario, what the plan says itself: where else to say it
    "name": "it is that of the file, --out",
    "description": "edit the scenario once it is written",
    "duration_s": "--duration is the time of the way; set that of the run with `ttwmr run --set`",
    "initial": "the robot starts on the plan; move it off with `ttwmr run --set`",
    "reference": "it is the plan; leave it out",
}
NEAR = 0.9  # share of a limit from which on it is said to be what limits the plan


@dataclass(frozen=True, slots=True)
class Delivered:
    """Files that were written."""

    plan: Path
    scenario: Path
    picture: Path


def deliver(
    out: Path,
    request: Request,
    found: Found,
    robot: RobotParameters,
    limits: Limits,
    base: Mapping[str, Any],
    command: str,
) -> Delivered:
    """Write OUT.csv, OUT.toml and OUT.png side by side.

    Args:
        out: the .csv file, in a folder that is there.
        request: what was asked for.
        found: the plan.
        robot: that it is for.
        limits: that it keeps.
        base: a scenario's data whose robot, floor and so on it is driven with; may be empty.
        command: that made it.
    """
    done = Delivered(out, out.with_suffix(".toml"), out.with_suffix(".png"))
    end = float(found.plan.time_s[-1])
    with together((done.plan, done.scenario, done.picture)):
        write_knots(out, found.plan, robot, command)
        write_text(done.scenario, _scenario(out, request, found, base))
        time_s = np.linspace(0.0, end, round(end / FINE_S) + 1)
        reference = Planned(plan=str(resolved(out))).sample(time_s, robot)
        drawn = {"wheel speed": limits.wheel_speed_rad_s, "hitch angle": limits.hitch_angle_rad}
        title = _title(out, request, end)
        write_plan_figure(done.picture, reference, robot, request.points_m, drawn, title)
    return done


def what_limits(found: Found, limits: Limits) -> list[str]:
    """Each limit's share in use, the most first; what is near one."""
    sizes = {
        "wheel speed": limits.wheel_speed_rad_s,
        "wheel acceleration": limits.wheel_acceleration_rad_s2,
        "lateral acceleration": limits.lateral_acceleration_m_s2,
        "trailer's turn rate": limits.trailer_rate_rad_s,
        "hitch angle": limits.hitch_angle_rad,
        "workspace": 0.5 * max(limits.workspace_m),
    }
    lines = []
    for group, share in sorted(found.used.items(), key=lambda item: -item[1]):
        of = "" if group == "workspace" else f" of {sizes[group]:.3g} {UNITS[group]}"
        lines.append(f"{group:21s} {100 * share:6.1f} %{of}{'  *' * (share >= NEAR)}")
    return lines


def scenario_name(out: Path) -> str:
    """A name that a scenario may have, from that of a file."""
    name = re.sub(r"[^a-z0-9_-]+", "_", out.stem.lower()).strip("_-")
    return (name or "plan")[:64]


def _title(out: Path, request: Request, end_s: float) -> str:
    count = len(request.points_m)
    how = "a closed path, one round in" if request.closed else "from rest to rest in"
    return f"{scenario_name(out)}: {count} points, {how} {end_s:.3g} s"


def replaced(
    base: Mapping[str, Any], reference: Mapping[str, Any] = CIRCLE, *, rests: bool = False
) -> dict[str, Any]:
    """The tables that a plan replaces in a scenario's data; a circle stands in for the plan.

    Of one that rests, where F does not accelerate, flatness cannot make the way.
    """
    controller = base.get("controller", {})
    steers = isinstance(controller, dict) and controller.get("kind") in STEERING[rests:]
    return {
        "initial": {"kind": "on_reference"},
        "reference": dict(reference),
        "controller": dict(controller) if steers else {"kind": "tvlqr"},
    }


def lost(
    chosen: Mapping[str, Any], base: Mapping[str, Any], *, rests: bool = False
) -> Iterator[tuple[str, str]]:
    """Which tables and values of those chosen for a plan's scenario the plan replaces.

    Args:
        chosen: nested tables of what was set.
        base: the scenario's data, with them.
        rests: the plan begins and ends at rest.

    Yields:
        The name, and what to do about it.
    """
    for key, hint in PLANS_OWN.items():
        if key in chosen:
            yield key, hint
    kept = replaced(base, rests=rests)["controller"] == base.get("controller")
    if "controller" in chosen and not kept:
        laws = ", ".join(sorted(STEERING[rests:]))
        yield "controller", f"its kind must be one that makes this way with the trailer: {laws}"


def located(given: Any, found: Any) -> Any:
    """A scenario's data with its files named from anywhere, as the checked scenario has them."""
    if isinstance(given, dict) and isinstance(found, dict):
        return {key: located(value, found.get(key)) for key, value in given.items()}
    names = isinstance(given, str) and isinstance(found, str) and Path(found).is_absolute()
    return found if names else given


def _scenario(out: Path, request: Request, found: Found, base: Mapping[str, Any]) -> str:
    """The scenario's text; of a base, all but what `lost` names."""
    end = float(found.plan.time_s[-1])
    duration = ROUNDS * end if request.closed else end + HOLD_S
    told = {
        "name": scenario_name(out),
        "description": _title(out, request, end).partition(": ")[2],
        "duration_s": round(duration, 2),
    }
    kept = {key: value for key, value in base.items() if key not in told}
    planned = {"kind": "planned", "plan": out.name}
    data = kept | replaced(base, planned, rests=not request.closed)
    plain = {key: value for key, value in data.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in data.items() if isinstance(value, dict)}
    head = [
        f"# Drives the plan in {out.name}: ttwmr run {out.with_suffix('.toml').name}",
        "# Laws that follow it, trailer and all: tvlqr, mpc; flatness unless F moves straight on.",
    ]
    return "\n".join(head) + "\n" + tomli_w.dumps(told | plain) + "\n" + tomli_w.dumps(tables)
