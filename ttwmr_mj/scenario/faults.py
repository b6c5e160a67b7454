"""What can be wrong with a scenario, in words: where, what was got, what is allowed."""

from __future__ import annotations

import difflib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

from ttwmr_mj.composite import tractor_chassis, trailer_chassis
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.schema import Scenario

Keys = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong: where, what was got, what is allowed."""

    keys: Keys
    message: str

    def __str__(self) -> str:
        where = ".".join(str(key) for key in self.keys) or "(whole file)"
        return f"{where}: {self.message}"


def fault_of(error: Any, root: type[BaseModel] = Scenario) -> Fault:
    """One pydantic error in this project's words; `root` is the model of the whole file."""
    keys = _file_keys(error["loc"], root)
    got, context = error["input"], error.get("ctx", {})
    match error["type"]:
        case "extra_forbidden":
            allowed = _allowed_keys(error["loc"][:-1], root)
            hint = suggestion(str(keys[-1]), allowed)
            return Fault(keys, f"unknown key{hint}; allowed here: {', '.join(allowed)}")
        case "missing":
            return Fault(keys, "missing; this key has no default and must be given")
        case "union_tag_not_found":
            return Fault((*keys, "kind"), f"missing; allowed: {_tags(error['loc'], root)}")
        case "union_tag_invalid":
            tag, expected = context["tag"], context["expected_tags"]
            hint = suggestion(str(tag), expected.replace("'", "").split(", "))
            return Fault((*keys, "kind"), f"got {tag!r}{hint}; allowed: {expected}")
    message = error["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    return Fault(keys, f"got {_short(got)}; allowed: {message}")


def _short(value: Any) -> str:
    text = "a table" if isinstance(value, dict) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def suggestion(word: str, choices: list[str]) -> str:
    """A hint at the closest choice, or nothing when none is close."""
    without_unit = [choice for choice in choices if choice.startswith(word + "_")]
    close = without_unit or difflib.get_close_matches(word, choices, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _file_keys(location: Keys, root: type[BaseModel]) -> Keys:
    """A pydantic location without the union tags, which no file contains."""
    return tuple(key for key, _ in _walk(location, root))


def _allowed_keys(location: Keys, root: type[BaseModel]) -> list[str]:
    steps = _walk(location, root)
    model = steps[-1][1] if steps else root
    return list(model.model_fields) if model else []


def _tags(location: Keys, root: type[BaseModel]) -> str:
    members = _members(root.model_fields[str(location[0])].annotation)
    return ", ".join(repr(_kind(member)) for member in members)


def _kind(member: type[BaseModel]) -> str:
    """The tag that selects a member of a union."""
    return str(get_args(member.model_fields["kind"].annotation)[0])


def _members(annotation: Any) -> list[type[BaseModel]]:
    """The models an annotation may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    found = [model for part in getattr(annotation, "__args__", ()) for model in _members(part)]
    inner = getattr(annotation, "__origin__", None)
    return found or (_members(inner) if inner not in (None, annotation) else [])


def _walk(location: Keys, root: type[BaseModel]) -> list[tuple[str | int, type[BaseModel] | None]]:
    """Each key of a location with the model that its value belongs to, union tags folded in."""
    steps: list[tuple[str | int, type[BaseModel] | None]] = []
    model: type[BaseModel] | None = root
    union: list[type[BaseModel]] = []
    for key in location:
        if len(union) > 1:  # the key is a tag: it picks the member, and is in no file
            picked = [member for member in union if _kind(member) == key]
            model, union = (picked[0] if picked else None), []
            if steps and picked:
                steps[-1] = (steps[-1][0], model)
                continue
        field = model.model_fields.get(str(key)) if model else None
        members = _members(field.annotation) if field else ([model] if model else [])
        union = members if field and len(members) > 1 else []
        model = members[0] if len(members) == 1 else None
        steps.append((key, model))
    return steps


def cross_faults(scenario: Scenario, folder: Path) -> list[Fault]:
    """What no single key shows."""
    faults = _timing_faults(scenario)
    for name, chassis in (("tractor", tractor_chassis), ("trailer", trailer_chassis)):
        try:
            chassis(scenario.robot)
        except InputError as error:
            message = str(error).split(": ", 1)[1]
            faults.append(Fault(("robot", name, "yaw_inertia_kg_m2"), message))
    path = scenario.plant.contact.model_path
    if path is not None and not (folder / path).is_file():
        looked = os.fspath(folder / path)
        faults.append(
            Fault(
                ("plant", "contact", "model_path"),
                f"got {path!r}; no such file ({looked}); give a scene file, relative to the "
                "scenario, or leave the key out for the shipped models/scene.xml",
            )
        )
    kind = scenario.controller.kind
    if scenario.reference.kind == "none" and kind not in ("open_loop", "custom"):
        faults.append(Fault(("reference", "kind"), f"got 'none'; {kind} needs a reference"))
    if scenario.reference.kind == "none" and scenario.initial.kind == "on_reference":
        faults.append(Fault(("initial", "kind"), "got 'on_reference'; there is no reference"))
    if scenario.plant.pushes and scenario.plant.kind == "analytic":
        message = "got pushes; only plant.kind = 'contact' can be pushed"
        faults.append(Fault(("plant", "pushes"), message))
    if scenario.output.save_frames and scenario.sensing.kind != "camera":
        message = f"got true; sensing.kind is {scenario.sensing.kind!r}, allowed: 'camera'"
        faults.append(Fault(("output", "save_frames"), message))
    calibration = getattr(scenario.sensing, "calibration_path", None)
    if calibration is not None and not (folder / calibration).is_file():
        message = (
            f"got {calibration!r}; no such file ({os.fspath(folder / calibration)}); make it with "
            "ttwmr calibrate, or leave the key out to calibrate before the run"
        )
        faults.append(Fault(("sensing", "calibration_path"), message))
    if scenario.output.physics_rate and scenario.plant.kind == "analytic":
        message = "got true; only plant.kind = 'contact' steps at a physics rate"
        faults.append(Fault(("output", "physics_rate"), message))
    return faults


def _timing_faults(scenario: Scenario) -> list[Fault]:
    faults = []
    period, step = scenario.control.sampling_time_s, scenario.plant.contact.timestep_s
    if scenario.plant.kind == "analytic":
        step = period  # solved at once
    for keys, value, unit, unit_key in (
        (("control", "sampling_time_s"), period, step, "plant.contact.timestep_s"),
        (("sensing", "latency_s"), scenario.sensing.latency_s, period, "control.sampling_time_s"),
    ):
        count = value / unit
        if abs(count - round(count)) > 1e-6 * max(count, 1.0) or (value > 0 and round(count) < 1):
            below, above = int(count) * unit, (int(count) + 1) * unit
            near = f"{below:g} and {above:g}" if below > 0 else f"{above:g}"
            faults.append(
                Fault(
                    keys,
                    f"got {value:g}; allowed: a whole number of steps of {unit:g} s ({unit_key}); "
                    f"nearest: {near}",
                )
            )
    if scenario.duration_s < period:
        message = f"got {scenario.duration_s:g}; allowed: at least one control period, {period:g}"
        faults.append(Fault(("duration_s",), message))
    return faults
