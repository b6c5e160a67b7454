"""A folder of results: filled by one process, with the files of one run, or left as it was."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from glob import glob
from pathlib import Path

from ttwmr_mj.errors import InputError, is_of_input, refused, to_copy
from ttwmr_mj.files import drafts, read_json, read_toml
from ttwmr_mj.results.row_stream import ROWS_FILE, holds_rows
from ttwmr_mj.runs.files.lock import NAME as LOCK
from ttwmr_mj.runs.files.lock import locked

_DRAWN = (
    *("paths", "x", "y", "theta1", "theta2", "wheel_speeds", "errors", "hitch_angle", "signals"),
    *("deviation", "slip", "residuals", "attribution", "contributions", "convergence", "fit"),
)
# all that run, drive, compare and track leave, and those who keep runs beside them: what tells that
# there is a run, and what others may have, too
_TELLING = (
    *("scenario.resolved.toml", "manifest.json", "metrics.json", "row.json", "made_of.json"),
    *("trajectory.parquet", "trajectory.arrows", "physics.parquet", "run.rrd"),
    *("compare.json", "contact.parquet", "analytic.parquet", "attribution.parquet"),
    *("fitted.toml", "poses.parquet", "track.rrd"),
)
_COMMON = (
    "report.html",
    *(f"summary.{ending}" for ending in ("png", "svg", "pdf")),
    *(f"figures/{name}.{ending}" for name in _DRAWN for ending in ("png", "svg")),
    *(f"frames/{kind}/[0-9]*.png" for kind in ("images", "masks")),
    "frames/annotations.json",
)
OURS = (*_TELLING, *_COMMON)
ASIDE = ".replaced"  # where what is replaced waits until there is something in its place


@contextmanager
def new_folder(folder: Path, force: bool, key: str = "--out") -> Iterator[None]:
    """A folder for results, made if it is missing and held while the context lasts.

    Where the input turns out to be wrong, or nothing had been recorded yet when the work ended by
    an exception, the folder is as it was before.

    Args:
        folder: must be empty or absent.
        force: replace the run that it holds, as a whole; files that are none of a run's stay, and
            where there is no run, none may have the name of one of a run's.
        key: what names the folder, in messages: an option, or the argument of a function.

    Raises:
        InputError: the folder holds something, is filled by another process, or cannot be made.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        make_folder(folder, key)
        with _held(folder, key), _replaced(folder, force, key):
            yield
    except BaseException:
        for path in missing:
            with suppress(OSError):
                path.rmdir()  # what holds something stays
        raise


def make_folder(folder: Path, key: str = "--out") -> None:
    """Make a folder, if it is missing; `key` names it in messages.

    Raises:
        InputError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        astray = [path for path in (folder, *folder.parents) if _leads_nowhere(path)]
        why = f"{astray[0]} is a link that leads nowhere" if astray else refused(error)
        problem = f"cannot make the folder: {why}"
        raise InputError.at(key, problem, got=str(folder)) from error


def _leads_nowhere(path: Path) -> bool:
    return os.path.lexists(path) and not os.path.exists(path)  # noqa: PTH110  # a loop is no error


def kept(folder: Path) -> str:
    """What there is in a folder whose work was broken off, in words."""
    if not folder.is_dir():
        return f"{folder} is gone, with all that was in it"
    if _is_complete(folder):
        return f"the run is complete in {folder}{', figures may be missing' * _draws(folder)}"
    if not is_recorded(folder):
        return "nothing was recorded"
    if not any(folder.glob("trajectory.*")):
        return f"what was recorded is in {folder}"
    return f"what was recorded is in {folder} and can be scored: {to_copy('score', folder)}"


def _is_complete(folder: Path) -> bool:
    try:
        return bool(read_json(folder / "metrics.json")["status"] == "ok")
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _draws(folder: Path) -> bool:
    """Whether figures are wanted of the run."""
    try:
        output = read_toml(folder / "scenario.resolved.toml")["output"]
        return bool(output["figures"] or output["paper_plots"])
    except (InputError, KeyError, TypeError):
        return True


def is_recorded(folder: Path) -> bool:
    """Whether there is a row of a run, or something of another work.

    A run's recording is opened before its first row, and a full disk may have taken none of that.
    """
    whole = [*folder.glob("*.parquet"), folder / "track.rrd"]
    return any(path.is_file() and path.stat().st_size for path in whole) or holds_rows(
        folder / ROWS_FILE
    )


@contextmanager
def _held(folder: Path, key: str) -> Iterator[None]:
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(folder, key=key))
        except OSError as error:
            problem = f"nothing can be written in it: {error.strerror}"
            raise InputError.at(key, problem, got=str(folder)) from error
        yield


@contextmanager
def _replaced(folder: Path, force: bool, key: str) -> Iterator[None]:
    """Set the files of the old run aside, until it is known whether there is a new one."""
    forced = "--force" if key.startswith("-") else "force=True"
    if not force and any(path.name != LOCK for path in folder.iterdir()):
        hint = f"give another one, or {forced} to replace the run in it"
        raise InputError.at(key, "the folder is not empty", got=str(folder), hint=hint)
    aside = folder / ASIDE
    if aside.is_dir():  # of a process that was killed
        _settle(folder)
    others = [] if _files(folder, _TELLING) else _files(folder)
    if others:
        problem = (
            f"it holds {others[0].relative_to(folder)}, and no run that {forced} could replace"
        )
        raise InputError.at(key, problem, got=str(folder), hint="give another one")
    _move(folder, aside)
    try:
        yield
    except BaseException as error:
        _settle(folder, to_nothing=is_of_input(error))
        raise
    _delete(aside)


def settle_the_dead(folder: Path) -> bool:
    """A process ended without a word while it filled a folder: what it wrote half goes.

    Returns:
        whether a run that it was to replace is there again, as nothing else was recorded.
    """
    for ours in OURS:
        for draft in folder.glob(drafts(ours)):
            with suppress(OSError):
                draft.unlink()
    return _settle(folder)


def _settle(folder: Path, *, to_nothing: bool = False) -> bool:
    """Whether what was set aside is back, where nothing, or nothing of use, came in its place."""
    aside = folder / ASIDE
    again = not _is_over(folder) and (to_nothing or not is_recorded(folder))
    if again:
        _delete(folder)
        again = _move(aside, folder)
    _delete(aside)
    return again


def _is_over(folder: Path) -> bool:
    """Whether there is a run that came to its end: what is wrong now is not the run."""
    return (folder / "metrics.json").is_file()


def _files(folder: Path, kinds: Iterable[str] = OURS) -> list[Path]:
    """The files of a run, half-written ones included, and what has their names: a pipe, a link.

    Links that lead nowhere are among them, as relative ones do once they are set aside.
    """
    names = (name for ours in kinds for name in (ours, drafts(ours)))
    # `Path.glob` does not see such links
    found = (folder / path for name in names for path in glob(name, root_dir=folder))  # noqa: PTH207
    return [path for path in found if path.is_symlink() or not path.is_dir()]


def _move(folder: Path, into: Path) -> bool:
    """Whether there was something to move."""
    files = _files(folder)
    for path in files:
        target = into / path.relative_to(folder)
        target.parent.mkdir(parents=True, exist_ok=True)
        path.replace(target)
    _tidy(folder)
    return bool(files)


def _delete(folder: Path) -> None:
    for path in _files(folder):
        path.unlink(missing_ok=True)
    _tidy(folder)


def _tidy(folder: Path) -> None:
    """Without folders of ours that are empty now."""
    inside = [folder / name for name in ("figures", "frames/images", "frames/masks", "frames")]
    for path in [*inside, *([folder] if folder.name == ASIDE else [])]:
        with suppress(OSError):
            path.rmdir()
