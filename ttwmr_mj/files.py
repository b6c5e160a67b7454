"""What the system holds: files, written whole or not at all; their names in input; variables."""

from __future__ import annotations

import errno
import glob
import json
import logging
import math
import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pydantic import AfterValidator, ValidationInfo

from ttwmr_mj.deadline import step
from ttwmr_mj.errors import Fault, InputError, MachineError, cut, require, shown

MOST_BYTES = 16_000_000  # of a TOML file; those of a plan have some thousand points
MOST_LEVELS = 32  # of tables and lists within each other; a scenario has six
_rename, _dumps = os.replace, json.dumps  # which a law may put others in place of
BESIDE = "write it into a file: the files that it names are looked up beside it"  # for pipes
UNHEARD = logging.NullHandler()
DRAFT = ".part"  # what a file's name ends with until it is whole


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file of whoever wrote it: of bounded size and depth, its whole numbers of 64 bits.

    Raises:
        InputError: it cannot be read as that.
    """
    try:
        with path.open("rb") as file:  # of a device no more than is allowed
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise ValueError(f"larger than {MOST_BYTES:,} bytes")
        return parse_toml(content.decode("utf-8-sig"))  # editors on Windows mark UTF-8
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error  # in the system's words, not Python's
        fault = Fault(problem=f"cannot be read as TOML: {why}")
        raise InputError(fault, file=str(path)) from error


def parse_toml(text: str) -> dict[str, Any]:
    """The same of a text.

    Raises:
        ValueError: it is no such TOML.
    """
    deep = f"tables and lists within each other more than {MOST_LEVELS} deep"
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ValueError(deep) from None
    level: list[Any] = [data]
    for _ in range(MOST_LEVELS + 1):
        inner = (v.values() if isinstance(v, dict) else v for v in level)
        found = [item for items in inner for item in items]
        if any(isinstance(v, int) and not -(2**63) <= v < 2**63 for v in found):
            raise ValueError("a whole number does not fit into 64 bits")
        level = [item for item in found if isinstance(item, dict | list)]
        if not level:
            return data
    raise ValueError(deep)


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file of ours: its numbers are finite, its whole ones of 64 bits.

    Raises:
        OSError: there is no such file; what is none, such as a pipe, is not waited for.
        ValueError: it holds no such object.
    """
    no_device(path)
    text = path.read_text(encoding="utf-8")
    try:
        value = json.loads(text, parse_int=_whole, parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise ValueError(f"{path.name} holds tables and lists too deep within each other") from None
    if not isinstance(value, dict):
        raise ValueError(f"{path.name} holds no object")
    return value


def _finite(text: str) -> float:
    if not math.isfinite(number := float(text)):
        raise ValueError(f"{cut(text, 20)} is no finite number")
    return number


def _whole(text: str) -> int:
    if not -(2**63) <= (number := int(text)) < 2**63:
        raise ValueError(f"{cut(text, 20)} does not fit into 64 bits")
    return number


def scratch_folder() -> Path:
    """Where files that are gone afterwards go, such as TMPDIR or /tmp.

    Raises:
        MachineError: nowhere can be written to.
    """
    try:
        return Path(tempfile.gettempdir())
    except FileNotFoundError as error:
        raise MachineError(
            "no folder takes temporary files, neither /tmp nor the working directory; "
            "let TMPDIR name a folder that takes them"
        ) from error


def no_device(path: Path) -> None:
    """Refuse what may never end or never begin, such as a pipe or a device.

    Raises:
        OSError: it is there and no file.
    """
    if path.exists() and not path.is_file():
        what = errno.EISDIR if path.is_dir() else errno.EINVAL
        raise OSError(what, os.strerror(what), str(path))


@contextmanager
def written(path: Path) -> Iterator[Path]:
    """Where to write a file that appears whole or not at all; nothing is left of a failure.

    A device, /dev/stdout, or a pipe that somebody reads is written to as it is, and a reader that
    leaves is no failure; any other pipe, a socket or a link to itself is replaced, as a file is.

    Raises:
        OSError: there is a folder.
    """
    with _lasting(path) as lasting:
        if lasting is not None:
            with suppress(BrokenPipeError):
                yield lasting
            return
    if path.is_dir():
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    # no other process writes under this name
    temporary = path.with_name(f"{path.name}.{os.getpid()}.{os.urandom(4).hex()}{DRAFT}")
    try:
        step()
        yield temporary
        _rename(temporary, path)
        step()
    except BaseException as error:
        if isinstance(error, OSError) and error.errno and error.filename in (None, str(temporary)):
            error.filename = str(path)  # the name that its user knows
        with suppress(OSError):
            temporary.unlink()
        raise


def delete_drafts(places: Iterable[Path]) -> None:
    """Delete what a process that was killed wrote half: of these files, or in these folders."""
    for place in places:
        inside = place.rglob(drafts("*")) if place.is_dir() else ()
        for draft in (*inside, *place.parent.glob(drafts(glob.escape(place.name)))):
            with suppress(OSError):
                draft.unlink(missing_ok=True)


def drafts(name: str) -> str:
    """The pattern of names under which `written` writes files of a name, or of a pattern."""
    return f"{name}.[0-9]*.{'[0-9a-f]' * 8}{DRAFT}"


@contextmanager
def _lasting(path: Path) -> Iterator[Path | None]:
    """What is there and to be written to; None where a file replaces it.

    A pipe has its reader meanwhile; for one of the system's without any it is what nobody reads.
    """
    if not is_stream(path):
        yield None
        return
    of_system = resolved(path.parent).parts[1] in ("dev", "proc")
    if not path.is_fifo():
        yield path if of_system or not path.is_socket() else None
        return
    try:
        reader = os.open(path, os.O_WRONLY | os.O_NONBLOCK)  # to open it otherwise would wait
    except OSError:
        yield Path(os.devnull) if of_system else None
        return
    try:
        yield path
    finally:
        os.close(reader)


def named(where: str, given: Path | str) -> Path:
    """A file or folder that a script names.

    Raises:
        InputError: it is no name.
    """
    require(str | Path, where, given)
    if "\0" in str(given):
        raise InputError.at(where, "no file has such a name", got=shown(given))
    return Path(given)


def remove(path: Path) -> None:
    """Delete what is there, a folder with all that is in it; where a link was, its goal stays."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """An empty folder, whatever was there."""
    remove(folder)
    folder.mkdir(parents=True)


def resolved(path: Path) -> Path:
    """The absolute path without links; unlike Path.resolve it takes a link to itself for a file."""
    return Path(os.path.realpath(path))


@contextmanager
def together(files: Iterable[Path]) -> Iterator[None]:
    """Files that belong together: those that are new go again if not all could be written."""
    new = [file for file in files if not file.exists()]
    try:
        yield
    except BaseException:
        for file in new:
            file.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file under a temporary name, then rename it."""
    with written(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file under a temporary name, then rename it."""
    with written(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, value: Any) -> None:
    """Write JSON; a NaN or infinity in it is a programming error and raises ValueError."""
    write_text(path, _dumps(value, indent=2, allow_nan=False) + "\n")


@contextmanager
def variable(name: str, value: str | None) -> Iterator[None]:
    """While the context lasts a variable of the environment has this value, or is not there."""
    before = os.environ.get(name)
    _set_variable(name, value)
    try:
        yield
    finally:
        _set_variable(name, before)


def _set_variable(name: str, value: str | None) -> None:
    if value is None:
        os.environ.pop(name, None)
    else:
        os.environ[name] = value


@contextmanager
def importing_matplotlib() -> Iterator[None]:
    """Import it in this, whatever the environment says of its backend, or of where it may write.

    Its words on where it keeps its lists of fonts are no words of ours; who logs still hears them.
    """
    logging.getLogger("matplotlib").addHandler(UNHEARD)
    with variable("MPLBACKEND", None):  # it need not be installed, and is not used here
        yield


def is_file(path: Path) -> bool:
    """Whether there is such a file, of whatever name; none has one that is too long."""
    return os.path.isfile(path)  # noqa: PTH113  # Path.is_file raises of such a name


def is_stream(path: Path) -> bool:
    """Whether there is a pipe, a device or a socket, of whatever name."""
    there = os.path.exists(path) and not os.path.isdir(path)  # noqa: PTH110, PTH112  # as above
    return there and not is_file(path)


def holds(folder: Path, name: str) -> bool:
    """Whether there is such a file in a folder.

    Raises:
        InputError: there is something else of that name.
    """
    require_none_but_files(folder / name, hint="")
    return is_file(folder / name)


def require_none_but_files(path: Path, hint: str = BESIDE) -> None:
    """Refuse a path where there is something, and no file.

    Raises:
        InputError: with what is there.
    """
    if is_stream(path):
        raise InputError(Fault(problem="is a pipe or a device", hint=hint), file=str(path))
    if os.path.isdir(path):  # noqa: PTH112  # as above
        raise InputError(Fault(problem="is a folder"), file=str(path))
    if os.path.islink(path) and not is_file(path):  # noqa: PTH114  # as above
        problem = "is a link that leads to no file"
        raise InputError(Fault(problem=problem), file=str(path))


def input_file(remedy: str) -> AfterValidator:
    """Marks a text field as the name of a file beside the scenario; see `placed`."""
    return AfterValidator(lambda given, info: placed(given, info, remedy))


def placed(given: str, info: ValidationInfo, remedy: str) -> str:
    """The absolute path of a file named in a scenario file, relative to that file's folder.

    Where no file is being read (the validation has no folder in its context) it stays as given.

    Raises:
        ValueError: there is no such file; for pydantic, which adds the key.
    """
    if info.context is None:
        return given
    path = resolved(info.context["folder"] / given)
    if not is_file(path):
        raise ValueError(f"no such file ({path}); {remedy}")
    return str(path)
