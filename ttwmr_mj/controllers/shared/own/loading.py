"""The import of a user's law: from the file that its scenario means, as that file is now.

Python keeps every module under its name, from whatever folder it came. So the modules that laws
have brought in are forgotten, all of them, as soon as one was changed or is another file as seen
from the folder of the law that is asked for. What others have imported stays, and a law that has
its name, or that imports another file of that name, is refused.
"""

import importlib
import sys
from contextlib import suppress
from importlib.machinery import ModuleSpec
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import NamedTuple

from ttwmr_mj.controllers.shared.own.imports import OURS, reached
from ttwmr_mj.controllers.shared.own.modules import (
    OF_PYTHON,
    file_of,
    file_within,
    found,
    is_installed,
    is_namespace,
)
from ttwmr_mj.errors import Fault, InputError, Overrun, described
from ttwmr_mj.files import resolved

KEY = ("controller", "target")


class Brought(NamedTuple):
    """A module that a law has brought in."""

    module: ModuleType
    spec: ModuleSpec
    version: tuple[int, int] | None  # of its file


_brought: dict[str, Brought] = {}
_one_at_a_time = RLock()  # sys.path and sys.modules are of all threads; a law may load another


def load(target: str, folder: Path) -> ModuleType:
    """The module of a law, imported from a folder or the Python path.

    Args:
        target: module:Class.
        folder: where its modules are looked for first; absolute.

    Raises:
        InputError: it cannot be imported, or its name is taken.
        Overrun: from within the module; whoever calls may have set a deadline.
    """
    module, got = target.partition(":")[0], repr(target)
    with _one_at_a_time:
        importlib.invalidate_caches()  # folder and file may be new
        _forget_the_old(folder)
        taken = name_taken(target, folder)
        if taken is not None:
            raise InputError(taken)
        before = {*sys.modules}
        sys.path.insert(0, str(folder))
        try:
            return importlib.import_module(module)
        except (KeyboardInterrupt, Overrun):
            raise
        except BaseException as error:  # a user's module may raise anything, and leave
            problem = f"importing {module} raised {described(error)}"
            fault = Fault(key=KEY, got=got, problem=problem, hint=where_to_be(folder))
            raise InputError(fault) from error
        finally:
            with suppress(ValueError):  # the module may have changed the path
                sys.path.remove(str(folder))
            _remember({*sys.modules} - before)


def where_to_be(folder: Path) -> str:
    """Where a law must be to be found."""
    return (
        f"it must be beside the scenario, here in {folder} (scripts say where with "
        "scenario_folder), in the folder that controller.folder names, or on the Python path"
    )


def name_taken(target: str, folder: Path) -> Fault | None:
    """That an import of a law, or one of its own, would not read the file that it should.

    Names of what is installed are taken whether or not anybody has imported them yet: all who do
    so later would get the law's.
    """
    installed = [place for place in sys.path if is_installed(Path(place))]
    of_others = {*sys.modules} - {*_brought}
    for name in reached(target.partition(":")[0], folder, of_others):
        spec = found(name, folder)
        seen = file_of(spec) if spec is not None else None
        wanted = file_within(name, [str(folder)]) or seen
        if spec is None or wanted is None or is_installed(wanted):
            continue
        hint = f"give {wanted} another name"
        if spec.origin in OF_PYTHON:
            problem = f"{name} is built into Python, and no file is imported by that name"
            return Fault(key=KEY, got=repr(target), problem=problem, hint=hint)
        for other in (
            _in_process(name) if name in of_others else None,
            seen,
            file_within(name, installed),
        ):
            if other is not None and resolved(other) != resolved(wanted):
                problem = f"{name} is the name of {other} already, which may be in use"
                return Fault(key=KEY, got=repr(target), problem=problem, hint=hint)
    return None


def _in_process(name: str) -> Path | None:
    """The file or folder that was imported under a name; None: there is none."""
    spec = getattr(sys.modules.get(name), "__spec__", None)
    if spec is None or not is_namespace(spec):
        return file_of(spec) if spec is not None else None
    return next(map(Path, spec.submodule_search_locations), None)


def _forget_the_old(folder: Path) -> None:
    for name, kept in [*_brought.items()]:
        if sys.modules.get(name) is not kept.module:  # somebody has imported it anew
            del _brought[name]
    if not any(_is_old(name, kept, folder) for name, kept in _brought.items()):
        return
    for name, kept in _brought.items():
        sys.modules.pop(name, None)
        if kept.spec.cached and _version(kept.spec) != kept.version:
            # bytecode is taken for current where the second and the size of its source are
            with suppress(OSError):
                Path(kept.spec.cached).unlink()
    _brought.clear()


def _is_old(name: str, kept: Brought, folder: Path) -> bool:
    """Whether an import from the folder would read something else now."""
    spec = found(name, folder)
    if spec is None or spec is kept.spec:  # nowhere but where it was kept
        return True
    return file_of(spec) != file_of(kept.spec) or _version(kept.spec) != kept.version


def _remember(names: set[str]) -> None:
    """Of new modules those that are neither installed nor this package's."""
    for name in names:
        module = sys.modules.get(name)
        spec = getattr(module, "__spec__", None)
        if not isinstance(module, ModuleType) or spec is None or name.partition(".")[0] == OURS:
            continue
        places = spec.submodule_search_locations if is_namespace(spec) else [file_of(spec)]
        if not any(place is None or is_installed(Path(place)) for place in places):
            _brought[name] = Brought(module, spec, _version(spec))


def _version(spec: ModuleSpec) -> tuple[int, int] | None:
    file = file_of(spec)
    status = file.stat() if file is not None else None
    return (status.st_mtime_ns, status.st_size) if status is not None else None
