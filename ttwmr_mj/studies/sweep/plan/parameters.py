"""What a parameter of a sweep may be: a list, a range, a distribution.

Each says its values two ways. `values` are finitely many, counted from 0, for a grid; None where
there is a continuum. `of_unit` turns numbers of [0, 1) into values, for samples: evenly over
finitely many values, else by the inverse of the distribution function.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, ValidationError, model_validator

from ttwmr_mj.config import Config
from ttwmr_mj.errors import Fault
from ttwmr_mj.scenario.faults import faults_of
from ttwmr_mj.state import FloatArray

Value = float | int | str | bool


def _finite(given: Any) -> Any:
    """A number that can be counted with, whole or not; a whole one stays whole."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise ValueError("this is no number")
    if not math.isfinite(given):
        raise ValueError("this is not a finite number")
    return given


def _plain(given: Any) -> Any:
    """A finite number, a text or a truth value: what a column of a table can hold."""
    return given if isinstance(given, str | bool) else _finite(given)


Number = Annotated[Any, AfterValidator(_finite)]
Values = Annotated[list[Annotated[Any, AfterValidator(_plain)]], Field(min_length=1)]
EPS = 2.0**-53  # keeps a distribution's ends, which may be infinite, away
MOST_VALUES = 100_000  # of one parameter


class Parameter(Config):
    """One varied key of the scenario.

    Attributes:
        kind: its name in plan.json.
        drawn: whether it is a distribution, of which a grid draws one value for each seed.
    """

    kind: ClassVar[str]
    drawn: ClassVar[bool] = True

    @property
    def values(self) -> tuple[Value, ...] | None:
        """Every value it takes; None if there is a continuum of them."""
        return None

    @property
    def weights(self) -> FloatArray | None:
        """How often each of `values` is drawn, summing to 1; None: equally."""
        return None

    def quantile(self, share: FloatArray) -> FloatArray:
        """The value that this share of a continuum lies below; for shares inside (0, 1)."""
        raise NotImplementedError(f"{self.kind} is no continuum")

    def of_unit(self, unit: FloatArray) -> list[Value]:
        """Values for numbers of [0, 1)."""
        if self.values is None:
            inside = np.clip(unit, EPS, 1.0 - EPS)
            drawn: list[Value] = self.quantile(inside).tolist()
            return drawn
        return [self.values[i] for i in self.index_of_unit(unit)]

    def index_of_unit(self, unit: FloatArray) -> list[int]:
        """Places in `values` for numbers of [0, 1)."""
        values = self.values or ()
        weights = self.weights
        if weights is None:
            index = (unit * len(values)).astype(np.int64)
        else:
            index = np.searchsorted(np.cumsum(weights), unit, side="right")
        found: list[int] = np.minimum(index, len(values) - 1).tolist()
        return found

    @property
    def extremes(self) -> list[Value]:
        """Values to try first: all of a short list, else the middle and what may well be drawn."""
        if self.values is not None and len(self.values) <= MOST_TRIED:
            return list(self.values)
        # a normal distribution's ends may be no value of the key, and are never drawn
        return self.of_unit(np.array([0.25, 0.5, 0.75] if self.drawn else [0.0, 0.5, 1.0 - EPS]))


MOST_TRIED = 64


class Listed(Parameter):
    """The values themselves."""

    kind: ClassVar[str] = "values"
    drawn: ClassVar[bool] = False

    given: Values = Field(alias="values", description="every value, in order")

    @property
    def values(self) -> tuple[Value, ...]:
        """As given."""
        return tuple(self.given)


class Range(Parameter):
    """From `low` to `high`: `count` values of it, or, without a count, all of it, evenly."""

    kind: ClassVar[str] = "range"
    drawn: ClassVar[bool] = False

    low: Number
    high: Number
    count: int | None = Field(default=None, ge=2, le=MOST_VALUES)
    spacing: Literal["linear", "log"] = Field(
        default="linear", description="log: equal ratios, not equal differences"
    )

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        _ordered(self.low, self.high, positive=self.spacing == "log")
        if self.values is not None and (there := len(set(self.values))) < len(self.values):
            raise ValueError(
                f"`count` is {self.count}; between {self.low!r} and {self.high!r} there are not "
                f"that many floating-point numbers ({there} were found)"
            )
        return self

    @cached_property
    def values(self) -> tuple[Value, ...] | None:
        """`count` of them, whole numbers if both ends and all steps are."""
        if self.count is None:
            return None
        if self.spacing == "log":
            return tuple(np.geomspace(self.low, self.high, self.count).tolist())
        steps = np.linspace(self.low, self.high, self.count)
        whole = isinstance(self.low, int) and isinstance(self.high, int)
        if whole and (steps == steps.round()).all():  # of a key that counts something
            return tuple(steps.astype(np.int64).tolist())
        return tuple(steps.tolist())

    def quantile(self, share: FloatArray) -> FloatArray:
        """Evenly, or by equal ratios."""
        if self.spacing == "log":
            return _log_uniform(self.low, self.high, share)
        return np.asarray(self.low + (self.high - self.low) * share)


class Uniform(Parameter):
    """Every value between `low` and `high` is equally likely."""

    kind: ClassVar[str] = "uniform"

    distribution: Literal["uniform"]
    low: float
    high: float

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        _ordered(self.low, self.high)
        return self

    def quantile(self, share: FloatArray) -> FloatArray:
        """Evenly."""
        return np.asarray(self.low + (self.high - self.low) * share)


class LogUniform(Parameter):
    """Every order of magnitude between `low` and `high` is equally likely."""

    kind: ClassVar[str] = "log_uniform"

    distribution: Literal["log_uniform"]
    low: float
    high: float

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        _ordered(self.low, self.high, positive=True)
        return self

    def quantile(self, share: FloatArray) -> FloatArray:
        """By equal ratios."""
        return _log_uniform(self.low, self.high, share)


class Normal(Parameter):
    """A normal distribution, cut off at `low` and `high` where they are given."""

    kind: ClassVar[str] = "normal"

    distribution: Literal["normal"]
    mean: float
    std: float = Field(ge=1e-12)
    low: float | None = None
    high: float | None = None

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        if self.low is not None and self.high is not None:
            _ordered(self.low, self.high)
        _, lowest, highest = self._shares()
        if not lowest < highest:
            raise ValueError("between `low` and `high` lies nothing of this distribution")
        return self

    def _shares(self) -> tuple[float, float, float]:
        """1, and the shares below both ends; or, in the upper tail, −1, and those above them.

        Shares near 1 have no digits left for a tail.
        """
        from scipy.special import ndtr

        low = -math.inf if self.low is None else (self.low - self.mean) / self.std
        high = math.inf if self.high is None else (self.high - self.mean) / self.std
        if low > 0.0:
            return -1.0, float(ndtr(-high)), float(ndtr(-low))
        return 1.0, float(ndtr(low)), float(ndtr(high))

    def quantile(self, share: FloatArray) -> FloatArray:
        """Of what lies between `low` and `high`."""
        from scipy.special import ndtri

        sign, low, high = self._shares()
        inside = low + (high - low) * (share if sign > 0.0 else 1.0 - share)
        drawn = self.mean + sign * self.std * ndtri(
            np.clip(inside, np.finfo(float).tiny, 1.0 - EPS)
        )
        return np.asarray(np.clip(drawn, self.low, self.high))


class Choice(Parameter):
    """One of `values`, equally often or by `weights`."""

    kind: ClassVar[str] = "choice"

    distribution: Literal["choice"]
    given: Values = Field(alias="values")
    given_weights: list[Annotated[float, Field(ge=0)]] | None = Field(
        default=None, alias="weights", description="as many as values; their sum is irrelevant"
    )

    @model_validator(mode="after")
    def _goes_together(self) -> Self:
        if self.given_weights is not None:
            if len(self.given_weights) != len(self.given):
                raise ValueError(
                    f"{len(self.given_weights)} weights for {len(self.given)} values; "
                    "give as many as there are values"
                )
            if not sum(self.given_weights) > 0:
                raise ValueError("all weights are 0; let some be positive")
        return self

    @property
    def values(self) -> tuple[Value, ...]:
        """As given."""
        return tuple(self.given)

    @property
    def weights(self) -> FloatArray | None:
        """As given, their sum made 1."""
        if self.given_weights is None:
            return None
        scale = max(self.given_weights) if math.isinf(sum(self.given_weights)) else 1.0
        weights = [weight / scale for weight in self.given_weights]
        return np.array(weights) / sum(weights)


DISTRIBUTIONS: dict[str, type[Parameter]] = {
    "uniform": Uniform,
    "log_uniform": LogUniform,
    "normal": Normal,
    "choice": Choice,
}
FORMS = "{ values = [...] }, { low = ..., high = ..., count = ... } or { distribution = ... }"


def parameter_of(given: dict[str, Any]) -> Parameter | list[Fault]:
    """The parameter that a table describes, or what is wrong with the table."""
    kind = _kind_of(given)
    if isinstance(kind, Fault):
        return [kind]
    try:
        parameter = kind.model_validate(given)
    except ValidationError as error:
        return faults_of(error, kind)
    return parameter if (fault := _mixed(parameter.values)) is None else [fault]


def _kind_of(given: dict[str, Any]) -> type[Parameter] | Fault:
    if "distribution" in given:
        name = given["distribution"]
        if isinstance(name, str) and name in DISTRIBUTIONS:
            return DISTRIBUTIONS[name]
        allowed = ", ".join(map(repr, DISTRIBUTIONS))
        return Fault(key=("distribution",), got=repr(name), allowed=allowed)
    if "values" in given:
        return Listed
    if "low" in given or "high" in given:
        return Range
    return Fault(problem="says no values", allowed=FORMS)


def _mixed(values: tuple[Value, ...] | None) -> Fault | None:
    """A column of the table of results has one type."""
    if values is None:
        return None
    types = {str if isinstance(v, str) else bool if isinstance(v, bool) else float for v in values}
    if len(types) > 1:
        return Fault(
            key=("values",),
            got=short(values),
            allowed="values of one type: numbers, texts, or true and false",
        )
    return None


def short(values: Sequence[object]) -> str:
    """A list in a line."""
    text = ", ".join(map(repr, values))
    return f"[{text}]" if len(text) < 60 else f"[{text[:56]}...]"


def _ordered(low: float, high: float, positive: bool = False) -> None:
    if positive and not low > 0:
        raise ValueError(f"`low` is {low:g}; with equal ratios it has to be positive")
    if not low < high:
        raise ValueError(f"the range is empty: `low` is {low:g} and `high` {high:g}")
    if not np.isfinite(float(high) - float(low)):
        raise ValueError("the range is too long for floating-point numbers")


def _log_uniform(low: float, high: float, share: FloatArray) -> FloatArray:
    drawn = low * np.exp(np.log(high / low) * share)
    return np.asarray(np.clip(drawn, low, high))
