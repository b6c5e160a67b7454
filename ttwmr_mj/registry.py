"""Kinds by name: one file each in a package of this project, or added by an installed package.

A law or a reference is found because its file is there. Another distribution adds its own by an
entry point in the registry's group, whose value is the class.
"""

import importlib
import inspect
import operator
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, reduce
from importlib.metadata import entry_points
from typing import Annotated, Any, Generic, TypeVar

from pydantic import Field

from ttwmr_mj.errors import InputError

T = TypeVar("T")


class Registry(Mapping[str, type[T]], Generic[T]):
    """Name → class, sorted by name; read when first asked for.

    Args:
        package: whose modules are looked through.
        base: what every class derives from.
        kind_of: the name of a class; None: the class is no kind of its own.
        group: of the entry points.
    """

    def __init__(
        self, package: str, base: type[T], kind_of: Callable[[type[T]], str | None], group: str
    ) -> None:
        self._package, self._base, self._kind_of, self.group = package, base, kind_of, group

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
        for cls in (*self._own(), *self._added()):
            kind = self._kind_of(cls)
            if kind is None:
                continue
            if kind in found:
                taken = f"{found[kind].__module__}:{found[kind].__qualname__}"
                raise InputError(
                    f"{self.group}: two classes are called {kind!r}, {taken} and "
                    f"{cls.__module__}:{cls.__qualname__}; rename or uninstall one"
                )
            found[kind] = cls
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

    def _added(self) -> Iterator[type[T]]:
        for point in entry_points(group=self.group):
            try:
                cls = point.load()
            except Exception as error:  # another package may raise anything
                raise InputError(
                    f"{self.group}: loading {point.name} = {point.value!r} raised "
                    f"{type(error).__name__}: {error}; repair or uninstall that package"
                ) from error
            if not self._is_one(cls) or self._kind_of(cls) != point.name:
                raise InputError(
                    f"{self.group}: {point.name} = {point.value!r} is not a concrete "
                    f"{self._base.__name__} of that kind; repair or uninstall that package"
                )
            yield cls

    def _is_one(self, cls: Any) -> bool:
        return inspect.isclass(cls) and issubclass(cls, self._base) and not inspect.isabstract(cls)
