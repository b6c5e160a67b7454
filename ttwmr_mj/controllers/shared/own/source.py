"""A user's own law, inspected as text: no line of it is run."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ttwmr_mj.controllers.shared.own.loading import KEY, name_taken, where_to_be
from ttwmr_mj.controllers.shared.own.modules import file_of, found
from ttwmr_mj.errors import Fault

METHODS = ("start", "command")


def inspected(target: str, options: Mapping[str, Any], folder: Path) -> list[Fault]:
    """What is wrong with a law, as far as its file shows.

    Args:
        target: module:Class.
        options: keyword arguments that it is made with.
        folder: where the module is looked for first.
    """
    module, name = target.split(":")
    taken = name_taken(target, folder)
    if taken is not None:
        return [taken]
    spec = found(module, folder)
    file = file_of(spec) if spec is not None else None
    if file is None:
        problem = f"there is no module {module}"
        return [Fault(key=KEY, got=repr(target), problem=problem, hint=where_to_be(folder))]
    if file.suffix != ".py":
        return []  # built, or in an archive: loading it says more
    try:
        tree = ast.parse(file.read_text(encoding="utf-8"), filename=str(file))
    except (SyntaxError, ValueError) as error:
        return [Fault(key=KEY, got=repr(target), problem=f"{file} cannot be read: {error}")]
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    if name not in classes:
        if _imported(name, tree):
            return []  # from elsewhere: loading it says more
        there = ", ".join(classes) or "none"
        problem = f"{file.name} has no class {name}"
        return [Fault(key=KEY, got=repr(target), problem=problem, allowed=there)]
    family = _family(classes[name], classes)
    return [*_missing(name, family), *_wrong_options(name, family, options)]


def _imported(name: str, tree: ast.Module) -> bool:
    """Whether a module may have a name that it does not define as a class."""
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.asname or alias.name for alias in node.names}
            if name in names or "*" in names:
                return True
        if isinstance(node, ast.Assign) and any(
            isinstance(target, ast.Name) and target.id == name for target in node.targets
        ):
            return True
    return False


def _family(one: ast.ClassDef, classes: Mapping[str, ast.ClassDef]) -> list[ast.ClassDef]:
    """A class and those it derives from, as far as they are in its file."""
    family = [one]
    for base in one.bases:
        if isinstance(base, ast.Name) and base.id in classes and classes[base.id] is not one:
            family += _family(classes[base.id], classes)
    return family


def _missing(name: str, family: list[ast.ClassDef]) -> Iterable[Fault]:
    """Methods of a law that derives from nothing but `Controller`."""
    bases = {ast.unparse(base).rpartition(".")[2] for one in family for base in one.bases}
    own = {one.name for one in family}
    if not bases - own:
        problem = f"{name} does not derive from ttwmr_mj.Controller"
        yield Fault(key=KEY, problem=problem)
    elif bases - own == {"Controller"}:
        have = {node.name for one in family for node in one.body if isinstance(node, _FUNCTION)}
        for method in METHODS:
            if method not in have:
                yield Fault(key=KEY, problem=f"{name} has no method {method}")


def _wrong_options(
    name: str, family: list[ast.ClassDef], options: Mapping[str, Any]
) -> Iterable[Fault]:
    """Options that the class does not take, and those that it needs."""
    made = next(
        (
            n
            for one in family
            for n in one.body
            if isinstance(n, _FUNCTION) and n.name == "__init__"
        ),
        None,
    )
    if made is None:
        if len(family[-1].bases) and ast.unparse(family[-1].bases[0]).endswith("Controller"):
            yield from (_unknown(name, key, []) for key in options)
        return
    given = made.args
    positional = [a.arg for a in (*given.posonlyargs, *given.args)][1:]
    keyword = [a.arg for a in given.kwonlyargs]
    if given.kwarg is None:
        taken = [*positional, *keyword]
        yield from (_unknown(name, key, taken) for key in options if key not in taken)
    needed = positional[: len(positional) - len(given.defaults)] if positional else []
    needed += [k for k, d in zip(keyword, given.kw_defaults, strict=True) if d is None]
    for key in needed:
        if key not in options:
            problem = f"missing; {name} has no default for it"
            yield Fault(key=("controller", "options", key), problem=problem)


def _unknown(name: str, key: str, taken: list[str]) -> Fault:
    allowed = ", ".join(taken) or "none"
    return Fault(
        key=("controller", "options", key), problem=f"{name} does not take it", allowed=allowed
    )


_FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef
