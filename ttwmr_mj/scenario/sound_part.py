"""What is left of a faulty scenario without its faults, so that the rest can be checked as well."""

import copy
from pathlib import Path
from typing import Any, get_type_hints

from pydantic import Field, ValidationError, create_model

from ttwmr_mj.errors import Fault, Keys
from ttwmr_mj.scenario.faults import faults_of
from ttwmr_mj.scenario.schema import Scenario


def sound_part(
    data: dict[str, Any], faults: list[Fault], context: dict[str, Path]
) -> tuple[Scenario, list[Keys]]:
    """The scenario without its faults, and what was left out.

    Left out is each key that has a fault, and what is around it where that is not enough.
    """
    sound, gone = copy.deepcopy(data), [fault.key for fault in faults]
    while True:
        for key in gone:
            _remove(sound, key)
        try:
            return _Incomplete.model_validate(sound, context=context), gone
        except ValidationError as error:  # a key without a default, or one within a list
            gone += {_around(fault.key, gone) for fault in faults_of(error)}


def _around(key: Keys, gone: list[Keys]) -> Keys:
    """The key, or the innermost table around it that is not gone."""
    return _around(key[:-1], gone) if key in gone else key


def _remove(data: dict[str, Any], key: Keys) -> None:
    place: Any = data
    for word in key[:-1]:
        place = place.get(word) if isinstance(place, dict) else None
    if isinstance(place, dict):
        place.pop(key[-1], None)


_OPTIONAL: dict[str, Any] = {  # None where a scenario must give something
    name: (hint, Field(default=None, validate_default=False))
    for name, hint in get_type_hints(Scenario, include_extras=True).items()
    if name in Scenario.model_fields and Scenario.model_fields[name].is_required()
}
_Incomplete = create_model("_Incomplete", __base__=Scenario, **_OPTIONAL)
