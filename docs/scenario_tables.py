"""The reference of a scenario's keys, from the schema: type, unit, default, limits, meaning."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ttwmr_mj.scenario.schema import Scenario

Node = Mapping[str, Any]
HEAD = "| key | type | unit | default | limits | meaning |\n|---|---|---|---|---|---|"
# the end of a key's name → its unit; the longest that fits counts
UNITS = {
    "_n_m_s_rad": "N·m·s/rad",
    "_n_m_rad": "N·m/rad",
    "_n_m_a": "N·m/A",
    "_v_s_rad": "V·s/rad",
    "_n_m": "N·m",
    "_kg_m2": "kg·m²",
    "_rad_s2": "rad/s²",
    "_rad_s": "rad/s",
    "_m_s2": "m/s²",
    "_m_s": "m/s",
    "_1_s": "1/s",
    "_per_s": "1/s",
    "_per_rev": "1/rev",
    "_rad": "rad",
    "_deg": "°",
    "_kg": "kg",
    "_ohm": "Ω",
    "_hz": "Hz",
    "_px": "px",
    "_share": "–",
    "_samples": "samples",
    "_ns": "ns",
    "_m2": "m²",
    "_m": "m",
    "_s": "s",
    "_n": "N",
    "_v": "V",
    "_a": "A",
}
SIGNS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
AS_ELSEWHERE = ("belief.robot", "belief.camera", "belief.ground")  # with the keys of another table
MISSING = object()


class Table(NamedTuple):
    """A table of the scenario file.

    Attributes:
        path: its keys, joined by dots; empty: the file itself.
        node: its part of the schema.
        defaults: values that the table around it gives its keys.
        kind: of the table, or of the one around it, where it may be of several.
        listed: whether it is one of a list.
    """

    path: str
    node: Node
    defaults: Mapping[str, Any]
    kind: str = ""
    listed: bool = False


def scenario_keys() -> str:
    """Every key of a scenario, table by table, in the order of the schema."""
    schema = Scenario.model_json_schema()
    definitions = schema["$defs"]
    tables = walk(Table("", schema, {}), definitions)
    return "\n\n".join(section(table, definitions) for table in tables) + "\n"


def walk(table: Table, definitions: Node) -> Iterator[Table]:
    """A table and those within it."""
    yield table
    for key, field in table.node.get("properties", {}).items():
        default = default_of(key, field, table)
        path = f"{table.path}.{key}".lstrip(".")
        if path not in AS_ELSEWHERE:
            for part in within(path, field, default, definitions):
                yield from walk(part._replace(kind=part.kind or table.kind), definitions)


def within(path: str, field: Node, default: Any, definitions: Node) -> Iterator[Table]:
    """The tables that a key may hold: one, one for each kind, or a list of them."""
    values = default if isinstance(default, Mapping) else {}
    for option in options(field):
        node = resolved(option, definitions)
        if node.get("type") == "array":
            item = resolved(node.get("items", {}), definitions)
            if "properties" in item:
                yield Table(path, item, {}, listed=True)
        elif "properties" in node:
            kind = node["properties"].get("kind", {}).get("const", "")
            same = not kind or values.get("kind") == kind
            yield Table(path, node, values if same else {}, kind)


def options(field: Node) -> list[Node]:
    """What a field may be, apart."""
    for word in ("oneOf", "anyOf", "allOf"):
        if word in field:
            return [part for option in field[word] for part in options(option)]
    return [field]


def resolved(node: Node, definitions: Node) -> Node:
    """A node, or the definition to which it refers."""
    name = node.get("$ref", "").rpartition("/")[2]
    return definitions[name] if name else node


def default_of(key: str, field: Node, table: Table) -> Any:
    """What a key that is not given is: of the table around it first."""
    return table.defaults.get(key, field.get("default", MISSING))


def section(table: Table, definitions: Node) -> str:
    """Heading, description and rows of one table."""
    rows = [row(key, field, table, definitions) for key, field in table.node["properties"].items()]
    known = [text for text in rows if text]
    about = " ".join(table.node.get("description", "").split("\n\n")[0].split())
    title = heading(table)
    return "\n\n".join(part for part in (title, about, "\n".join([HEAD, *known])) if part)


def heading(table: Table) -> str:
    """As a reader would write it in the file."""
    if not table.path:
        return "## At the top of the file"
    name = f"[[{table.path}]]" if table.listed else f"[{table.path}]"
    return f"## `{name}`" + f', kind = "{table.kind}"' * bool(table.kind)


def row(key: str, field: Node, table: Table, definitions: Node) -> str:
    """A line of the table; empty for a key that is a table itself and has its own."""
    if key == "kind" and "const" in field:
        return ""
    parts = [resolved(option, definitions) for option in options(field)]
    plain = [part for part in parts if "properties" not in part]
    if not plain and f"{table.path}.{key}" not in AS_ELSEWHERE:
        return ""
    default = default_of(key, field, table)
    cells = (
        f"`{key}`",
        " or ".join(dict.fromkeys(type_of(part, definitions) for part in plain)) or "table",
        next((UNITS[end] for end in sorted(UNITS, key=len, reverse=True) if key.endswith(end)), ""),
        shown(default),
        "; ".join(dict.fromkeys(filter(None, map(limits, [field, *plain])))),
        field.get("description")
        or next((p["description"] for p in plain if "description" in p), ""),
    )
    return "| " + " | ".join(" ".join(cell.replace("|", "\\|").split()) for cell in cells) + " |"


def type_of(part: Node, definitions: Node) -> str:
    """In TOML's words."""
    if "enum" in part or "const" in part:
        return ", ".join(
            f"`{json.dumps(value)}`" for value in part.get("enum", [part.get("const")])
        )
    kind = part.get("type", "any")
    if kind == "array":
        items = part.get("prefixItems") or [part.get("items", {})]
        words = [type_of(resolved(item, definitions), definitions) for item in items]
        inner = words[0] if len(set(words)) == 1 else "any"
        count = part.get("maxItems") if part.get("maxItems") == part.get("minItems") else None
        return f"{count or 'list of'} × {inner}".replace("list of ×", "list of")
    names = {"number": "float", "string": "string", "object": "table", "null": "left out"}
    return names.get(kind, kind)


def limits(part: Node) -> str:
    """Of a number, a text, or the members of a list."""
    found = [f"{sign} {part[word]:.10g}" for word, sign in SIGNS.items() if word in part]
    if "pattern" in part:
        found.append(f"matches `{part['pattern']}`")
    items = part.get("prefixItems") or [part.get("items", {})]
    inner = dict.fromkeys(filter(None, map(limits, items))) if "type" in part else {}
    if part.get("type") == "array":
        least, most = part.get("minItems"), part.get("maxItems")
        if least != most:
            counts = [f"{sign} {n}" for sign, n in (("≥", least), ("≤", most)) if n is not None]
            found.append(" and ".join(counts) + " members")
        found += [f"each {text}" for text in inner]
    return ", ".join(found)


def shown(default: Any) -> str:
    """A default as it would be written."""
    if default is MISSING:
        return "required"
    if default is None:
        return "left out"
    text = json.dumps(default, ensure_ascii=False)
    text = re.sub(r"(\d)\.0+(?=[,\]} ]|$)", r"\1.0", text)
    return f"`{text}`" if len(text) <= 80 else "see its table"
