"""The axes of a sweep: what [parameters], [[together]] and [belief] vary, and what they hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ttwmr_mj.errors import Fault, Keys
from ttwmr_mj.studies.sweep.plan.parameters import (
    DISTRIBUTIONS,
    Listed,
    Parameter,
    Range,
    parameter_of,
    short,
)

Table = dict[str, Any]
KINDS: tuple[type[Parameter], ...] = (Listed, Range, *DISTRIBUTIONS.values())
FIELDS = {field.alias or name for kind in KINDS for name, field in kind.model_fields.items()}
OWN_KEYS = ("seed", "seeds", "name", "description", "schema_version")  # no parameters


@dataclass(frozen=True, slots=True)
class Axis:
    """Parameters that vary together, as one.

    Attributes:
        parameters: key of the scenario → what it may be.
    """

    parameters: dict[str, Parameter]

    @property
    def name(self) -> str:
        """Its keys."""
        return " & ".join(self.parameters)

    @property
    def count(self) -> int | None:
        """How many values there are; None if there is a continuum."""
        values = next(iter(self.parameters.values())).values
        return None if values is None else len(values)

    @property
    def drawn(self) -> bool:
        """Whether it has a distribution, of which a grid draws one value for each seed."""
        return next(iter(self.parameters.values())).drawn


def split_belief(given: Table, faults: list[Fault]) -> tuple[list[str], Table]:
    """[belief] as overrides, where it holds values, and as a table of parameters.

    A key that is there twice, with quotes and without, is added to the faults.
    """
    constants, varied, seen = [], {}, set[str]()
    for path, entry in flattened(given, values=True):
        if path in seen:
            faults.append(Fault(key=("belief", path), problem="given twice", hint="give it once"))
        elif isinstance(entry, dict):
            varied[f"belief.{path}"] = entry
        else:
            constants.append(f"belief.{path}={as_toml(entry)}")
        seen.add(path)
    return constants, varied


def as_toml(value: Any) -> str:
    """A value as TOML writes it."""
    import tomli_w

    return tomli_w.dumps({"value": value}).partition("=")[2].strip()


def flattened(given: Table, outer: str = "", *, values: bool = False) -> Iterator[tuple[str, Any]]:
    """Dotted path and entry: a table that describes a parameter, or a value.

    TOML makes tables of a dotted key without quotes; they are taken for the path that was meant.

    Args:
        given: a table of the file.
        outer: path of that table.
        values: whether a table that says nothing of a parameter holds values.
    """
    for key, entry in given.items():
        path = f"{outer}.{key}" if outer else key
        if isinstance(entry, dict) and (
            any(isinstance(inner, dict) for inner in entry.values())
            or (values and not FIELDS & entry.keys())
        ):
            yield from flattened(entry, path, values=values)
        else:
            yield path, entry


def axes_of(
    parameters: Table, believed: Table, together: list[Table], faults: list[Fault]
) -> Iterator[Axis]:
    """What is varied, in the order of the file; faults are added to the list."""
    groups: list[tuple[Keys, list[tuple[str, Any]]]] = []
    for path, given in flattened(parameters):
        groups.append((("parameters",), [(path, given)]))
    for path, given in believed.items():
        groups.append((("belief",), [(path, given)]))
    for i, table in enumerate(together):
        groups.append((("together", i), list(flattened(table))))
    seen: set[str] = set()
    for where, group in groups:
        axis = {}
        for path, given in group:
            key = (*where, path.removeprefix("belief.") if where == ("belief",) else path)
            found = _parameter(given) if path not in seen else [Fault(problem="varied twice")]
            if path in OWN_KEYS:
                hint = "seeds are given in `seeds`" if path.startswith("seed") else ""
                found = [Fault(problem="cannot be varied", hint=hint)]
            seen.add(path)
            if isinstance(found, list):
                faults += [fault.within(*key) for fault in found]
            else:
                axis[path] = found
        if len(axis) == len(group) and axis:
            faults += (fault.within(*where) for fault in _repeated(Axis(axis)))
            yield Axis(axis)


def _repeated(axis: Axis) -> Iterator[Fault]:
    """Nothing is computed twice; of keys that vary together one may repeat what others do not."""
    columns = [p.values for p in axis.parameters.values() if p.values is not None]
    cells = list(zip(*columns, strict=False))
    if len(set(cells)) < len(cells):
        hint = "leave out what is repeated; for repetitions give more seeds"
        first = next(iter(axis.parameters))
        key = (first.removeprefix("belief."), "values") if len(axis.parameters) == 1 else ()
        got = short([cell[0] if len(cell) == 1 else cell for cell in cells])
        yield Fault(key=key, got=got, problem="a value twice", hint=hint)


def _parameter(given: Any) -> Parameter | list[Fault]:
    if isinstance(given, dict):
        return parameter_of(given)
    hint = f"a fixed value goes into overrides; to vary it give {{ values = [{given!r}, ...] }}"
    return [Fault(got=repr(given), problem="says no values", hint=hint)]
