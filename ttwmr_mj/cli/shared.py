"""Options that several subcommands have, said once; imports that cost time are made in methods."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import Subcommand, option
from ttwmr_mj.errors import InputError

if TYPE_CHECKING:
    from ttwmr_mj.recording.live import LiveView
    from ttwmr_mj.runs.pace import Pace
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
    force: bool = option("write into a folder that is not empty")

    def open_folder(self, name: str, suffix: str | int) -> Path:
        """The folder, made if missing; by default results/<name>/<UTC time>-<suffix>."""
        from ttwmr_mj.runs.folder import open_folder, results_folder

        folder = self.out or results_folder(name, suffix)
        open_folder(folder, self.force)
        return folder


class Overrides(Subcommand):
    """Subcommands that read scenarios, in which single values can be replaced."""

    overrides: tuple[str, ...] = option(
        "override a value of the scenario; repeatable", name="--set", metavar="KEY.PATH=VALUE"
    )
    fragment: Path | None = option(
        "TOML file merged into the scenario, such as compare --fit writes", metavar="FILE"
    )
    seed: int | None = option("replace the scenario's seed")

    def load(self, scenario: str, *more: str) -> Scenario:
        """The scenario with the user's overrides, and more after them."""
        from ttwmr_mj.scenario.file import load_scenario

        return load_scenario(scenario, [*self.overrides, *more], self.seed, self.fragment)


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
        from ttwmr_mj.runs.pace import LIVE_REPORT_EVERY_S, REPORT_EVERY_S, Pace

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


def warn(lines: list[str]) -> None:
    """Say what is worth knowing and no error."""
    for line in lines:
        print(f"ttwmr: warning: {line}", file=sys.stderr)


def command_line() -> list[str]:
    """What the user typed, for the manifest."""
    return ["ttwmr", *sys.argv[1:]]
