"""What plan.json must hold: it may have been edited, cut off or written by somebody else."""

from __future__ import annotations

import datetime
import math
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from ttwmr_mj.config import NAME
from ttwmr_mj.errors import InputError
from ttwmr_mj.files import parse_toml
from ttwmr_mj.results.metrics import METRICS
from ttwmr_mj.scenario.faults import faults_of
from ttwmr_mj.studies.sweep.plan.axes import Axis, Table, as_toml
from ttwmr_mj.studies.sweep.plan.file import Name, Sampling, Seed
from ttwmr_mj.studies.sweep.plan.parameters import Parameter, parameter_of

FORMAT = 1  # of plan.json
AS_TOML = "=toml"  # a key that TOML has in quotes only: the table stands for what JSON lacks
LONGEST_S = 86_400  # as in the sweep's file


def plain(value: Any) -> Any:
    """A value of a TOML file as JSON can hold it: inf, NaN, dates and times as TOML writes them."""
    match value:
        case dict():
            return {key: plain(item) for key, item in value.items()}
        case list():
            return [plain(item) for item in value]
        case datetime.date() | datetime.time():
            return {AS_TOML: as_toml(value)}
        case float() if not math.isfinite(value):
            return {AS_TOML: as_toml(value)}
    return value


def restored(value: Any) -> Any:
    """What `plain` was given."""
    match value:
        case {**table} if table.keys() == {AS_TOML} and isinstance(table[AS_TOML], str):
            return parse_toml(f"value = {table[AS_TOML]}")["value"]
        case dict():
            return {key: restored(item) for key, item in value.items()}
        case list():
            return [restored(item) for item in value]
    return value


def _metric(name: str) -> str:
    if name and name not in METRICS:
        raise ValueError("there is no such metric")
    return name


class StoredPlan(BaseModel):
    """plan.json as `Plan.to_json` writes it, but for what follows from the rest."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)

    name: str = Field(pattern=NAME)
    description: str
    scenario: str
    base: Table
    folder: str
    overrides: list[str]
    seeds: list[Seed] = Field(min_length=1)
    sampling: Sampling
    samples: Annotated[int, Field(ge=1)] | None
    sampling_seed: Seed
    sensitivity: bool
    parameters: dict[str, Table]
    variants: dict[Name, list[str]]
    headline_metric: Annotated[str, AfterValidator(_metric)]
    timeout_s: float = Field(gt=0.0, le=LONGEST_S)
    made_of: Table
    digest: str

    @classmethod
    def of(cls, data: dict[str, Any]) -> StoredPlan:
        """What a plan.json holds.

        Raises:
            InputError: it was written by another version, or is none; with every fault.
        """
        if data.get("format") != FORMAT:
            got = repr(data.get("format"))
            raise InputError.at("format", "plan.json is of another version", got=got)
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise InputError(*faults_of(error, cls)) from error

    @property
    def axes(self) -> tuple[Axis, ...]:
        """What is varied.

        Raises:
            InputError: a parameter is none.
        """
        found: dict[int, dict[str, Parameter]] = {}
        for key, table in self.parameters.items():
            given = {k: v for k, v in table.items() if k not in ("kind", "axis")}
            parameter, axis = parameter_of(given), table.get("axis")
            if not isinstance(parameter, Parameter):
                raise InputError(*(fault.within("parameters", key) for fault in parameter))
            if not isinstance(axis, int):
                raise InputError.at("parameters", f"{key} does not say of which axis it is")
            found.setdefault(axis, {})[key] = parameter
        return tuple(Axis(found[k]) for k in sorted(found))
