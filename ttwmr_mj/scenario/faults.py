"""Pydantic's errors in this project's words: which key, what was got, what is allowed."""

from __future__ import annotations

import difflib
from typing import Any, get_args

from pydantic import BaseModel

from ttwmr_mj.errors import Fault, Keys, shown
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.schema import Scenario

# keys of the past, and what says the same today
MOVED: dict[Keys, str] = {
    ("plant", "tractor_mass_factor"): "gone; give the driven tractor robot.tractor.mass_kg and "
    "robot.tractor.yaw_inertia_kg_m2, and the controller the same keys in belief.robot.tractor",
    ("controller", "friction", "believed_share"): "gone; give the friction that the controller "
    "believes in belief.robot.hitch.coulomb_friction_n_m",
}


def fault_of(error: Any, root: type[BaseModel] = Scenario) -> Fault:
    """One pydantic error in this project's words; `root` is the model of the whole file."""
    keys = _file_keys(error["loc"], root)
    got, context = error["input"], error.get("ctx", {})
    match error["type"]:
        case "extra_forbidden" if keys in MOVED:
            return Fault(key=keys, problem=MOVED[keys])
        case "extra_forbidden":
            allowed = _allowed_keys(error["loc"][:-1], root)
            problem = f"unknown key{suggestion(str(keys[-1]), allowed)}"
            return Fault(key=keys, problem=problem, allowed=", ".join(allowed))
        case "missing":
            return Fault(key=keys, problem="missing; this key has no default and must be given")
        case "union_tag_not_found":
            return Fault(key=(*keys, "kind"), problem="missing", allowed=_tags(error["loc"], root))
        case "union_tag_invalid":
            tag, kinds = context["tag"], _tags(error["loc"], root)
            hint = suggestion(str(tag), kinds.replace("'", "").split(", "))
            return Fault(key=(*keys, "kind"), got=f"{tag!r}{hint}", allowed=kinds)
        case "value_error":  # raised by a validator of this project
            return Fault(key=keys, got=shown(got), problem=str(context["error"]))
    return Fault(key=keys, got=shown(got), allowed=error["msg"].removeprefix("Input should be "))


def suggestion(word: str, choices: list[str]) -> str:
    """A hint at the closest choice, or nothing when none is close."""
    without_unit = [choice for choice in choices if choice.startswith(word + "_")]
    close = without_unit or difflib.get_close_matches(word, choices, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _file_keys(location: Keys, root: type[BaseModel]) -> Keys:
    """A pydantic location without the union tags, which no file contains."""
    keys = tuple(key for key, _ in _walk(location, root))
    for first, name in RobotParameters.FIRST.items():
        for path in (("robot", name, 0), ("belief", "robot", name, 0)):
            if keys[: len(path)] == path:
                keys = (*path[:-2], first, *keys[len(path) :])
    return keys


def _allowed_keys(location: Keys, root: type[BaseModel]) -> list[str]:
    steps = _walk(location, root)
    model = steps[-1][1] if steps else root
    return [*model.model_fields, *getattr(model, "FIRST", ())] if model else []


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
    if location[:2] == ("belief", "robot"):
        return [("belief", None), *_walk(location[1:], root)]
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
