"""Options that several subcommands have, said once; imports that cost time are made in methods."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import Subcommand, option

if TYPE_CHECKING:
    from ttwmr_mj.scenario.schema import Scenario

SCENARIO = "a TOML file, or the name of a shipped scenario"


class Quiet(Subcommand):
    """Subcommands that show progress and print results."""

    quiet: bool = option("print nothing but errors")


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


def warn(lines: list[str]) -> None:
    """Say what is worth knowing and no error."""
    for line in lines:
        print(f"ttwmr: warning: {line}", file=sys.stderr)


def command_line() -> list[str]:
    """What the user typed, for the manifest."""
    return ["ttwmr", *sys.argv[1:]]
