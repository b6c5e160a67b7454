"""A suite: which controllers meet which tasks, plants, sensors and disturbances."""

from __future__ import annotations

import itertools
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field, ValidationError

from ttwmr_mj.assets import sweeps_folder
from ttwmr_mj.errors import InputError
from ttwmr_mj.robot import Config

Overrides = tuple[str, ...]
AXES = ("controller", "task", "plant", "sensing", "disturbance")
LEAN: Overrides = ("output.recording=false", "output.figures=false")


class Choice(Config):
    """One value of an axis: what it changes in a scenario."""

    scenario: str | None = Field(default=None, description="tasks only: the scenario to start from")
    overrides: list[str] = Field(default=[], description="key.path=value, as of --set")
    skip: list[str] = Field(default=[], description="names on other axes it is not combined with")


class Suite(Config):
    """All axes; rows are their product, less what is skipped."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")
    description: str = ""
    seeds: list[int] = Field(default=[0], min_length=1)
    timeout_s: float = Field(default=300.0, gt=0, le=86_400, description="per run, wall time")
    controller: dict[str, Choice] = Field(min_length=1)
    task: dict[str, Choice] = Field(min_length=1)
    plant: dict[str, Choice] = {"contact": Choice()}
    sensing: dict[str, Choice] = {"truth": Choice()}
    disturbance: dict[str, Choice] = {"none": Choice()}


@dataclass(frozen=True, slots=True)
class Row:
    """One run of a suite.

    Attributes:
        names: axis → name of the choice.
        seed: of the run.
        scenario: shipped name or path.
        overrides: everything that is set.
    """

    names: dict[str, str]
    seed: int
    scenario: str
    overrides: Overrides

    @property
    def key(self) -> str:
        """Name of the row's folder."""
        return "-".join([*(self.names[axis] for axis in AXES), str(self.seed)])

    def arguments(self, out: Path) -> list[str]:
        """Of `ttwmr`, to run this row."""
        sets = [word for item in (*self.overrides, *LEAN) for word in ("--set", item)]
        return ["run", self.scenario, *sets, "--seed", str(self.seed), "--out", str(out)]

    def command(self) -> str:
        """What a person types to run this row again, with its recording and figures."""
        sets = [word for item in self.overrides for word in ("--set", item)]
        return shlex.join(["ttwmr", "run", self.scenario, *sets, "--seed", str(self.seed)])


def load_suite(name_or_path: str) -> Suite:
    """Read a suite: a TOML file, or the name of a shipped one.

    Raises:
        InputError: there is no such suite, or it is wrong; with every fault in one message.
    """
    path = Path(name_or_path)
    shipped = {file.stem: file for file in sorted(sweeps_folder().glob("*.toml"))}
    if not path.is_file():
        if name_or_path not in shipped:
            raise InputError(
                f"{name_or_path}: no such suite file, and no shipped suite of that name; shipped: "
                f"{', '.join(shipped)}"
            )
        path = shipped[name_or_path]
    try:
        suite = Suite.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: cannot be read as TOML: {error}") from error
    except ValidationError as error:
        faults = [
            f"  {'.'.join(map(str, item['loc']))}: got {item['input']!r}; {item['msg']}"
            for item in error.errors()
        ]
        raise InputError("\n".join([f"{path}: {len(faults)} errors", *faults])) from error
    missing = [name for name, task in suite.task.items() if task.scenario is None]
    if missing:
        raise InputError(f"{path}: task.{missing[0]}.scenario: missing; name a scenario")
    return suite


def rows_of(suite: Suite) -> Iterator[Row]:
    """Every row, seeds innermost."""
    axes = [getattr(suite, axis) for axis in AXES]
    for names in itertools.product(*axes):
        choices: list[Choice] = [axis[name] for axis, name in zip(axes, names, strict=True)]
        if any(name in choice.skip for choice in choices for name in names):
            continue
        scenario = choices[AXES.index("task")].scenario or ""
        overrides = tuple(item for choice in choices for item in choice.overrides)
        for seed in suite.seeds:
            yield Row(dict(zip(AXES, names, strict=True)), seed, scenario, overrides)
