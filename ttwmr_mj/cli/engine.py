"""Typed subcommands: a frozen dataclass whose fields describe the command line's options."""

from __future__ import annotations

import argparse
import pkgutil
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from importlib import import_module
from types import UnionType
from typing import Any, ClassVar, Literal, get_args, get_origin, get_type_hints


def argument(text: str, default: Any = MISSING) -> Any:
    """A positional argument with its help; a tuple takes one or more."""
    return field(default=default, metadata={"help": text})


def option(
    text: str,
    default: Any = MISSING,
    *,
    name: str | None = None,
    metavar: str | None = None,
    several: bool = False,
    bare: str | None = None,
    least: int | None = None,
) -> Any:
    """A named option; a tuple may be given several times.

    Args:
        text: its help.
        default: if it is not given; without one False, None or (), as the type says, else the
            option is required. So it is for arguments, but for tuples.
        name: as typed; None: the field's name as --field-name.
        metavar: placeholder for the value in the help.
        several: whether a tuple takes several values at once.
        bare: the value where the option is typed without one; another is typed as --name=value.
        least: the smallest whole number that is allowed.
    """
    told: dict[str, Any] = {"help": text, "name": name, "metavar": metavar}
    told |= {"several": several, "bare": bare, "least": least}
    return field(default=default, metadata=told)


@dataclass(frozen=True, kw_only=True)
class Subcommand(ABC):
    """Base of every subcommand: fields are what the user may give, calling it does the work.

    Subclasses become frozen dataclasses when they are added with their options: made for all of
    them at once, they would take half the time of `ttwmr --help`. The first line of the docstring
    is the help. Types say how words are read: str, int, Path, bool (a switch), Literal[...],
    X | None, tuple[X, ...].
    """

    registry: ClassVar[dict[str, type[Subcommand]]] = {}  # name → class

    debug: bool = option("show tracebacks", False)

    def __init_subclass__(cls, name: str | None = None) -> None:
        if name is not None:
            Subcommand.registry[name] = cls

    @abstractmethod
    def __call__(self) -> int:
        """Do it and return the exit code."""


def make_dataclass(kind: type[Subcommand]) -> None:
    """Make frozen dataclasses of a subcommand and its bases, as far as they are none yet."""
    for base in reversed(kind.__mro__):
        if not issubclass(base, Subcommand) or "__dataclass_fields__" in vars(base):
            continue
        hints = get_type_hints(base)
        for key, entry in vars(base).items():
            if isinstance(entry, Field) and entry.default is MISSING:
                entry.default = _absent(hints[key], entry)
        dataclass(frozen=True, kw_only=True)(base)


def _absent(hint: Any, entry: Field[Any]) -> Any:
    """The value of what is not given; MISSING if it must be."""
    if hint is bool:
        return False
    if isinstance(hint, UnionType):
        return None
    return () if get_origin(hint) is tuple and "name" in entry.metadata else MISSING


def load_subcommands(package: str) -> dict[str, type[Subcommand]]:
    """Name → class of every subcommand, after importing every module of a package."""
    for module in pkgutil.iter_modules(import_module(package).__path__, f"{package}."):
        import_module(module.name)
    return Subcommand.registry


def add_subcommand(
    subparsers: Any, name: str, kind: type[Subcommand], options: bool = True
) -> None:
    """The argparse parser of one subcommand; what it parses sets `kind` too.

    Args:
        subparsers: as made by argparse's `add_subparsers`.
        name: as the user types it.
        kind: its class.
        options: whether it gets its options; without, it only stands in the list of all.
    """
    summary = (kind.__doc__ or "").partition("\n")[0].rstrip(".")
    parser: argparse.ArgumentParser = subparsers.add_parser(
        name,
        help=summary[:1].lower() + summary[1:],
        description=f"{summary}.",
        argument_default=argparse.SUPPRESS,  # what is not given is left to the dataclass
    )
    if not options:
        return
    make_dataclass(kind)
    parser.set_defaults(kind=kind)
    hints = get_type_hints(kind)
    by_name = {entry.name: entry for entry in fields(kind)}
    # the class's own options first, then those it shares with others
    order = [n for base in kind.__mro__ for n in vars(base).get("__annotations__", ())]
    for entry in (by_name[n] for n in order if n in by_name):
        _add(parser, entry, hints[entry.name])


def _add(parser: argparse.ArgumentParser, entry: Field[Any], hint: Any) -> None:
    """One argument or option of a parser."""
    settings, required = _read(hint), entry.default is MISSING
    known = "" if required or not entry.default else f"; default: {entry.default}"
    if "name" in entry.metadata:
        typed = _typed(entry)
        settings |= {"dest": entry.name, "required": required}
        if entry.metadata["metavar"]:
            settings["metavar"] = entry.metadata["metavar"]
        if entry.metadata["least"] is not None:
            settings["type"] = _whole(entry.metadata["least"])
        if entry.metadata["several"]:
            settings |= {"action": "extend", "nargs": "+"}
    else:
        typed = entry.name
        settings["metavar"] = typed.upper()  # as messages name it, and the values of options
        if settings.pop("action", None) == "append":
            settings |= {"nargs": "+", "metavar": typed.upper().removesuffix("S")}
        elif not required:
            settings |= {"nargs": "?", "default": entry.default}
    parser.add_argument(typed, help=entry.metadata["help"] + known, **settings)


def _read(hint: Any) -> dict[str, Any]:
    """How argparse reads a value of this type."""
    inner = get_args(hint)
    if hint is bool:
        return {"action": "store_true"}
    if get_origin(hint) is Literal:
        return {"choices": inner}
    if get_origin(hint) is tuple:
        return {"action": "append", "type": inner[0]}
    return {"type": inner[0] if isinstance(hint, UnionType) else hint}


def _whole(least: int) -> Callable[[str], int]:
    """Reads whole numbers that are large enough."""

    def read(text: str) -> int:
        allowed = f"allowed: a whole number, {least} or more"
        try:
            number = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"got {text[:20]!r}; {allowed}") from None
        if number < least:
            raise argparse.ArgumentTypeError(f"got {number}; {allowed}")
        return number

    return read


def _with_bare_values(words: Sequence[str]) -> list[str]:
    """The words, with the values of options that were typed without one.

    argparse would take the next word for it, be it another argument.
    """
    kind = Subcommand.registry.get(words[0]) if words else None
    entries = fields(kind) if kind else ()
    bare = {_typed(e): e.metadata["bare"] for e in entries if e.metadata.get("bare")}
    return [f"{word}={bare[word]}" if word in bare else word for word in words]


def _typed(entry: Field[Any]) -> str:
    """An option's name as the user types it."""
    return str(entry.metadata["name"] or "--" + entry.name.replace("_", "-"))


def parse(parser: argparse.ArgumentParser, words: Sequence[str] | None) -> Subcommand:
    """The subcommand that the words ask for; argparse leaves with exit code 2 on wrong ones."""
    typed = _with_bare_values(sys.argv[1:] if words is None else words)
    given = vars(parser.parse_args(typed))
    kind: type[Subcommand] = given.pop("kind")
    options: dict[str, Any] = {n: tuple(v) if isinstance(v, list) else v for n, v in given.items()}
    return kind(**options)
