"""What every configuration is: frozen, strict and closed to unknown keys; and several as one."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from types import FunctionType, MethodType
from typing import Any, ClassVar, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

T = TypeVar("T")

NAME = r"^[a-z0-9][a-z0-9_-]{0,63}$"  # of files' contents, which become folders
WORD = r"^[a-z0-9][a-z0-9_]{0,63}$"  # of what they hold, which become columns and parts of names
PATTERNS = {
    NAME: "up to 64 lower-case letters, digits, - and _, a letter or digit first",
    WORD: "up to 64 lower-case letters, digits and _, a letter or digit first",
}


class Config(BaseModel):
    """Base of every configuration: frozen, strict about types, closed to unknown keys.

    Attributes:
        same_in_batch: fields whose numbers must be equal in all simulations of a batch, such as
            the steps of time; others may differ where all or none are zero.
        free_in_batch: fields that may differ whatever they are: each simulation's model is built
            with its own, and nothing else reads them.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True
    )
    same_in_batch: ClassVar[frozenset[str]] = frozenset()
    free_in_batch: ClassVar[frozenset[str]] = frozenset()

    @classmethod
    def summary(cls) -> str:
        """The first sentence of its description."""
        return " ".join((cls.__doc__ or "").split("\n\n")[0].split()).rstrip(".")


def requires_kind(schema: dict[str, Any]) -> None:
    """Say in a table's JSON Schema that its `kind` must be given, where only scripts may not."""
    schema["properties"]["kind"].pop("default", None)
    schema["required"] = ["kind", *(key for key in schema.get("required", []) if key != "kind")]


class Stack:
    """Configurations of as many simulations, to be read like one of them.

    What is equal in all reads as itself, numbers that differ as an array (nsim,), tables as stacks
    again. A property is that of every row, so its bits are those of the row alone. A method gets
    the stack for its self: it works if it does array arithmetic.
    """

    def __init__(self, rows: Sequence[Config], *, columns: bool = False) -> None:
        self.rows, self._columns = tuple(rows), columns
        self._known: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # as copy and pickle ask for them
            raise AttributeError(name)
        if name not in self._known:
            method = getattr(type(self.rows[0]), name, None)
            if isinstance(method, FunctionType):
                return MethodType(method, self)
            value = stacked([getattr(row, name) for row in self.rows])
            self._known[name] = _columns_of(value) if self._columns else value
        return self._known[name]

    def model_copy(self, *, update: dict[str, Any]) -> Self:
        """Every row with other tables or numbers; stacks among them are taken apart."""
        rows = [
            row.model_copy(update={key: _row_of(value, i) for key, value in update.items()})
            for i, row in enumerate(self.rows)
        ]
        return type(self)(rows, columns=self._columns)


def stacked(rows: Sequence[T]) -> T:
    """One value for as many simulations: itself where it is equal in all, else as `Stack` says.

    Args:
        rows: of one kind: numbers, arrays of one shape, configurations, or tuples, lists and
            tables of such.

    Raises:
        TypeError: they differ in more than numbers.
    """
    first = rows[0]
    if all(row is first for row in rows):
        return first
    if isinstance(first, Config):
        return first if all(row == first for row in rows) else cast("T", Stack(rows))  # type: ignore[arg-type]
    if isinstance(first, float):
        numbers = np.array(rows)
        same = bool((numbers == first).all()) and len(set(np.signbit(numbers).tolist())) == 1
        return first if same else cast("T", numbers)
    if isinstance(first, np.ndarray):
        return cast("T", np.stack(cast("Sequence[Any]", rows)))
    if isinstance(first, tuple):
        parts = [stacked(part) for part in zip(*cast("Sequence[Any]", rows), strict=True)]
        return cast("T", type(first)(*parts) if hasattr(first, "_fields") else tuple(parts))
    if isinstance(first, list):
        return cast("T", [stacked(part) for part in zip(*cast("Any", rows), strict=True)])
    if isinstance(first, dict):
        return cast("T", {name: stacked([row[name] for row in rows]) for name in first})  # type: ignore[index]
    if any(row != first for row in rows):
        raise TypeError(f"simulations of one batch cannot differ in {first!r}")
    return first


def each(function: Callable[..., T], *values: Any) -> T:
    """A function of configurations, of every row where some are stacks; results are stacked."""
    nsim = next((len(value.rows) for value in values if isinstance(value, Stack)), 0)
    if not nsim:
        return function(*values)
    found: dict[tuple[int, ...], T] = {}
    rows = [tuple(_row_of(value, i) for value in values) for i in range(nsim)]
    for row in rows:
        key = tuple(map(id, row))
        if key not in found:
            found[key] = function(*row)
    return stacked([found[tuple(map(id, row))] for row in rows])


def rows_of(config: T, nsim: int) -> tuple[T, ...]:
    """The configuration of each simulation."""
    return cast("tuple[T, ...]", config.rows) if isinstance(config, Stack) else (config,) * nsim


def picked(value: T, which: NDArray[np.bool_]) -> T:
    """Numbers or a stack, of some of the simulations (nsim,); what all share stays as it is."""
    if isinstance(value, Stack):
        rows = [row for row, kept in zip(value.rows, which, strict=True) if kept]
        return cast("T", Stack(rows, columns=value._columns))
    return cast("T", value[which]) if isinstance(value, np.ndarray) else value


def columns(config: T) -> T:
    """The same with numbers that differ as (nsim, 1), for arrays (nsim, any)."""
    return cast("T", Stack(config.rows, columns=True)) if isinstance(config, Stack) else config


def column(number: T) -> T:
    """One number as it is, (nsim, ...) of them as (nsim, 1, ...)."""
    return cast("T", number[:, None]) if isinstance(number, np.ndarray) else number


def frozen(value: Any) -> Hashable:
    """A key for a value, whatever it is made of: equal for equal values of equal types.

    So 1, 1.0 and True have different ones, 0.0 and -0.0, and tables in another order.
    """
    key: Hashable
    match value:
        case float():
            key = repr(value)
        case tuple() | list():
            key = tuple(map(frozen, value))
        case set() | frozenset():
            key = frozenset(map(frozen, value))
        case dict():
            key = tuple((frozen(name), frozen(part)) for name, part in value.items())
        case BaseModel():
            key = tuple((name, frozen(part)) for name, part in value)
        case _:
            key = value if _has_hash(value) else id(value)
    return type(value), key


def _has_hash(value: Any) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True


def batch_shape(value: Any) -> Hashable:
    """What must be equal for values to share a batch: all but numbers, and zeros.

    Zero often means that there is no such thing, and what is not there is not computed.
    """
    match value:
        case float() if value != 0.0:
            return float
        case tuple() | list():
            return type(value), tuple(map(batch_shape, value))
        case dict():
            parts = ((frozen(name), batch_shape(part)) for name, part in value.items())
            return dict, tuple(parts)
        case Config():
            fixed = type(value).same_in_batch
            names = sorted(type(value).model_fields.keys() - type(value).free_in_batch)
            read = [(frozen if n in fixed else batch_shape, getattr(value, n)) for n in names]
            return type(value), tuple(key_of(part) for key_of, part in read)
    return frozen(value)


def _row_of(value: Any, index: int) -> Any:
    return value.rows[index] if isinstance(value, Stack) else value


def _columns_of(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value[:, None]
    if isinstance(value, tuple):
        return tuple(map(_columns_of, value))
    if isinstance(value, list):
        return [_columns_of(part) for part in value]
    if isinstance(value, dict):
        return {name: _columns_of(part) for name, part in value.items()}
    return columns(value)
