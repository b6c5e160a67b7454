"""Checks across keys of a scenario, made where the keys they look at are valid themselves.

Each check names the parts of the scenario that it looks at. In a faulty file, the checks whose
parts have no fault of their own are still made, so that all faults are reported at once.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ttwmr_mj.composite import tractor_chassis, trailer_chassis
from ttwmr_mj.controllers.base import law_faults
from ttwmr_mj.dynamics.kinematics import constraint_residual
from ttwmr_mj.errors import Fault, InputError, Keys
from ttwmr_mj.references.shared.demand import Along
from ttwmr_mj.references.shared.feasibility import SIDE_SLIP_M_S
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import reference_faults, sampled
from ttwmr_mj.scenario import timing
from ttwmr_mj.scenario.equations import plant_of_equations
from ttwmr_mj.scenario.limits import ESCAPE
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.tables.plant import PushOptions
from ttwmr_mj.scenario.timing import STEP
from ttwmr_mj.vision.camera.options import FadedLabel, Occluder

MOST_SAMPLES = 20_000  # a longer run is looked at that often; the run looks at every sample
# of its top speed that a reference may move across θ1, which is then 3° off: shipped ones do by
# 3e-5, their plans with every fourth row by 3e-3, and one whose columns are exchanged by all of it
ACROSS = 0.05


class Check(NamedTuple):
    """A check and the keys it looks at, each with all that lies below."""

    faults: Callable[[Scenario], Iterable[Fault]]
    looks_at: tuple[str, ...]

    def is_possible(self, gone: list[Keys]) -> bool:
        """Whether all that the check looks at is there."""
        keys = [tuple(key.split(".")) for key in self.looks_at]
        return not any(_overlap(missing, key) for missing in gone for key in keys)


def check(scenario: Scenario, gone: list[Keys]) -> list[Fault]:
    """Faults across keys, of a scenario from which these keys were left out."""
    return [fault for one in CHECKS if one.is_possible(gone) for fault in one.faults(scenario)]


def _overlap(key: Keys, other: Keys) -> bool:
    return all(a == b for a, b in zip(key, other, strict=False))


def _tractor_masses(scenario: Scenario) -> Iterable[Fault]:
    yield from _refused(partial(tractor_chassis, scenario.robot))


def _trailer_masses(scenario: Scenario) -> Iterable[Fault]:
    for index in range(len(scenario.robot.trailers)):
        yield from _refused(partial(trailer_chassis, scenario.robot, index))


def _refused(make: Callable[[], object]) -> Iterable[Fault]:
    try:
        make()
    except InputError as error:
        yield from error.faults


def _belief(scenario: Scenario) -> Iterable[Fault]:
    count, truth = len(scenario.believed_robot.trailers), len(scenario.robot.trailers)
    if count != truth:
        allowed = f"as many as robot.trailers, {truth}"
        yield Fault(key=("belief", "robot", "trailers"), got=str(count), allowed=allowed)


def train_faults(scenario: Scenario) -> Iterable[Fault]:
    """What cannot be had with more than one trailer."""
    count, start = len(scenario.robot.trailers), scenario.initial
    more = "more_trailers_rad" if start.kind == "at_rest" else "more_trailers_offset_rad"
    given = len(getattr(start, more))
    if given not in (0, count - 1):
        allowed = f"as many as there are trailers behind the first, {count - 1}"
        yield Fault(key=("initial", more), got=str(given), allowed=allowed)
    yield from _which_trailer(scenario)
    if count == 1:
        return
    for index, hitch in enumerate(scenario.robot.hitches[1:], start=1):
        if hitch.play_m:
            place = ("robot", "hitches", str(index), "play_m")
            problem = "only the first may have play"
            yield Fault(key=place, got=f"{hitch.play_m:g}", problem=problem)
    problem = f"does not work with {count} trailers"
    refused = {
        ("plant", "analytic", "published_spring"): (
            scenario.plant.analytic.published_spring,
            "true",
        ),
        ("controller", "kind"): (
            not scenario.controller.tows_trains,
            repr(scenario.controller.kind),
        ),
        ("controller", "recovery"): (
            getattr(scenario.controller, "recovery", None) == "mpc",
            "'mpc'",
        ),
        ("controller", "learn"): (bool(getattr(scenario.controller, "learn", ())), "given"),
        ("reference", "kind"): (not scenario.reference.leads_trains, repr(scenario.reference.kind)),
    }
    for key, (bad, got) in refused.items():
        if bad:
            yield Fault(key=key, got=got, problem=problem)


def _which_trailer(scenario: Scenario) -> Iterable[Fault]:
    """Trailers that pushes and a camera's faults name."""
    count = len(scenario.robot.trailers)
    named: dict[Keys, Sequence[PushOptions | Occluder | FadedLabel]]
    named = {("plant", "pushes"): scenario.plant.pushes}
    if scenario.sensing.kind == "camera":
        table, faults = ("sensing", "camera", "faults"), scenario.sensing.camera.faults
        named |= {(*table, "occluders"): faults.occluders, (*table, "faded"): faults.faded}
    for place, given in named.items():
        for index, one in enumerate(given):
            if (trailer := one.trailer) > count:
                key = (*place, str(index), "trailer")
                allowed = f"at most {count}, the number of trailers"
                yield Fault(key=key, got=str(trailer), allowed=allowed)


def _open_loop(scenario: Scenario) -> Iterable[Fault]:
    if scenario.reference.kind == "none" and scenario.initial.kind == "on_reference":
        problem = "with reference.kind = 'none' there is no reference to start on"
        yield Fault(key=("initial", "kind"), got="'on_reference'", problem=problem)


def _terrain(scenario: Scenario) -> Iterable[Fault]:
    terrain = scenario.ground.terrain
    if terrain and not terrain.png_path and terrain.correlation_length_m > terrain.side_m:
        allowed = f"at most {terrain.side_m:g}, the terrain's side (twice half_size_m)"
        key = ("ground", "terrain", "correlation_length_m")
        yield Fault(key=key, got=f"{terrain.correlation_length_m:g}", allowed=allowed)


def _contact_only(scenario: Scenario) -> Iterable[Fault]:
    if scenario.plant.kind == "contact":
        return
    if scenario.plant.pushes:
        problem = "only plant.kind = 'contact' can be pushed"
        yield Fault(key=("plant", "pushes"), got="pushes", problem=problem)
    if scenario.output.physics_rate:
        problem = "only plant.kind = 'contact' has physics steps"
        yield Fault(key=("output", "physics_rate"), got="true", problem=problem)
    yield from unknown_to_the_models(scenario)


def unknown_to_the_models(scenario: Scenario) -> Iterable[Fault]:
    """What the world has that only contact physics can drive in."""
    problem = "only plant.kind = 'contact' knows of it"
    for index, hitch in enumerate(scenario.robot.hitches):
        if hitch.play_m:
            table = ("robot", "hitches", str(index)) if index else ("robot", "hitch")
            yield Fault(key=(*table, "play_m"), got=f"{hitch.play_m:g}", problem=problem)
    if regions := scenario.ground.regions:
        yield Fault(key=("ground", "regions"), got=f"{len(regions)} regions", problem=problem)
    if scenario.ground.terrain is not None:
        yield Fault(key=("ground", "terrain"), got="a table", problem=problem)
    if kerbs := scenario.ground.kerbs:
        yield Fault(key=("ground", "kerbs"), got=f"{len(kerbs)} kerbs", problem=problem)


def _frames(scenario: Scenario) -> Iterable[Fault]:
    if scenario.output.save_frames and scenario.sensing.kind != "camera":
        problem = f"sensing.kind = {scenario.sensing.kind!r} has no frames"
        hint = "use sensing.kind = 'camera'"
        yield Fault(key=("output", "save_frames"), got="true", problem=problem, hint=hint)


def _torques(scenario: Scenario) -> Iterable[Fault]:
    law = scenario.controller.kind
    if scenario.control.inner_loop == "torque" and law != "custom":
        yield Fault(
            key=("control", "inner_loop"),
            got="'torque'",
            problem=f"{law} commands wheel speeds, and no torques",
            hint="'computed_torque' drives its wheel speeds by torques",
        )


def _torque_input(scenario: Scenario) -> Iterable[Fault]:
    """The analytic plant under torques is Eq. 11-23 and nothing else."""
    if scenario.plant.kind == "contact" or not scenario.control.torque_input:
        return
    analytic = scenario.plant.analytic
    for key, given in (
        ("extended", analytic.extended),
        ("published_spring", analytic.published_spring),
    ):
        if given:
            problem = (
                f"control.inner_loop is {scenario.control.inner_loop!r}, which it cannot drive"
            )
            yield Fault(key=("plant", "analytic", key), got="given", problem=problem)


def _integration(scenario: Scenario) -> Iterable[Fault]:
    """Whether the plant made of equations takes these steps; under torques it takes its own."""
    if scenario.plant.kind != "analytic" or scenario.control.torque_input:
        return
    published_train = scenario.plant.analytic.published_spring and len(scenario.robot.trailers) > 1
    broken_steps = scenario.control.command_latency_s and any(timing.physics_step_faults(scenario))
    if not published_train and not broken_steps:  # which are other checks'
        yield from _refused(partial(plant_of_equations, scenario))


def _believed_camera(scenario: Scenario) -> Iterable[Fault]:
    sensing, key = scenario.sensing, ("belief", "camera")
    if not scenario.belief.camera:
        return
    if sensing.kind != "camera":
        yield Fault(key=key, got="a table", problem=f"sensing.kind is {sensing.kind!r}")
    elif sensing.calibration_path is not None:
        problem = "sensing.calibration_path names a file, which is what is believed of the camera"
        yield Fault(key=key, got="a table", problem=problem, hint="leave one of them out")
    else:
        for name in ("name", "width_px", "height_px"):
            true, believed = (getattr(c, name) for c in (sensing.camera, scenario.believed_camera))
            if believed != true:
                problem = "a camera that is calibrated takes the same pictures"
                yield Fault(
                    key=(*key, name), got=repr(believed), problem=problem, allowed=repr(true)
                )


def _reference(scenario: Scenario) -> list[Fault]:
    try:
        faults = reference_faults(scenario.reference, scenario.believed_robot)
        if faults and not reference_faults(scenario.reference, scenario.robot):
            believed = ", ".join(f"belief.robot.{key}" for key in scenario.belief.robot)
            hint = (
                f"restore {believed}: the reference is that of the robot that is believed in; or "
                "make it anew for that robot (of a plan: `ttwmr plan ... --scenario` with the "
                "same --set)"
            )
            faults = [replace(fault, hint=hint) for fault in faults]
    except InputError as error:  # of another package's
        return list(error.faults)
    return [fault.within("reference") for fault in faults]


def _controller(scenario: Scenario) -> list[Fault]:
    if _reference(scenario):
        return []
    try:
        path = _path(scenario)
        faults = law_faults(scenario.controller, scenario.reference, path)
        faults += [*_nowhere(path), *_sideways(path), *_too_far(path)]
        return [*faults, *_undefined_start(scenario, path)]
    except InputError as error:  # of another package's
        return list(error.faults)


def _undefined_start(scenario: Scenario, path: ReferencePath | None) -> Iterable[Fault]:
    """What stands still has no heading."""
    if path is None or scenario.initial.kind != "on_reference":
        return
    if np.isnan([path.theta[0, 0, 0], path.theta_rate[0, 0, 0]]).any():
        problem = "at its start the reference stands still, and has no heading"
        yield Fault(key=("initial", "kind"), got="'on_reference'", problem=problem)


def _nowhere(path: ReferencePath | None) -> Iterable[Fault]:
    """What divides by a speed or an acceleration that is zero there."""
    if path is None or (there := np.isfinite(path.derivatives).all(axis=(1, 2, 3))).all():
        return
    problem = f"has no position of P, or not its rates, at {path.time_s[~there][0]:g} s"
    yield Fault(key=("reference",), problem=problem, hint="keep it moving")


def _sideways(path: ReferencePath | None) -> Iterable[Fault]:
    """Wheels roll where they point to (Eq. 3); what has no θ1 there is not judged."""
    if path is None:
        return
    with np.errstate(all="ignore"):  # of numbers that are none, which is another check's
        top_m_s = np.fmax.reduce(np.hypot(*np.moveaxis(path.velocity_m_s, -1, 0)), axis=None)
        across, limit = (
            constraint_residual(path.q, path.q_rate),
            max(SIDE_SLIP_M_S, ACROSS * top_m_s),
        )
        slip = Along(path.time_s, path.position_m).at_most("no side slip", "m/s", across, limit)
    if not slip.kept:
        yield Fault(
            key=("reference",),
            problem=f"moves P at {slip.worst:.3g} m/s across its heading θ1, where no wheel rolls, "
            f"at {slip.worst_time_s:.3g} s",
            allowed=f"at most {limit:.3g} m/s",
            hint="are two columns exchanged, are angles in degrees or do they jump by a turn, or "
            "is it of a point other than P, the middle between the wheels?",
        )


def _too_far(path: ReferencePath | None) -> Iterable[Fault]:
    """A run ends as diverged where it gets that far."""
    if path is not None and (reach_m := float(np.abs(path.q[..., :2]).max())) > ESCAPE:
        allowed = f"within {ESCAPE:g} m of the world's origin"
        yield Fault(key=("reference",), problem=f"leads {reach_m:.3g} m away", allowed=allowed)


def _path(scenario: Scenario) -> ReferencePath | None:
    """The reference over the run and beyond, at no more than MOST_SAMPLES."""
    count = min(scenario.samples, MOST_SAMPLES)
    time_s = np.linspace(0.0, (scenario.samples - 1) * scenario.control.sampling_time_s, count)
    with np.errstate(all="ignore"):  # what does not move has no direction: NaN, found by the law
        return sampled(scenario.reference, time_s, scenario.believed_robot)


CHECKS = (
    Check(train_faults, ("robot", "initial", "sensing", "plant", "controller", "reference")),
    Check(_tractor_masses, ("robot.tractor", "robot.casters")),
    Check(_trailer_masses, ("robot.trailer", "robot.trailers", "robot.casters")),
    Check(_belief, ("robot", "belief")),
    Check(_open_loop, ("reference", "initial")),
    Check(
        _contact_only,
        ("plant.kind", "plant.pushes", "output", "robot.hitch", "robot.hitches", "ground"),
    ),
    Check(_terrain, ("ground.terrain",)),
    Check(_frames, ("sensing.kind", "output")),
    Check(timing.physics_steps, ("plant.kind", "control", STEP)),
    Check(timing.pushes, ("plant.pushes", "control")),
    Check(timing.motor_timing, ("plant.kind", "robot.servo", "control", STEP)),
    Check(_torques, ("controller", "control")),
    Check(_torque_input, ("plant.kind", "plant.analytic", "control")),
    Check(
        timing.latency, ("sensing.kind", "sensing.latency_s", "sensing.latency_jitter_s", "control")
    ),
    Check(timing.command_latency, ("plant.kind", "control", "belief.command_latency_s", STEP)),
    Check(
        _integration,
        ("robot", "ground", "plant", "control", "belief.command_latency_s", "duration_s"),
    ),
    Check(_believed_camera, ("sensing", "belief")),
    Check(timing.one_period, ("duration_s", "control")),
    Check(_reference, ("reference", "robot", "belief")),
    Check(_controller, ("reference", "robot", "belief", "controller", "control", "duration_s")),
)
