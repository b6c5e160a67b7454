"""What a scenario asks for and cannot get, said before it is run: where, when, and what would do.

One function for every command; none of it stops a run, for a law may come close all the same.
"""

from collections.abc import Callable
from decimal import ROUND_DOWN, ROUND_UP
from functools import partial

import numpy as np
from pydantic import ValidationError

from ttwmr_mj.errors import Fault, rounded
from ttwmr_mj.references.shared.demand import Along, Demand, Feasibility
from ttwmr_mj.references.shared.feasibility import LEAST_PACE, NOSE, feasible_pace
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.runs.judgement.verdict import demands_of
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray

WORTH_TELLING = 0.2  # of the pace, of what a trailer could follow were it slower
SLOWER, TRIES = 0.97, 12  # by how much a pace is lowered that does not do, and how often
OF_THE_TRAILER = (
    "a flat_* reference or one made by `ttwmr plan` is a motion that the trailer follows"
)


def foreseen(scenario: Scenario) -> list[Fault]:
    """What this robot cannot do of what the reference asks, longer than for a moment."""
    reference = sample_reference(scenario)
    at_once = [
        *_unsupported(scenario),
        *_overlapping(scenario, reference),
        *_pushes_too_late(scenario),
    ]
    if reference is None:
        return at_once
    until_end = reference.until(scenario.periods + 1)
    asked = _demands(scenario, until_end)
    end_s = float(until_end.time_s[-1])
    broken = [d.fault(end_s, _hint(scenario, until_end, d)) for d in asked.broken]
    return [*at_once, *broken]


def foretold(scenario: Scenario) -> list[str]:
    """The same in a line each."""
    return [f"{scenario.name}: {fault}" for fault in foreseen(scenario)]


def _pushes_too_late(scenario: Scenario) -> list[Fault]:
    return [
        Fault(
            key=("plant", "pushes", i),
            problem=f"starts at {push.start_s:g} s, when the run is over: it never acts",
            hint=f"start it before duration_s = {scenario.duration_s:g} s",
        )
        for i, push in enumerate(scenario.plant.pushes)
        if push.start_s >= scenario.duration_s
    ]


def _unsupported(scenario: Scenario) -> list[Fault]:
    """A tractor whose weight is on none of its wheels: it can neither drive nor stand by itself."""
    ahead_m = scenario.robot.tractor.com_offset_m
    ball_m = scenario.robot.casters.tractor_position_m
    if scenario.plant.kind != "contact" or ball_m > ahead_m:
        return []
    problem = (
        f"the tractor's ball is {1e3 * ball_m:.3g} mm ahead of P, and its centre of mass "
        f"{1e3 * ahead_m:.3g} mm: no weight is on its wheels, and it may tip over its ball"
    )
    allowed = f"more than {ahead_m:.6g} (robot.tractor.com_offset_m)"
    return [Fault(key=NOSE, problem=problem, allowed=allowed)]


def _overlapping(scenario: Scenario, reference: ReferencePath | None) -> list[Fault]:
    """Bodies of a train that overlap where it starts: contact physics throws them apart."""
    if len(scenario.robot.trailers) == 1 or scenario.plant.kind != "contact":
        return []
    from ttwmr_mj.plants.model.overlap import overlaps_m

    q = initial_state(scenario, reference).q
    return [
        Fault(
            key=("robot", "trailers"),
            problem=f"{one} and {other} overlap by {1e3 * depth_m:.2g} mm where they start",
            hint="with a larger next_hitch_offset_m, or on other sides, they have room",
        )
        for (one, other), depth_m in overlaps_m(scenario.robot, scenario.plant.contact, q).items()
    ]


def _demands(scenario: Scenario, reference: ReferencePath) -> Feasibility:
    """Of robot, floor and camera."""
    asked = demands_of(scenario, reference)
    assert asked is not None
    seen = [_in_picture(scenario, reference)] if scenario.sensing.kind == "camera" else []
    return Feasibility((*asked.checks, *seen))


def _hint(scenario: Scenario, reference: ReferencePath, demand: Demand) -> str:
    """What would be feasible."""
    if demand.name == "picture":
        return "move the reference, make it smaller, or hang the camera higher"
    broken = partial(_breaks, partial(demands_of, scenario), demand.name)
    pace = feasible_pace(broken, reference)
    trailer = demand.name == "free trailer"
    if pace < (WORTH_TELLING if trailer else LEAST_PACE):
        too_slow = f"not possible at {LEAST_PACE:g} of the pace, or faster"
        return _of_the_trailer(scenario) if trailer else too_slow
    # stretched in time it is not the reference made anew, whose balls are held back as ever
    for _ in range(TRIES):
        options = _rounded_options(scenario, pace)
        slower_one = _with_options(scenario, options)
        if slower_one is None:
            return "at no pace that the options of this reference allow is it possible"
        if not options or not _still_breaks(slower_one, demand.name):
            break
        pace *= SLOWER
    else:
        return f"at less than {_rounded('', pace)} of the pace it may be possible"
    told = ", ".join(f"reference.{name}={value}" for name, value in options.items())
    slower = f"possible at {_rounded('', pace)} of the pace{f': {told}' if told else ''}"
    return f"{slower}; {_of_the_trailer(scenario)}" if trailer else slower


def _rounded_options(scenario: Scenario, pace: float) -> dict[str, str]:
    options = scenario.reference.paced(pace)
    return {name: _rounded(name, value) for name, value in options.items()}


def _with_options(scenario: Scenario, options: dict[str, str]) -> Scenario | None:
    """The scenario whose reference has other options; None where these are beyond their limits."""
    values = {key: float(value) for key, value in options.items()}
    try:
        made = type(scenario.reference).model_validate(scenario.reference.model_dump() | values)
    except ValidationError:
        return None
    return scenario.model_copy(update={"reference": made})


def _still_breaks(scenario: Scenario, name: str) -> bool:
    """Whether the scenario's reference breaks a limit."""
    path, end = sample_reference(scenario), scenario.periods + 1
    return path is not None and _breaks(partial(demands_of, scenario), name, path.until(end))


def _breaks(
    demands: Callable[[ReferencePath], Feasibility | None], name: str, path: ReferencePath
) -> bool:
    asked = demands(path)
    return asked is not None and not asked[name].kept


def _of_the_trailer(scenario: Scenario) -> str:
    """What the trailer could follow instead."""
    if scenario.reference.kind == "planned":
        return (
            "a plan is exact at its rows, and between them a law makes up for this; one that is "
            "made with a longer --duration asks for less"
        )
    if scenario.reference.kind.startswith("flat_"):  # which `carried` left as it was
        return (
            "what acts on the trailer beside its hinge's motion (spring, damper, balls, slope) is "
            "too strong for this reference; a faster one, or weaker forces, may have room"
        )
    if getattr(scenario.reference, "theta2", None) in ("aligned", "outward"):
        return f"reference.theta2='none' asks nothing of the trailer; {OF_THE_TRAILER}"
    return OF_THE_TRAILER


def _rounded(name: str, value: float) -> str:
    """Three digits; to the slower side, so that what is told is possible."""
    up = name.endswith("_s") and not name.endswith(("rad_s", "m_s"))
    return rounded(value, ROUND_UP if up else ROUND_DOWN)


def _in_picture(scenario: Scenario, reference: ReferencePath) -> Demand:
    """How far the labels are out of the picture, at their outer edges [px]."""
    from ttwmr_mj.plants.model.mjcf import build_model
    from ttwmr_mj.vision.camera.labels import read_layout
    from ttwmr_mj.vision.camera.model import hang_camera

    assert scenario.sensing.kind == "camera", "only then is there a picture"
    model = build_model(scenario.robot, scenario.plant.contact)
    layout = read_layout(model)
    camera = hang_camera(model, scenario.sensing.camera)
    q = _with_trailer(reference.q)
    centre = camera.project(layout.centres_m(q))
    radius = layout.radius_m / np.array([camera.metres_per_pixel(z) for z in layout.height_m])
    size = np.array([camera.width_px, camera.height_px]) - 1.0
    beyond = np.maximum(-centre, centre - size).max(axis=-1) + radius
    along = Along(reference.time_s, reference.position_m)
    return along.at_most("picture", "px", np.maximum(beyond, 0.0), 0.0, "sensing", "camera")


def _with_trailer(q: FloatArray) -> FloatArray:
    """Where θ2 is undefined the trailer counts as in line with the tractor."""
    return np.concatenate([q[..., :3], np.where(np.isnan(q[..., 3:]), q[..., 2:3], q[..., 3:])], -1)
