"""What modules import, read from their source: no line of it is run."""

import ast
from collections.abc import Container, Iterator
from functools import cache
from pathlib import Path
from typing import TypeGuard

from ttwmr_mj.controllers.shared.own.modules import file_of, found, is_installed

OURS = __name__.partition(".")[0]


def reached(module: str, folder: Path, loaded: Container[str]) -> Iterator[str]:
    """Names of what a module may import, itself first, through all code that is not installed.

    This package is left out.

    Args:
        module: its full name.
        folder: looked through before the Python path.
        loaded: modules whose code has run; what it has imported is not told.
    """
    waiting, seen = [module], set[str]()
    while waiting:
        name = waiting.pop()
        if name in seen or name.partition(".")[0] == OURS:
            continue
        seen.add(name)
        yield name
        waiting += [name.rpartition(".")[0]] if "." in name else []
        spec = found(name, folder) if name not in loaded else None
        file = file_of(spec) if spec is not None else None
        if file is not None and not is_installed(file):
            status = file.stat()
            waiting += _imports(file, name, (status.st_mtime_ns, status.st_size))


def imported_by(tree: ast.AST, name: str, file: Path) -> Iterator[str]:
    """Full names of all modules that a module's code may import, within functions too."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    waiting = [tree]  # no recursion: expressions may be nested as deep as Python can read
    while waiting:
        node = waiting.pop()
        waiting += node.orelse if is_for_type_checkers(node) else ast.iter_child_nodes(node)
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=module, names=names, level=level):
                if level > len([*filter(None, package.split("."))]):
                    continue  # above the outermost package there is nothing
                above = package.split(".")[: package.count(".") + 2 - level] if level else []
                base = ".".join([*above, *([module] if module else [])])
                yield base
                yield from (f"{base}.{alias.name}" for alias in names)


def is_for_type_checkers(node: ast.AST) -> TypeGuard[ast.If]:
    """Whether a run leaves out the statement's body."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING")):
            return True
    return False


@cache
def _imports(file: Path, name: str, version: tuple[int, int]) -> tuple[str, ...]:
    """What a module imports as its file is now; nothing where it is no source that can be read."""
    del version
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return ()  # the import tells
    return tuple(dict.fromkeys(imported_by(tree, name, file)))
