"""Where the code of modules is, asked of Python's import system without running any of it.

So a module is found wherever an import would find it: in a folder, in an archive, or by a finder
that an editable installation left.
"""

import os
import pkgutil
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from ttwmr_mj.files import resolved

OF_PYTHON = ("built-in", "frozen")  # what the import system says of modules in the interpreter
INSTALLED = ("site-packages", "dist-packages")  # where code lies that nobody edits
STANDARD = {resolved(Path(sysconfig.get_path(name))) for name in ("stdlib", "platstdlib")}


def found(module: str, folder: Path | None = None) -> ModuleSpec | None:
    """What an import of a module would load; None if there is no such module.

    Args:
        module: its full name.
        folder: looked through before the Python path; None: the Python path alone.
    """
    above = module.rpartition(".")[0]
    package = found(above, folder) if above else None
    if above and package is None:
        return None
    if package is None:
        places = [*([str(folder)] if folder else []), *sys.path]
    else:
        places = [*(package.submodule_search_locations or ())]
    for finder in sys.meta_path:
        if finder is PathFinder:  # of a package within one it asks as if that had been imported
            spec = _on_paths(module, places)
        else:
            spec = finder.find_spec(module, places if above else None)
        if spec is not None:
            return spec
    if module not in sys.modules:
        return None
    # what a package's code has made
    return sys.modules[module].__spec__ or ModuleSpec(module, None)


def file_within(module: str, places: Iterable[str]) -> Path | None:
    """The file of a module as an import would find it if there were no other folders than these."""
    spec = None
    for end in (*(at for at, sign in enumerate(module) if sign == "."), len(module)):
        spec = _on_paths(module[:end], places)
        places = (spec.submodule_search_locations if spec is not None else None) or ()
    return file_of(spec) if spec is not None else None


def file_of(spec: ModuleSpec) -> Path | None:
    """The file that holds a module: its own, or the archive that it is in; None: it is in none."""
    origin = Path(spec.origin or "")
    return next((path for path in (origin, *origin.parents) if path.is_file()), None)


def is_namespace(spec: ModuleSpec) -> bool:
    """Whether a package is but the folders of others, without code of its own."""
    return spec.submodule_search_locations is not None and spec.origin is None


def is_installed(file: Path) -> bool:
    """Whether a file is Python's own, or of a distribution that is not installed editable."""
    here = resolved(file)
    return not {*INSTALLED}.isdisjoint(here.parts) or any(map(here.is_relative_to, STANDARD))


def modules_within(package: str, folder: Path | None = None) -> Iterator[str]:
    """Full names of all modules in a package, at any depth."""
    spec = found(package, folder)
    locations = spec.submodule_search_locations if spec is not None else None
    for info in pkgutil.iter_modules([*(locations or ())], f"{package}."):
        yield info.name
        if info.ispkg:
            yield from modules_within(info.name, folder)


def _on_paths(module: str, places: Iterable[str]) -> ModuleSpec | None:
    """As `PathFinder` finds a module in these places, the parts of a namespace together."""
    parts: list[str] = []
    for place in places:
        finder = pkgutil.get_importer(place or os.getcwd())  # noqa: PTH109
        spec = finder.find_spec(module) if finder is not None else None
        if spec is not None and spec.loader is not None:
            return spec
        parts += (spec is not None and spec.submodule_search_locations) or []
    if not parts:
        return None
    namespace = ModuleSpec(module, None, is_package=True)
    namespace.submodule_search_locations = parts
    return namespace
