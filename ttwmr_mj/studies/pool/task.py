"""Work that is done once: a job, what its result is made of, and where that is written down."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ttwmr_mj.files import clear, read_json, write_json
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.ingredients import Ingredients, differences, digest, made_of_run
from ttwmr_mj.studies.pool.jobs import Job

MADE_OF_FILE = "made_of.json"
RUN_FILES = ("scenario.resolved.toml", "manifest.json", "trajectory.parquet", "metrics.json")
# what every run imports; Rerun is left out, which starts threads as it is imported
PRELOAD = ("ttwmr_mj.runs.execute", "ttwmr_mj.plants.contact", "pyarrow.parquet")


@dataclass(frozen=True, slots=True)
class Kept:
    """A result that stays in files.

    Attributes:
        made_of: what it will be made of.
        mark: JSON of what the result that is there is made of, with digests of its files; written
            last.
        files: of the result, those that are read again.
    """

    made_of: Ingredients
    mark: Path
    files: tuple[Path, ...]

    def changes(self) -> list[str] | None:
        """What the finished result differs in from what it would be; None if there is none.

        A file that was damaged or replaced since differs too.
        """
        try:
            stored = read_json(self.mark)
        except (OSError, ValueError):
            return None
        return differences(stored, self._marked())

    def _marked(self) -> dict[str, Any]:
        return {**self.made_of, "files": {file.name: digest(file) for file in self.files}}

    @property
    def is_done(self) -> bool:
        """Whether the result is there and made of the very same."""
        return self.changes() == []

    def mark_done(self) -> None:
        """Say that the result is whole."""
        self.mark.parent.mkdir(parents=True, exist_ok=True)
        write_json(self.mark, self._marked())


@dataclass(frozen=True, slots=True)
class Work(Kept):
    """A job whose result stays in files.

    Attributes:
        job: does it.
    """

    job: Job


def run_task(
    name: str,
    scenario: Scenario,
    folder: Path,
    command_line: list[str],
    scenario_folder: Path | None = None,
    timeout_s: float = math.inf,
) -> Work:
    """One run into a folder of its own; arguments as of `runs.execute.run_scenario`."""
    arguments = (
        scenario,
        folder.absolute(),
        command_line,
        scenario_folder and scenario_folder.absolute(),
    )
    job = Job(name, make_run, arguments, timeout_s, (folder.absolute(),))
    made_of = made_of_run(scenario, scenario_folder)
    return Work(made_of, folder / MADE_OF_FILE, run_files(folder), job=job)


def run_files(folder: Path) -> tuple[Path, ...]:
    """Of a run, those that are read again."""
    return tuple(folder / name for name in RUN_FILES)


def make_run(
    scenario: Scenario, folder: Path, command_line: list[str], scenario_folder: Path | None
) -> None:
    """Run a scenario into a folder that is emptied first."""
    from ttwmr_mj.runs.execute import run_scenario

    clear(folder)  # of half a run, or one of something else
    run_scenario(scenario, folder, scenario_folder=scenario_folder, command_line=command_line)
