"""Scenarios that scripts give, which may be made by `model_copy`, and so be unchecked."""

from typing import Any

import numpy as np
from pydantic import ValidationError

from ttwmr_mj.config import Config
from ttwmr_mj.errors import InputError, require
from ttwmr_mj.scenario.checks import check
from ttwmr_mj.scenario.faults import faults_of
from ttwmr_mj.scenario.file import is_sound, sound
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.tables.worlds import FILLING


def require_scenario(given: object, where: str = "scenario") -> Scenario:
    """The scenario that a script gives, which may be made by `model_copy`, and so be unchecked.

    Returns:
        itself; another one where a value was meant as a table or number of the schema's types.

    Raises:
        InputError: it is none, as a name in its place is easily written; or with every fault.
    """
    require(Scenario, where, given, hint="load_scenario reads one by its name or file")
    assert isinstance(given, Scenario)
    if is_sound(given):
        return given
    data = _tables(given)
    world = data.get("world")
    if world in FILLING:  # it has been filled from it, or was changed since
        data["world"] = "kind"
    try:
        again = type(given).model_validate(data).model_copy(update={"world": world})
    except ValidationError as error:
        raise InputError(*(fault.within(where) for fault in faults_of(error))) from error
    scenario = given if not _has_numpy(given) and again == given else again
    if faults := check(scenario, []):
        raise InputError(*(fault.within(where) for fault in faults))
    return sound(scenario)


def _tables(value: Any) -> Any:
    """The same in tables and Python's numbers; what only laws and packages know stays itself."""
    if isinstance(value, Config):
        return {name: _tables(item) for name, item in vars(value).items()}
    if isinstance(value, tuple):
        return tuple(map(_tables, value))
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _has_numpy(value: Any) -> bool:
    """Whether there is a number or an array of NumPy's in it, equal as it may be to Python's."""
    if isinstance(value, Config):
        return any(map(_has_numpy, vars(value).values()))
    if isinstance(value, tuple | list):
        return any(map(_has_numpy, value))
    return isinstance(value, np.generic | np.ndarray)
