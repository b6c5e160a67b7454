"""Kinds by name: one file each in a package of this project, or added by an installed package.

A law or a reference is found because its file is there. Another distribution adds its own by an
entry point in the registry's group, whose value is the class. One that cannot be used is left out,
with a warning, so that it spoils nothing else; what its code raises later is told as its own.
"""

import importlib
import inspect
import operator
import pkgutil
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from functools import cached_property, reduce
from importlib.metadata import EntryPoint, entry_points
from typing import Annotated, Any, Generic, TypeVar, cast

from pydantic import BaseModel, Field

from ttwmr_mj.config import PATTERNS, WORD
from ttwmr_mj.deadline import described_within, limited
from ttwmr_mj.errors import InputError, Overrun, cut, in_one_line, strangers

T = TypeVar("T", bound=BaseModel)

OWN = __name__.partition(".")[0]
LIMIT_S = 30.0  # of CPU time, for one call of another package's code outside the loop
REPAIR = "repair or uninstall that package"


class LeftOut(UserWarning):
    """An installed package adds something that cannot be used, and goes without it."""


class _UnfitError(Exception):
    """Why a class that a package adds cannot be used."""


class Registry(Mapping[str, type[T]], Generic[T]):
    """Name → class, sorted by name; read when first asked for.

    Args:
        package: whose modules are looked through.
        base: what every class derives from.
        kind_of: the name of a class; None: the class is no kind of its own.
        group: of the entry points.
        lacks: what a class of another package lacks, in words; empty: nothing.
    """

    def __init__(
        self,
        package: str,
        base: type[T],
        kind_of: Callable[[type[T]], str | None],
        group: str,
        lacks: Callable[[type[T]], str] = lambda _: "",
    ) -> None:
        self._package, self._base, self._kind_of, self.group = package, base, kind_of, group
        self._lacks = lacks

    def __getitem__(self, kind: str) -> type[T]:
        return self._classes[kind]

    def __iter__(self) -> Iterator[str]:
        return iter(self._classes)

    def __len__(self) -> int:
        return len(self._classes)

    def one_of(self) -> Any:
        """The type of a field that holds any of them, told apart by their `kind`."""
        return Annotated[reduce(operator.or_, self.values()), Field(discriminator="kind")]

    @cached_property
    def _classes(self) -> dict[str, type[T]]:
        found: dict[str, type[T]] = {}
        for cls in self._own():
            if (kind := self._kind_of(cls)) is not None:
                assert kind not in found, f"two classes of this package are called {kind!r}"
                found[kind] = cls
        for point in sorted(entry_points(group=self.group), key=_package_of):
            try:
                cls = self._loaded(point)
                other = found.setdefault(point.name, cls)
                if other is not cls:  # the same may be installed twice
                    taken = f"{other.__module__}:{other.__qualname__}"
                    raise _UnfitError(f"that name is taken by {taken}")
            except _UnfitError as unfit:
                name, value = cut(point.name), cut(point.value)
                told = f"{self.group}: {name} = {value}, which {_package_of(point)} adds, is left"
                told = in_one_line(f"{told} out: {unfit}; {REPAIR}")
                warnings.warn(told, LeftOut, stacklevel=1)  # told of here, not of who asked
        return dict(sorted(found.items()))

    def _own(self) -> Iterator[type[T]]:
        package = importlib.import_module(self._package)
        for info in pkgutil.iter_modules(package.__path__, self._package + "."):
            if info.ispkg:
                continue
            module = importlib.import_module(info.name)
            for cls in vars(module).values():
                if self._is_one(cls) and cls.__module__ == info.name:
                    yield cls

    def _loaded(self, point: EntryPoint) -> type[T]:
        """The class, looked at.

        Raises:
            _UnfitError: it cannot be used.
        """
        if not re.fullmatch(WORD, point.name):
            raise _UnfitError(f"allowed as a name: {PATTERNS[WORD]}")
        if not EntryPoint.pattern.match(point.value):
            raise _UnfitError("allowed as a value: module:Class")
        strangers.append(_package_of(point))
        try:
            # our output may be read by a machine
            with limited(LIMIT_S), redirect_stdout(sys.stderr):
                cls = point.load()
                if not self._is_one(cls) or self._kind_of(cls) != point.name:
                    raise _UnfitError(f"it is not a concrete {self._base.__name__} of that kind")
                if lacks := self._lacks(cls):
                    raise _UnfitError(lacks)
                for mode in ("validation", "serialization"):
                    cls.model_json_schema(mode=mode)
        except (_UnfitError, KeyboardInterrupt):
            raise
        except BaseException as error:  # another package may raise anything, and leave
            words = described_within(LIMIT_S, error).splitlines()[0]
            raise _UnfitError(f"loading it raised {words}") from error
        return cast("type[T]", cls)

    def _is_one(self, cls: Any) -> bool:
        return inspect.isclass(cls) and issubclass(cls, self._base) and not inspect.isabstract(cls)


def is_foreign(cls: type) -> bool:
    """Whether a class is not of this package."""
    return cls.__module__.partition(".")[0] != OWN


@contextmanager
def guarded(cls: type, key: str, call: str, *, has_limit: bool = False) -> Iterator[None]:
    """Tell what code of another package does wrong as a fault of the input that asks for it.

    Args:
        cls: whose code it is; that of this package is left alone.
        key: of the scenario, where the class was asked for.
        call: what is called, for the message.
        has_limit: whoever calls has limited its time; else LIMIT_S does.

    Raises:
        InputError: it raised anything, or took too long.
    """
    if not is_foreign(cls):
        yield
        return
    name = f"{cls.__module__}:{cls.__qualname__}"
    strangers.append(name)
    try:
        if has_limit:
            yield
        else:
            with limited(LIMIT_S):
                yield
    except (InputError, KeyboardInterrupt):
        raise
    except Overrun:
        if has_limit:
            raise
        problem = f"{call} of {name} timed out after {LIMIT_S:g} s"
        raise InputError.at(key, problem, hint=REPAIR) from None
    except BaseException as error:
        problem = f"{call} of {name} raised {described_within(LIMIT_S, error)}"
        raise InputError.at(key, problem, hint=REPAIR) from error


def _package_of(point: EntryPoint) -> str:
    """The distribution that adds it."""
    name = point.dist.metadata["Name"] if point.dist is not None else None
    return f"the package {cut(name)}" if name else "a package without a name"
