"""Options that several subcommands have, said once; imports that cost time are made in methods."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import Subcommand, option
from ttwmr_mj.cli.last_resort import say
from ttwmr_mj.errors import (
    Fault,
    InputError,
    MachineError,
    RunError,
    is_of_input,
    of_system,
    to_copy,
)

if TYPE_CHECKING:
    from ttwmr_mj.recording.stream.live import LiveView
    from ttwmr_mj.runs.closed_loop.pace import Pace
    from ttwmr_mj.runs.execute import Run
    from ttwmr_mj.scenario.schema import Scenario

SCENARIO = "a TOML file, or the name of a shipped scenario"


class Quiet(Subcommand):
    """Subcommands that show progress and print results."""

    quiet: bool = option("print nothing but errors and where the results are")


class NewFolder(Quiet):
    """Subcommands that fill a folder of results, a new one by default."""

    out: Path | None = option(
        "folder for the results; default: a new one under results/", metavar="DIR"
    )
    force: bool = option("replace the run in the folder, if there is one")

    def results(self, name: str, suffix: str | int) -> Path:
        """The folder's name; by default results/<name>/<UTC time>-<suffix>."""
        from ttwmr_mj.runs.files.folder import results_folder

        return self.out or results_folder(name, suffix)

    @contextmanager
    def new_folder(self, folder: Path) -> Iterator[Path]:
        """The folder, made if missing.

        What breaks the work off is told together with what is kept.

        Raises:
            RunError: a signal or the system broke it off.
        """
        from ttwmr_mj.runs.files.new_folder import is_recorded, kept, new_folder

        with new_folder(folder, self.force):
            try:
                yield folder
            except KeyboardInterrupt:
                raise RunError(f"stopped; {kept(folder)}") from None
            except MachineError as error:  # which may have worked for a while
                if is_recorded(folder):
                    raise RunError(f"{error}; {kept(folder)}") from error
                raise
            except OSError as error:
                if is_of_input(error) and folder.is_dir():
                    raise
                raise RunError(f"{of_system(error)}; {kept(folder)}") from error


class NewFiles(Subcommand):
    """Subcommands that write files which the user names."""

    force: bool = option("replace files that are there")

    def in_the_way(self, key: str, *files: Path) -> list[Fault]:
        """What is there and must not be replaced; a device or a pipe is written to.

        Args:
            key: the option that names the files.
            files: what the command would write.
        """
        there = [str(file) for file in files if file.is_file()]
        if self.force or not there:
            return []
        problem, hint = f"there is {', '.join(there)} already", "name another, or add --force"
        return [Fault(key=(key,), problem=problem, hint=hint)]

    def refuse_to_replace(self, key: str, *files: Path) -> None:
        """As `in_the_way`.

        Raises:
            InputError: something is there.
        """
        if faults := self.in_the_way(key, *files):
            raise InputError(*faults)


class Overrides(Subcommand):
    """Subcommands that read scenarios, in which single values can be replaced."""

    overrides: tuple[str, ...] = option(
        "override a value of the scenario, after all fragments; repeatable, a later one counts",
        name="--set",
        metavar="KEY.PATH=VALUE",
    )
    fragments: tuple[Path, ...] = option(
        "TOML file merged into the scenario, such as compare --fit writes; repeatable, the "
        "value of a later one counts",
        name="--fragment",
        metavar="FILE",
    )
    seed: int | None = option("replace the scenario's seed, after all fragments and --set")

    def load(self, scenario: str, *more: str) -> Scenario:
        """The scenario with the user's overrides, and more after them."""
        from ttwmr_mj.scenario.file import load_scenario

        return load_scenario(scenario, [*self.overrides, *more], self.seed, self.fragments)


class Live(Quiet):
    """Subcommands that can be looked at while they run."""

    live: str | None = option(
        "show it while it runs: in a window, or without a display in a browser; =web: in a "
        "browser; =rerun+http://HOST:PORT/proxy: in a viewer that runs",
        metavar="HOW",
        bare="auto",
    )
    pace: float | None = option(
        "simulated seconds per second, 0: as fast as it can; default: 1 with --live, else 0",
        metavar="SPEED",
    )

    def make_pace(self) -> Pace:
        """The pace the user wants."""
        from ttwmr_mj.runs.closed_loop.pace import LIVE_REPORT_EVERY_S, REPORT_EVERY_S, Pace

        speed = float(self.live is not None) if self.pace is None else self.pace
        looked_at = self.live is not None and speed > 0.0
        return Pace(speed, LIVE_REPORT_EVERY_S if looked_at else REPORT_EVERY_S)

    def check_recording(self, scenario: Scenario) -> None:
        """What is shown is the recording.

        Raises:
            InputError: it shall be shown and is not made.
        """
        if self.live is not None and not scenario.output.recording:
            problem = "what is shown is the recording, which output.recording switches off"
            raise InputError.at("--live", problem, hint="set output.recording=true")

    def live_view(self) -> AbstractContextManager[LiveView | None]:
        """The viewer the user wants to look on with, if any."""
        from ttwmr_mj.cli.viewing import viewing

        return viewing(self.live)


def where_it_is(what: str, folder: Path) -> str:
    """Where results are and, if there is a recording, how to look at it."""
    lines = [f"{what}: {folder}"]
    if any(folder.glob("*.rrd")):
        lines.append(f"look at it: {to_copy('view', folder)}")
    return "\n".join(lines)


@contextmanager
def kept_in(folder: Path, what: Callable[[], str]) -> Iterator[None]:
    """A study that goes on where it was stopped: Ctrl-C says so, and so does a file that vanishes.

    Args:
        folder: of the study; named in the command that goes on.
        what: tells what is kept.

    Raises:
        RunError: it was stopped, or what it had written was removed.
    """
    try:
        yield
    except FileNotFoundError as error:
        gone = f"removed while the command ran: {of_system(error)}"
        raise RunError(f"{gone}; the same command goes on") from error
    except KeyboardInterrupt:
        words = command_line()
        chosen = any(word == "--out" or word.startswith("--out=") for word in words)
        again = shlex.join(words if chosen else [*words, "--out", str(folder)])
        raise RunError(f"stopped; {what()} in {folder}. To go on: {again}") from None


def warn(lines: list[str]) -> None:
    """Say what is worth knowing and no error."""
    for line in lines:
        say(f"warning: {line}")


def command_line() -> list[str]:
    """What the user typed, for the manifest."""
    return ["ttwmr", *sys.argv[1:]]


def ended_early(name: str, done: Run) -> RunError:
    """The error of a run that did not come to its end."""
    return RunError(
        f"{name} {done.outcome.status} at {done.outcome.time_s:.3f} s: "
        f"{done.outcome.reason}; what was recorded is in {done.folder}"
    )
