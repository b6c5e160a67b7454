"""Scenario files: read, override, check everything at once, write back resolved."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import tomli_w
from pydantic import ValidationError

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.errors import Fault, InputError, Keys, require, shown, whole
from ttwmr_mj.files import (
    MOST_LEVELS,
    is_file,
    named,
    parse_toml,
    read_toml,
    require_none_but_files,
)
from ttwmr_mj.robot import RobotParameters, merged
from ttwmr_mj.scenario.checks import check
from ttwmr_mj.scenario.faults import MOST_FAULTS, faults_of, suggestion
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.sound_part import sound_part
from ttwmr_mj.scenario.tables.worlds import FILLING

_SOUND = WeakValueDictionary[int, Scenario]()  # by their id: checked, and frozen since


def find_scenario(name_or_path: str) -> Path:
    """The file a user means: a path, or the name of a shipped scenario.

    Raises:
        InputError: neither exists; the message lists what ships.
    """
    path = Path(name_or_path)
    if is_file(path):
        return path
    shipped = shipped_scenarios()
    if name_or_path in shipped:
        return shipped[name_or_path]
    require_none_but_files(path)
    # `scenarios/lab_circle.toml` means the shipped one from any folder
    if path.parent.name == "scenarios" and path.stem in shipped and path.suffix == ".toml":
        return shipped[path.stem]
    problem = "no such scenario file, and no shipped scenario of that name"
    missing = Fault(
        problem=f"{problem}{_near(path, list(shipped))}", hint=f"shipped: {', '.join(shipped)}"
    )
    raise InputError(missing, file=name_or_path)


def _near(path: Path, shipped: list[str]) -> str:
    """A hint at a file beside the one that is not there, or else at a scenario that is shipped."""
    with suppress(OSError):  # such a folder need not be there, nor be one
        beside = sorted(str(path.parent / file.name) for file in path.parent.glob("*.toml"))
        if hint := suggestion(str(path), beside):
            return hint
    return suggestion(path.stem, shipped)


def load_scenario(
    name_or_path: str | Path,
    overrides: Sequence[str] | None = None,
    seed: int | None = None,
    fragment: Path | str | list[Path | str] | tuple[Path | str, ...] | None = None,
) -> Scenario:
    """Read a scenario, merge fragments into it, apply overrides, check all of it.

    Args:
        name_or_path: a TOML file or the name of a shipped scenario.
        overrides: `key.path=value`; the value is read as TOML, or else as plain text.
        seed: replaces the scenario's seed, and one that a fragment or an override gives.
        fragment: a TOML file whose values replace the scenario's, table by table; of several, in
            their order, a later one's those of the earlier ones.

    Raises:
        InputError: with every fault of the file in one message.
    """
    require(str | Path, "name_or_path", name_or_path)
    require(list | tuple | None, "overrides", overrides, hint='as in ["seed=7"]')
    for i, override in enumerate(overrides or []):
        require(str, f"overrides[{i}]", override, hint='as in "seed=7"')
    path = find_scenario(str(name_or_path))
    data = read_scenario(path)
    several = fragment if isinstance(fragment, list | tuple) else [fragment]
    fragments = [named("fragment", one) for one in several if one is not None]
    for one in fragments:
        data = with_fragment(data, one)
    for override in overrides or []:
        set_value(data, override)
    if seed is not None:
        data["seed"] = seed
    return check_scenario(data, " with ".join(map(str, (path, *fragments))), path.parent)


def with_fragment(data: dict[str, Any], fragment: Path) -> dict[str, Any]:
    """Plain data with the values of a TOML file in place of its own, table by table.

    Raises:
        InputError: it cannot be read as TOML.
    """
    other = read_scenario(fragment)
    _forget_first(data, _paths([("", other)]))
    found: dict[str, Any] = merged(data, other)
    return found


def is_sound(scenario: Scenario) -> bool:
    """Whether this very one has been checked."""
    return _SOUND.get(id(scenario)) is scenario


def sound(scenario: Scenario) -> Scenario:
    """The same, which need not be checked again."""
    _SOUND[id(scenario)] = scenario
    return scenario


def read_scenario(path: Path) -> dict[str, Any]:
    """What a scenario file holds, not checked.

    Raises:
        InputError: it cannot be read as TOML.
    """
    return read_toml(path)


def check_scenario(data: dict[str, Any], source: str, folder: Path | str = Path()) -> Scenario:
    """Validate a scenario given as plain data.

    Args:
        data: what the TOML file holds; numbers and arrays of NumPy are as good as Python's.
        source: how to name it in messages.
        folder: where relative paths in it start from.

    Raises:
        InputError: with every fault in one message.
    """
    require(dict, "data", data)
    require(str, "source", source)
    data, context = _plain(data, source), {"folder": named("folder", folder)}
    if (world := data.get("world")) not in FILLING:
        return sound(_checked(data, source, context))
    # first as if the world filled in nothing, so that what is wrong is told as it was given
    _checked(data | {"world": "kind"}, source, context)
    try:
        scenario = Scenario.model_validate(data, context=context)
        faults = check(scenario, [])
    except ValidationError as error:
        faults = faults_of(error)
    due = f"due to what world = {world!r} sets; with 'kind' it is sound"
    if faults := [replace(f, hint="; ".join(filter(None, (f.hint, due)))) for f in faults]:
        raise InputError(*faults, file=source)
    return sound(scenario)


def _checked(data: dict[str, Any], source: str, context: dict[str, Path]) -> Scenario:
    """The scenario of plain data.

    Raises:
        InputError: with every fault in one message.
    """
    gone: list[Keys] = []
    try:
        scenario, faults = Scenario.model_validate(data, context=context), []
    except ValidationError as error:
        faults = faults_of(error)
        if error.error_count() > MOST_FAULTS:
            raise InputError(*faults, file=source) from error
        scenario, gone = sound_part(data, faults, context)
    faults += check(scenario, gone)
    if faults:
        raise InputError(*faults, file=source)
    return scenario


def _plain(value: Any, source: str, level: int = 0) -> Any:
    """The same data in values that a TOML file may hold.

    Raises:
        InputError: a key is no text; tables and lists are within each other too deep, or even in
            themselves.
    """
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if not isinstance(value, dict | list | tuple):
        return value
    if level > MOST_LEVELS:
        deep = f"tables and lists within each other more than {MOST_LEVELS} deep"
        raise InputError(deep, file=source)
    if isinstance(value, dict):
        if strange := [key for key in value if not isinstance(key, str)]:
            raise InputError(f"a key is {shown(strange[0])}; allowed: text", file=source)
        return {key: _plain(item, source, level + 1) for key, item in value.items()}
    items = [_plain(item, source, level + 1) for item in value]
    return items if isinstance(value, list) else tuple(items)


def set_value(data: dict[str, Any], override: str) -> None:
    """Apply one `key.path=value` to plain data, in place.

    Raises:
        InputError: there is no `=`, or the path runs through something that is no table.
    """
    keys, value = _parts(override)
    if value is None or not all(keys):
        allowed = "key.path=value, as in plant.kind=analytic"
        raise _unset(f"override {override}", allowed=allowed)
    _forget_first(data, paths_set(override))
    put_value(data, keys, value, f"override {override}")


def _forget_first(data: dict[str, Any], paths: Iterable[str]) -> None:
    """Drop `robot.trailer` and `robot.hitch` where a list that is given later has the first."""
    for path in paths:
        *outer, last = path.split(".")
        if outer[-1:] != ["robot"]:
            continue
        place: Any = data
        for key in outer:
            place = place.get(key) if isinstance(place, dict) else None
        for first, name in RobotParameters.FIRST.items():
            if last == name and isinstance(place, dict):
                place.pop(first, None)


def _parts(override: str) -> tuple[list[str], Any]:
    """The keys, from the outermost table inwards, and the value; None without `=`."""
    path, equals, text = override.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals:
        return keys, None
    with suppress(ValueError):
        found = parse_toml(f"value = {text}")
        if len(found) == 1:  # else it has more lines, which would be lost
            return keys, found["value"]
    return keys, text.strip()  # plain words need no quotes


def paths_set(override: str) -> Iterator[str]:
    """Each path at which `key.path=value` sets something: that one, and all within a table."""
    keys, value = _parts(override)
    return _paths([(".".join(keys), value)])


def _paths(places: list[tuple[str, Any]]) -> Iterator[str]:
    """Of values, and of all that is within them."""
    while places:
        path, value = places.pop(0)
        yield path
        if isinstance(value, dict):
            places += [(f"{path}.{key}" if path else key, item) for key, item in value.items()]
        elif isinstance(value, list):
            places += [(f"{path}.{i}", item) for i, item in enumerate(value)]


def put_value(data: dict[str, Any], keys: list[str], value: Any, where: str) -> None:
    """Set the value at a path of keys in plain data, in place.

    Args:
        data: nested tables; those that are missing on the way are made.
        keys: from the outermost table inwards; in a list, the number of an entry.
        value: what to put there.
        where: how to name the request in messages.

    Raises:
        InputError: the path runs through something that is no table.
    """
    place: Any = data
    for key in keys[:-1]:
        at = _place(place, key, where)
        place = place.setdefault(at, {}) if isinstance(place, dict) else place[at]
    place[_place(place, keys[-1], where)] = value


def _place(container: Any, key: str, where: str) -> Any:
    """The key in a table, or the index in a list."""
    if isinstance(container, dict):
        return key
    if isinstance(container, list):
        if (index := whole(key)) is not None and index < len(container):
            return index
        if not container:
            raise _unset(where, problem="the list is empty; set it as a whole")
        allowed = f"0 to {len(container) - 1}, as the list has {len(container)} entries"
        raise _unset(where, got=f"index {shown(key)}", allowed=allowed)
    raise _unset(where, problem=f"{key!r} can only be set in a table, and this is a value")


def _unset(where: str, **words: str) -> InputError:
    return InputError(Fault(key=(where,), **words))


def dump_scenario(scenario: Scenario) -> str:
    """Every value of a scenario as TOML, defaults included; loads back to an equal scenario."""
    data = scenario.model_dump(mode="json")
    if isinstance(scenario.controller, CustomOptions):  # they may be what JSON lacks: inf, dates
        data["controller"]["options"] = scenario.controller.options
    belief = data["belief"]
    data["belief"] = believed = {k: v for k, v in belief.items() if v not in ({}, None)}
    if not believed:  # a table that is empty would read as if something were believed
        del data["belief"]
    return tomli_w.dumps(_without_none(data))


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value
