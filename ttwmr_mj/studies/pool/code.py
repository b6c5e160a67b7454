"""The code that computes a result: modules reached by imports, without words that compute nothing.

Modules are found with `ast`, from the entry modules on through every import, those inside functions
and module names in strings included. A module's digest is of its syntax tree without docstrings,
comments and layout. Code without source, built in C or in an archive, does not say what it imports:
its digest is of the file that holds it, and all of its package counts.
"""

import ast
import hashlib
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

import ttwmr_mj
from ttwmr_mj.controllers.shared.own.imports import imported_by, is_for_type_checkers
from ttwmr_mj.controllers.shared.own.modules import (
    OF_PYTHON,
    file_of,
    found,
    is_installed,
    is_namespace,
    modules_within,
)
from ttwmr_mj.errors import Fault, InputError

PACKAGE = Path(ttwmr_mj.__file__).parent
NAME = PACKAGE.name
SILENT = ("recording", "figures", "cli")  # rooms that only draw, record or print

Follows = Callable[[str, str], bool]


def module_file(folder: Path, module: str) -> Path | None:
    """The file of a module or package below a folder, or None."""
    path = folder.joinpath(*module.split("."))
    found = (path.with_name(path.name + ".py"), path / "__init__.py")
    return next((file for file in found if file.is_file()), None)


def follow_all(importer: str, imported: str) -> bool:
    """Every import but those of rooms that compute nothing, and of libraries by this package."""
    if _top(imported) != NAME:
        return _top(importer) != NAME
    return imported.split(".")[1:2] not in [[room] for room in SILENT]


def code_of(
    entries: Iterable[str], follows: Follows = follow_all, folder: Path | None = None
) -> dict[str, str]:
    """Module → digest of everything the entry modules reach, sorted.

    Args:
        entries: names of modules; those that do not exist are left out. Of what is installed, and
            not editable, only their packages count.
        follows: whether an import (importer, imported) leads to code that computes.
        folder: where modules of the user's are looked for before the Python path.

    Raises:
        InputError: code of an entry's package is in no file.
    """
    digests: dict[str, str] = {}
    # the package's own __init__ is a directory of names, and computes nothing
    waiting, seen = list(entries), {NAME}
    packages = {_top(name) for name in waiting}
    while waiting:
        name = waiting.pop()
        path = None if name in seen else _file(name, folder, packages)
        seen.add(name)
        if path is None:
            continue
        digests[name], imported = _read(path, _version(path), name)
        if imported is None:
            imported = tuple(modules_within(_top(name), folder))
        parents = [name.rsplit(".", depth)[0] for depth in range(1, name.count(".") + 1)]
        waiting += [other for other in (*imported, *parents) if follows(name, other)]
    return dict(sorted(digests.items()))


def _top(module: str) -> str:
    return module.partition(".")[0]


def _file(module: str, folder: Path | None, packages: set[str]) -> Path | None:
    """The file that holds a module, None if it does not count."""
    if _top(module) == NAME:
        return module_file(PACKAGE.parent, module)
    spec = found(module, folder)
    if spec is None or is_namespace(spec) or spec.origin in OF_PYTHON:
        return None
    file, chosen = file_of(spec), _top(module) in packages
    if file is None and chosen:
        problem = f"the code of {module} is in no file, and nobody could tell when it changes"
        raise InputError(Fault(problem=problem, hint="`ttwmr run` runs it"))
    return file if file is not None and (chosen or not is_installed(file)) else None


def _version(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@cache
def _read(path: Path, version: tuple[int, int], name: str) -> tuple[str, tuple[str, ...] | None]:
    """Digest of a module, and names of what it may import; read again where it has changed.

    None in place of names: nobody can tell.
    """
    del version
    content = path.read_bytes()
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError):  # no Python source
        return _digest(content), None
    _Computing().visit(tree)  # in place
    return _digest(ast.dump(tree).encode()), tuple(
        sorted({*imported_by(tree, name, path), *_named(tree)})
    )


def _named(tree: ast.AST) -> Iterator[str]:
    """Modules of this package that are named in strings."""
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str(text)) if text.startswith(f"{NAME}."):
                yield text.partition(":")[0]


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


class _Computing(ast.NodeTransformer):
    """Takes out docstrings, and imports for type checkers."""

    def visit(self, node: ast.AST) -> ast.AST | list[ast.AST] | None:
        body = getattr(node, "body", None)
        if isinstance(body, list) and not isinstance(node, ast.If) and _is_text(body[:1]):
            del body[0]
        self.generic_visit(node)
        if is_for_type_checkers(node):
            return list(node.orelse)
        return node


def _is_text(first: list[ast.stmt]) -> bool:
    return any(
        isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)
        for node in first
    )
