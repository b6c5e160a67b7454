"""Scenario files: read, override, check everything at once, write back resolved."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.errors import InputError
from ttwmr_mj.references.options import PlannedReference
from ttwmr_mj.scenario.faults import Fault, Keys, cross_faults, fault_of, suggestion
from ttwmr_mj.scenario.schema import MAX_DURATION_S, Scenario
from ttwmr_mj.vision.options import CameraSensing


def find_scenario(name_or_path: str) -> Path:
    """The file a user means: a path, or the name of a shipped scenario.

    Raises:
        InputError: neither exists; the message lists what ships.
    """
    path = Path(name_or_path)
    if path.is_file():
        return path
    shipped = shipped_scenarios()
    if name_or_path in shipped:
        return shipped[name_or_path]
    # `scenarios/lab_circle.toml` means the shipped one from any folder
    if path.parent.name == "scenarios" and path.stem in shipped and path.suffix == ".toml":
        return shipped[path.stem]
    raise InputError(
        f"{name_or_path}: no such scenario file, and no shipped scenario of that name"
        f"{suggestion(path.stem, list(shipped))}; shipped: {', '.join(shipped)}"
    )


def load_scenario(
    name_or_path: str,
    overrides: list[str] | None = None,
    seed: int | None = None,
    fragment: Path | None = None,
) -> Scenario:
    """Read a scenario, merge a fragment into it, apply overrides, check all of it.

    Args:
        name_or_path: a TOML file or the name of a shipped scenario.
        overrides: `key.path=value`; the value is read as TOML, or else as plain text.
        seed: replaces the scenario's seed.
        fragment: a TOML file whose values replace the scenario's, table by table.

    Raises:
        InputError: with every fault of the file in one message.
    """
    path = find_scenario(name_or_path)
    data = _read(path)
    if fragment is not None:
        _merge(data, _read(fragment))
    for override in overrides or []:
        set_value(data, override)
    if seed is not None:
        data["seed"] = seed
    return check_scenario(data, str(path), path.parent)


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: cannot be read as TOML: {error}") from error


def _merge(data: dict[str, Any], given: dict[str, Any]) -> None:
    """Put given values into plain data, in place, table by table."""
    for key, value in given.items():
        if isinstance(value, dict) and isinstance(data.get(key), dict):
            _merge(data[key], value)
        else:
            data[key] = value


def check_scenario(data: dict[str, Any], source: str, folder: Path = Path()) -> Scenario:
    """Validate a scenario given as plain data.

    Args:
        data: what the TOML file holds.
        source: how to name it in messages.
        folder: where relative paths in it start from.

    Raises:
        InputError: with every fault in one message.
    """
    try:
        scenario = Scenario.model_validate(data)
        faults: list[Fault] = []
    except ValidationError as error:
        faults = [fault_of(item) for item in error.errors()]
        try:
            scenario = Scenario.model_validate(_sound_part(data, faults))
        except ValidationError:  # what is refused is a default, or stands in a list
            raise _input_error(source, faults) from error
    from ttwmr_mj.scenario.reference_faults import (
        reference_faults,  # it builds, and imports that much
    )

    placed = _with_absolute_paths(scenario, folder)
    wrong = {fault.keys for fault in faults}
    across = cross_faults(scenario, folder) + reference_faults(placed)
    faults += [fault for fault in across if not _touches(fault, wrong)]
    if faults:
        raise _input_error(source, faults)
    return placed


def _with_absolute_paths(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with its file names made independent of where it lies."""
    plant, sensing = scenario.plant, scenario.sensing
    if plant.contact.model_path is not None:
        path = str((folder / plant.contact.model_path).resolve())
        contact = plant.contact.model_copy(update={"model_path": path})
        plant = plant.model_copy(update={"contact": contact})
    reference = scenario.reference
    if isinstance(reference, PlannedReference) and reference.plan.endswith(".csv"):
        plan = str((folder / reference.plan).resolve())
        reference = reference.model_copy(update={"plan": plan})
    if isinstance(sensing, CameraSensing) and sensing.calibration_path is not None:
        path = str((folder / sensing.calibration_path).resolve())
        sensing = sensing.model_copy(update={"calibration_path": path})
    changed = {"plant": plant, "sensing": sensing, "reference": reference}
    return scenario.model_copy(update=changed)


def set_value(data: dict[str, Any], override: str) -> None:
    """Apply one `key.path=value` to plain data, in place.

    Raises:
        InputError: there is no `=`, or the path runs through something that is no table.
    """
    path, equals, text = override.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(keys):
        raise InputError(f"--set {override}: expected key.path=value, as in plant.kind=analytic")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()  # plain words need no quotes
    place: Any = data
    for i, key in enumerate(keys):
        last = i == len(keys) - 1
        if isinstance(place, list):
            if not (key.isdigit() and int(key) < len(place)):
                raise InputError(
                    f"--set {override}: {'.'.join(keys[:i])} is a list of {len(place)}; "
                    f"got index {key!r}, allowed 0 to {len(place) - 1}"
                )
            if last:
                place[int(key)] = value
            else:
                place = place[int(key)]
        elif isinstance(place, dict):
            if last:
                place[key] = value
            else:
                place = place.setdefault(key, {})
        else:
            raise InputError(f"--set {override}: {'.'.join(keys[:i])} is a value, not a table")


def dump_scenario(scenario: Scenario) -> str:
    """Every value of a scenario as TOML, defaults included; loads back to an equal scenario."""
    nothing_believed = {"belief"} if not scenario.belief.robot else None
    data = scenario.model_dump(mode="json", exclude=nothing_believed)
    return tomli_w.dumps(_without_none(data))


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value


def _input_error(source: str, faults: list[Fault]) -> InputError:
    count = "1 error" if len(faults) == 1 else f"{len(faults)} errors"
    lines = "\n".join(f"  {fault}" for fault in faults)
    return InputError(f"{source}: {count}\n{lines}")


# stand-ins for the keys without a default, so that the rest of a faulty file can be checked too
STAND_IN: dict[str, Any] = {
    "name": "stand-in",
    "duration_s": MAX_DURATION_S,
    "reference": {"kind": "none"},
    "controller": {"kind": "custom", "target": "stand:In"},
}


def _sound_part(data: dict[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """The data with every refused value left out; a section without defaults goes as a whole."""
    sound = copy.deepcopy(data)
    for keys in (fault.keys for fault in faults):
        place: Any = sound
        for key in keys[:-1]:
            if not isinstance(place, dict) or key in STAND_IN or key not in place:
                break
            place = place[key]
        else:
            if isinstance(place, dict):
                place.pop(keys[-1], None)
        if keys[0] in STAND_IN:
            sound[str(keys[0])] = STAND_IN[str(keys[0])]
        elif isinstance(sound.get(str(keys[0])), dict) and any(isinstance(k, int) for k in keys):
            sound.pop(str(keys[0]))
    return {**STAND_IN, **sound}


def _touches(fault: Fault, wrong: set[Keys]) -> bool:
    """Whether a check across keys looked at a value that was refused already."""
    sections = {keys[:-1] for keys in wrong} | wrong
    return fault.keys in wrong or fault.keys[:-1] in sections
