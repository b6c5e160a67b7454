"""Pydantic's errors in this project's words: which key, what was got, what is allowed."""

import difflib
from contextlib import suppress
from functools import cache
from typing import Any

from pydantic import BaseModel, ValidationError

from ttwmr_mj.config import PATTERNS
from ttwmr_mj.errors import MOST_TOLD, Fault, Keys, shown
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.meaning import best_by_meaning
from ttwmr_mj.scenario.schema import Scenario

Node = dict[str, Any]  # of a JSON Schema
MOST_FAULTS = 1000  # of a file with more, no more is looked for

KINDS = {  # pydantic's name of a fault → what is meant, as a file has it
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "tuple_type": "a list",
    "list_type": "a list",
    "int_from_float": "a whole number",
    "int_type": "a whole number",
}
# keys of the past, and what says the same today
MOVED: dict[Keys, str] = {
    ("plant", "tractor_mass_factor"): "gone; give the driven tractor robot.tractor.mass_kg and "
    "robot.tractor.yaw_inertia_kg_m2, and the controller the same keys in belief.robot.tractor",
    ("controller", "friction", "believed_share"): "gone; give the friction that the controller "
    "believes in belief.robot.hitch.coulomb_friction_n_m",
}


def faults_of(error: ValidationError, root: type[BaseModel] = Scenario) -> list[Fault]:
    """What pydantic found in a file of the model `root`, in this project's words.

    No more than MOST_FAULTS; of those beyond MOST_TOLD only where they are.
    """
    errors = error.errors(include_url=False)[:MOST_FAULTS]
    # a list whose items have faults counts as too short, as if they were not there
    around = {item["loc"][:n] for item in errors for n in range(len(item["loc"]))}
    meant = [e for e in errors if not (e["type"] == "too_short" and e["loc"] in around)]
    others = (
        Fault(key=_place(_location(item), root)[0], problem="wrong") for item in meant[MOST_TOLD:]
    )
    return [*(fault_of(item, root) for item in meant[:MOST_TOLD]), *others]


def fault_of(error: Any, root: type[BaseModel] = Scenario) -> Fault:
    """One pydantic error in this project's words; `root` is the model of the whole file."""
    keys, table, value = _place(_location(error), root)
    got, context = error["input"], error.get("ctx", {})
    match error["type"]:
        case "extra_forbidden" if keys in MOVED:
            return Fault(key=keys, problem=MOVED[keys])
        case "extra_forbidden":
            known = list(table.get("properties", ()))
            problem = f"unknown key{_meant(keys, table, root)}"
            hint = _of_another_kind(keys, error["loc"], root)
            return Fault(key=keys, problem=problem, allowed=", ".join(known), hint=hint)
        case "string_pattern_mismatch" if context["pattern"] in PATTERNS:
            return Fault(key=keys, got=shown(got), allowed=PATTERNS[context["pattern"]])
        case "string_pattern_mismatch" if "description" in value and error["loc"][-1] != "[key]":
            return Fault(key=keys, got=shown(got), allowed=value["description"])
        case "missing":
            return Fault(key=keys, problem="missing; this key has no default and must be given")
        case "union_tag_not_found" | "union_tag_invalid":
            kinds = list(value["discriminator"]["mapping"])
            allowed, key = ", ".join(map(repr, kinds)), (*keys, "kind")
            if "tag" not in context:
                return Fault(key=key, problem="missing", allowed=allowed)
            hint = suggestion(str(context["tag"]), kinds)
            return Fault(key=key, got=f"{context['tag']!r}{hint}", allowed=allowed)
        case "too_long":
            allowed = f"at most {context['max_length']} of them"
            return Fault(key=keys, got=f"{context['actual_length']} of them", allowed=allowed)
        case "too_short":
            return Fault(
                key=keys, got=shown(got), allowed=f"at least {context['min_length']} of them"
            )
        case "value_error":  # raised by a validator of this project
            return Fault(key=keys, got=shown(got), problem=str(context["error"]))
    allowed = KINDS.get(error["type"]) or error["msg"].removeprefix("Input should be ")
    hint = _in_toml(got) if isinstance(got, str) and error["type"].endswith("_type") else ""
    return Fault(key=keys, got=shown(got), allowed=allowed, hint=hint)


def _in_toml(text: str) -> str:
    """How TOML writes the value that is meant by a text; empty where none can be told."""
    if not text.strip():
        return "no value is given"
    if (word := text.lower()) in ("true", "false"):
        return f"TOML writes {word}"
    for kind, digits in ((int, text), (float, text.replace(",", "."))):
        with suppress(ValueError):
            return f"TOML writes {shown(kind(digits))}"
    return ""


def _meant(keys: Keys, table: Node, root: type[BaseModel]) -> str:
    """A hint at the key that was probably meant: by its letters, or by what it means."""
    word, properties = str(keys[-1]), table.get("properties", {})
    if close := suggestion(word, list(properties)):
        return close
    schema = _schema(root)
    here = {name: _text(node, schema) for name, node in properties.items()}
    inside = {
        f"{name}.{key}": _text(inner, schema)
        for name, node in properties.items()
        for key, inner in _resolved(node, schema).get("properties", {}).items()
    }
    found = best_by_meaning(word, here | inside)
    return f" (did you mean {found!r}?)" if found else ""


def _of_another_kind(keys: Keys, location: Keys, root: type[BaseModel]) -> str:
    """How to choose a section's kind, where a key is one of another kind's; else empty."""
    schema: Node = _schema(root)
    section = _place(location[:-2], root)[2]  # a pydantic location ends with tag and key
    members = section.get("discriminator", {}).get("mapping", {})
    kind = str(location[-2]) if len(location) > 1 else ""
    tables = {name: _resolved({"$ref": node}, schema) for name, node in members.items()}
    owners = [name for name, table in tables.items() if keys[-1] in table["properties"]]
    if kind not in members or not owners:
        return ""
    name = ".".join(map(str, keys[:-1]))

    def whole(one: str) -> str:
        needed = [f"{key}=..." for key in tables[one].get("required", ()) if key != "kind"]
        inside = ", ".join([f'kind="{one}"', *needed])
        return f"--set '{name}={{{inside}}}'"

    return (
        f"it belongs to {', '.join(owners)}, and the kind here is {kind}; a whole table changes "
        f"the kind: {whole(owners[0])}, or for {kind} without such keys {whole(kind)}"
    )


def _text(node: Node, schema: Node) -> str:
    return str(node.get("description") or _resolved(node, schema).get("description", ""))


def suggestion(word: str, choices: list[str]) -> str:
    """A hint at the closest choice, or nothing when none is close."""
    without_unit = [choice for choice in choices if choice.startswith(word + "_")]
    close = without_unit or difflib.get_close_matches(word, choices, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


_schema = cache(lambda root: root.model_json_schema())


def _location(error: Any) -> Keys:
    """Where pydantic has an error; of a name that is none, where that name is."""
    location: Keys = error["loc"]
    of_name = location[-1:] == ("[key]",) and error["type"] == "string_pattern_mismatch"
    return location[:-1] if of_name else location


def _place(location: Keys, root: type[BaseModel]) -> tuple[Keys, Node, Node]:
    """A pydantic location as a file writes it; in the JSON Schema, the table around it and itself.

    Where the schema has a union, pydantic's locations name its member, which is in no file.
    """
    schema: Node = _schema(root)
    keys: list[str | int] = []
    table, node = schema, schema
    for key in location:
        members = node.get("discriminator", {}).get("mapping", {})
        if key in members:
            node = _resolved({"$ref": members[key]}, schema)
        elif len(_alternatives(node)) > 1:
            node = {}  # any of them
        else:
            keys.append(key)
            table, node = node, _resolved(_inside(node, key), schema)
    for first, name in RobotParameters.FIRST.items():
        for outer in (("robot",), ("belief", "robot")):
            if tuple(keys[: len(outer) + 2]) == (*outer, name, 0):
                keys[len(outer) : len(outer) + 2] = [first]
    return tuple(keys), table, node


def _inside(node: Node, key: str | int) -> Node:
    """What stands at a key of a table, or in a list."""
    alike = [node.get("items"), *node.get("patternProperties", {}).values()]
    return node.get("properties", {}).get(key) or next(filter(None, alike), {})


def _alternatives(node: Node) -> list[Node]:
    """What a value may be, if not null."""
    given: list[Node] = node.get("anyOf") or node.get("oneOf") or []
    return [one for one in given if one.get("type") != "null"]


def _resolved(node: Node, schema: Node) -> Node:
    """What a node refers to; of what may be null, what else it may be."""
    alternatives = _alternatives(node)
    if len(alternatives) == 1:
        node = node | alternatives[0]
    name = node.get("$ref", "").removeprefix("#/$defs/")
    return schema["$defs"][name] if name else node
