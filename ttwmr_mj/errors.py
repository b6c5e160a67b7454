"""The errors users meet: where, what was given, what is allowed, what to do."""

from __future__ import annotations

import errno
import os
import re
import shlex
import unicodedata
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from numbers import Integral
from pathlib import Path
from types import UnionType
from typing import Any, get_args

Keys = tuple[str | int, ...]
MARKS = re.compile(r"([\\`<>\[\]|])")  # what Markdown obeys, but for emphasis
LONGEST_REASON = 1000  # letters of what an exception says of itself
LONGEST_WORD = 100  # letters of a name from a stranger
MOST_TOLD = 100  # faults of one input
# whose code has run in this process, and may have changed anything in it: laws of the user's, and
# packages that add some
strangers: list[str] = []
# what the user named cannot be used; any other error of the system is no fault of the input
OF_NAMES = frozenset(
    {
        errno.ENAMETOOLONG,
        errno.ENOENT,
        errno.ENOTDIR,
        errno.EISDIR,
        errno.EEXIST,
        errno.ELOOP,
        errno.EACCES,
        errno.EPERM,
        errno.EINVAL,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that is wrong with an input.

    Attributes:
        key: where, from the outermost table inwards; empty: the whole file or command.
        problem: what is wrong, in words; empty where `got` says it all.
        got: the value that was given, as the file shows it; empty: none, or irrelevant.
        allowed: what may be given there.
        hint: what to do about it.
    """

    key: Keys = ()
    problem: str = ""
    got: str = ""
    allowed: str = ""
    hint: str = ""

    @property
    def where(self) -> str:
        """The key as it is written, robot.tractor.mass_kg; blank words of it in quotes."""
        words = (cut(str(word)) for word in self.key)
        return ".".join(word if word.strip() else f'"{word}"' for word in words)

    @property
    def message(self) -> str:
        """All but the key, in one line."""
        got = f"got {self.got}" if self.got else ""
        allowed = f"allowed: {self.allowed}" if self.allowed else ""
        return "; ".join(part for part in (got, self.problem, allowed, self.hint) if part)

    def __str__(self) -> str:
        return in_one_line(f"{self.where}: {self.message}" if self.key else self.message)

    def within(self, *outer: str | int) -> Fault:
        """The same fault, with its key inside these outer tables."""
        return replace(self, key=(*outer, *self.key))


def cut(text: str, longest: int = LONGEST_WORD) -> str:
    """What may be of any length, in so many letters."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def shown(value: Any) -> str:
    """A value for `Fault.got`: short, and quoted where it is text."""
    text = "a table" if isinstance(value, dict) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def at_most(value: float, digits: int = 3) -> str:
    """A limit for `Fault.allowed`, rounded to so many digits that are allowed themselves."""
    return f"at most {rounded(value, ROUND_FLOOR, digits)}"


def at_least(value: float, digits: int = 3) -> str:
    """The same of a limit below."""
    return f"at least {rounded(value, ROUND_CEILING, digits)}"


def apart(one: float, other: float, least: int = 6) -> tuple[str, str]:
    """Two numbers that differ, in as many digits as show it, at least so many."""
    digits = next((n for n in range(least, 17) if f"{one:.{n}g}" != f"{other:.{n}g}"), 17)
    return f"{one:.{digits}g}", f"{other:.{digits}g}"


def rounded(value: float, rounding: str, digits: int = 3) -> str:
    """A number in so many digits, rounded to the side that one of `decimal`'s words names."""
    # from the digits that Python reads the number from: its binary ones are a little off
    number = Context(prec=digits, rounding=rounding).create_decimal(repr(float(value)))
    return f"{float(number):.{digits}g}"


def described(error: BaseException) -> str:
    """The kind of an exception and what it says of itself, if it can, in a thousand letters."""
    try:
        text = f"{type(error).__name__}: {error}"
    except KeyboardInterrupt:
        raise
    except BaseException as other:  # a user's exception may do anything here too
        return f"{type(error).__name__} (whose text raised {type(other).__name__})"
    return printable(cut(text, LONGEST_REASON))


def of_system(error: OSError) -> str:
    """What the system refused, and of which file."""
    name = "" if error.filename is None else in_one_line(str(error.filename))
    return f"{cut(name)}: {refused(error)}" if name else refused(error)


def refused(error: OSError) -> str:
    """What the system refused."""
    if error.errno == errno.ENOENT and not _has_working_directory():
        return "the working directory is gone; change to a folder that exists"
    # in the system's own words: libraries wrap them in theirs
    return os.strerror(error.errno) if error.errno else str(error) or type(error).__name__


def _has_working_directory() -> bool:
    try:
        return bool(os.getcwd())  # noqa: PTH109
    except OSError:
        return False


def is_of_input(error: BaseException) -> bool:
    """Whether an input is to blame (exit code 2), so that nothing was done."""
    if isinstance(error, OSError):
        return error.errno in OF_NAMES
    return isinstance(error, TtwmrError) and not isinstance(error, RunError)


def to_copy(*words: object) -> str:
    """A command of ours as a shell takes it, whatever is in its names.

    A path is told as one: what begins with a dash would be an option.
    """
    told = (f"./{w}" if isinstance(w, Path) and str(w).startswith("-") else str(w) for w in words)
    return shlex.join(["ttwmr", *told])


def printable(text: str) -> str:
    """A text without what a terminal would obey, such as a name from a stranger's file may hold.

    Control characters but tab and newline become escapes: their codes can clear the screen, set
    the window's title, or write over lines above.
    """
    return "".join(c if c in "\n\t" or not _commands(c) else repr(c)[1:-1] for c in text)


def in_one_line(text: str) -> str:
    """A text as `printable` has it, line breaks as escapes too: names of files may hold them."""
    return "\\n".join(printable(text).splitlines())


def in_brief(text: str) -> str:
    """The same of what may be of any length, such as a law's exception, from its beginning on."""
    return cut(in_one_line(text.strip()), LONGEST_REASON)


def in_markdown(text: str) -> str:
    """A text of somebody else's as part of a Markdown line: without HTML, link, table or code.

    So it may stand in a leaderboard and in a recording's panel. HTML pages escape by themselves.
    """
    return MARKS.sub(r"\\\1", " ".join(printable(text).split()))


def _commands(character: str) -> bool:
    return unicodedata.category(character) in {"Cc", "Cf", "Cs"}


class TtwmrError(Exception):
    """Base class of every error this package raises on purpose."""


class InputError(TtwmrError):
    """An input is wrong: scenario, option, file (exit code 2).

    Attributes:
        faults: everything that is wrong.
        file: the file that is wrong; None where there is none.
    """

    def __init__(self, *faults: Fault | str, file: str | None = None) -> None:
        self.faults = tuple(f if isinstance(f, Fault) else Fault(problem=f) for f in faults)
        self.file = file
        super().__init__(self._text())

    @classmethod
    def at(
        cls, key: str, problem: str = "", *, got: str = "", allowed: str = "", hint: str = ""
    ) -> InputError:
        """One fault at a key path such as "reference.plan"."""
        path = tuple(key.split("."))
        return cls(Fault(key=path, problem=problem, got=got, allowed=allowed, hint=hint))

    def _text(self) -> str:
        more = len(self.faults) - MOST_TOLD
        told = [str(fault) for fault in self.faults[:MOST_TOLD]]
        told += [f"and {more} more"] if more > 0 else []
        if self.file is None:
            return "\n".join(told)
        file = in_one_line(self.file)
        if len(self.faults) == 1 and not self.faults[0].key:  # about the whole file
            return f"{file}: {self.faults[0]}"
        count = "1 error" if len(self.faults) == 1 else f"{len(self.faults)} errors"
        return "\n".join([f"{file}: {count}", *(f"  {line}" for line in told)])

    def __reduce__(self) -> Any:
        """Errors cross processes, and the default would lose `file`."""
        return _restored, (type(self), self.faults, self.file)


def _restored(kind: type[InputError], faults: tuple[Fault, ...], file: str | None) -> InputError:
    return kind(*faults, file=file)


class RunError(TtwmrError):
    """A run that started could not be finished: divergence, failed physics (exit code 1)."""


class Overrun(BaseException):
    """Code of the user's took longer than it may.

    Not an Exception, so that `except Exception` does not swallow it.
    """


class MachineError(TtwmrError):
    """This machine lacks something the request needs, and the message says what (exit code 2)."""


def require(kind: type | UnionType, where: str, given: object, hint: str = "") -> None:
    """Look at what a script gives to a public function; nobody else checks types there.

    Raises:
        InputError: it is of another kind.
    """
    if not isinstance(given, kind):
        names = [one.__name__ for one in get_args(kind) or (kind,)]
        allowed = " or ".join(names).replace("NoneType", "None")
        raise InputError.at(where, got=shown(given), allowed=allowed, hint=hint)


def require_whole(where: str, given: object, least: int, most: int, problem: str = "") -> int:
    """A whole number that a script gives, NumPy's too.

    Raises:
        InputError: it is none, or out of these bounds.
    """
    if not isinstance(given, Integral) or not least <= int(given) <= most:
        whole_asked = "" if isinstance(given, Integral) else "it must be a whole number"
        problem = "; ".join(filter(None, (problem, whole_asked)))
        raise InputError.at(where, problem, got=shown(given), allowed=f"{least} to {most:,}")
    return int(given)


def whole(word: str) -> int | None:
    """The whole number of a word that is one, in 31 bits; None of any other, however long."""
    number = int(word) if word.isdecimal() and len(word) <= 10 else 2**31
    return number if number < 2**31 else None
