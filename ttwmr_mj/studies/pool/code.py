"""The code that computes a result: modules reached by imports, without words that compute nothing.

Modules are found with `ast`, from the entry modules on through every import, those inside functions
and module names in strings included. A module's digest is of its syntax tree without docstrings,
comments and layout.
"""

import ast
import hashlib
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

import ttwmr_mj

PACKAGE = Path(ttwmr_mj.__file__).parent
NAME = PACKAGE.name
SILENT = ("recording", "figures", "cli")  # rooms that only draw, record or print

Follows = Callable[[str, str], bool]


Own = tuple[tuple[Path, str], ...]
"""Folders of modules that are not this package's, and the top-level name that counts there, or ""
where every module does."""


def source(module: str, own: Own = ()) -> Path | None:
    """The module's file; None if it is neither this package's nor one of the user's own."""
    top = module.split(".")[0]
    places = ((PACKAGE.parent, NAME),) if top == NAME else own
    found = (module_file(folder, module) for folder, name in places if name in ("", top))
    return next((file for file in found if file), None)


def module_file(folder: Path, module: str) -> Path | None:
    """The file of a module or package below a folder, or None."""
    path = folder.joinpath(*module.split("."))
    found = (path.with_name(path.name + ".py"), path / "__init__.py")
    return next((file for file in found if file.is_file()), None)


def follow_all(importer: str, imported: str) -> bool:
    """Every import but those of rooms that compute nothing."""
    del importer
    return imported.split(".")[1:2] not in [[room] for room in SILENT]


def code_of(entries: Iterable[str], follows: Follows = follow_all, own: Own = ()) -> dict[str, str]:
    """Module → digest of everything the entry modules reach, sorted.

    Args:
        entries: names of modules; those that do not exist are left out.
        follows: whether an import (importer, imported) leads to code that computes.
        own: where modules of the user's are.
    """
    found: dict[str, str] = {}
    # the package's own __init__ is a directory of names, and computes nothing
    waiting, seen = list(entries), {NAME}
    while waiting:
        name = waiting.pop()
        path = None if name in seen else source(name, own)
        seen.add(name)
        if path is None:
            continue
        found[name], imported = _read(path, _version(path), name)
        parents = [name.rsplit(".", depth)[0] for depth in range(1, name.count(".") + 1)]
        waiting += [other for other in (*imported, *parents) if follows(name, other)]
    return dict(sorted(found.items()))


def _version(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@cache
def _read(path: Path, version: tuple[int, int], name: str) -> tuple[str, tuple[str, ...]]:
    """Digest of a module, and names of what it may import; read again where it has changed."""
    del version
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    _Computing().visit(tree)  # in place
    digest = hashlib.sha256(ast.dump(tree).encode()).hexdigest()[:16]
    return digest, tuple(sorted(set(_imported(tree, package))))


def _imported(tree: ast.AST, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=module, names=names, level=level):
                above = package.split(".")[: package.count(".") + 2 - level] if level else []
                base = ".".join([*above, *([module] if module else [])])
                yield base
                yield from (f"{base}.{alias.name}" for alias in names)
            case ast.Constant(value=str(text)) if text.startswith(f"{NAME}."):
                yield text.partition(":")[0]


class _Computing(ast.NodeTransformer):
    """Takes out docstrings, and imports for type checkers."""

    def visit(self, node: ast.AST) -> ast.AST | list[ast.AST] | None:
        body = getattr(node, "body", None)
        if isinstance(body, list) and not isinstance(node, ast.If) and _is_text(body[:1]):
            del body[0]
        self.generic_visit(node)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            return list(node.orelse)
        return node


def _is_text(first: list[ast.stmt]) -> bool:
    return any(
        isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)
        for node in first
    )
