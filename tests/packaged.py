"""A distribution that adds laws and references, as pip leaves it in a folder of the Python path."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

LAWS = '''
import os
from typing import Any, ClassVar, Literal
import numpy as np
from ttwmr_mj.controllers.base import ControllerOptions, Law
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.references.straight_line import StraightLine


class Listed(Law):
    def start(self, task):
        self.task = task

    def command(self, k, estimate):
        right, left = self._options.gains
        more = self._options.table["more"][0]
        wheels = np.empty((self.task.nsim, 2))
        wheels[:, 0], wheels[:, 1] = right + more, left
        return self.plain(wheels)


class ListedOptions(ControllerOptions):
    """Goes as its lists say."""

    law = Listed
    kind: Literal["listed"] = "listed"
    gains: list[float] = [1.0, 2.0]
    table: dict[str, list[float]] = {"more": [0.1]}


class StackedOptions(ControllerOptions):
    """The same, of many simulations at once."""

    law = Listed
    takes_stacks: ClassVar[bool] = True
    kind: Literal["listed_stack"] = "listed_stack"
    gains: list[float] = [1.0, 2.0]
    table: dict[str, list[float]] = {"more": [0.1]}


class Dither(Listed):
    def command(self, k, estimate):
        return self.plain(self.task.rng.normal(size=(self.task.nsim, 2)))


class DitherOptions(ListedOptions):
    """Draws."""

    law = Dither
    kind: Literal["dither"] = "dither"


class StackedDitherOptions(StackedOptions):
    """Says that it takes stacks, and draws."""

    law = Dither
    kind: Literal["dither_stack"] = "dither_stack"


class First(Listed):
    def command(self, k, estimate):
        speed = 1.0 + estimate.state.q[0, 0]
        return self.plain(np.full((self.task.nsim, 2), speed), {self._options.name: np.ones(1)})


class FirstOptions(ControllerOptions):
    """Looks at the first simulation, and logs what its options say."""

    law = First
    kind: Literal["first"] = "first"
    name: str = "one"


class Grabby(Listed):
    def __init__(self, options):
        super().__init__(options)
        options.table["more"].append(1.0)

    def start(self, task):
        super().start(task)
        object.__setattr__(task.robot.tractor, "mass_kg", 99.0)
        object.__setattr__(task.ground, "friction", 0.0)
        self._options.gains[0] += 1.0


class GrabbyOptions(ListedOptions):
    """Changes what it is given."""

    law = Grabby
    kind: Literal["grabby"] = "grabby"


class Leaving(Listed):
    def command(self, k, estimate):
        os._exit(3)


class LeavingOptions(ListedOptions):
    """Ends its process."""

    law = Leaving
    kind: Literal["leaving"] = "leaving"


class Line(Reference):
    """A line whose speed is in a list in a table."""

    kind: Literal["listed_line"] = "listed_line"
    table: dict[str, list[float]] = {"speeds": [0.1]}
    anything: Any = None

    def sample(self, time_s, robot):
        speed = self.table["speeds"][-1]
        return StraightLine(speed_m_s=speed * (2 if self.anything is True else 1)).sample(
            time_s, robot
        )
'''
POINTS = """
[ttwmr_mj.controllers]
listed = laws_of_others:ListedOptions
listed_stack = laws_of_others:StackedOptions
dither = laws_of_others:DitherOptions
dither_stack = laws_of_others:StackedDitherOptions
first = laws_of_others:FirstOptions
grabby = laws_of_others:GrabbyOptions
leaving = laws_of_others:LeavingOptions

[ttwmr_mj.references]
listed_line = laws_of_others:Line
"""
SCENARIO = """
name = "packaged"
duration_s = 0.3
plant.kind = "analytic"
initial.kind = "on_reference"
reference.kind = "listed_line"
controller.kind = "listed"
output = {recording = false, figures = false}
"""


def install(folder: Path) -> None:
    """The distribution, and a scenario packaged.toml."""
    (folder / "laws_of_others.py").write_text(LAWS)
    distribute(folder, "laws_of_others", POINTS)
    (folder / "packaged.toml").write_text(SCENARIO)


def distribute(folder: Path, name: str, points: str) -> None:
    """What pip leaves beside the code of a distribution with these entry points."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(exist_ok=True)
    metadata = f"Metadata-Version: 2.1\nName: {name.replace('_', '-')}\nVersion: 1.0\n"
    (info / "METADATA").write_text(metadata)
    (info / "entry_points.txt").write_text(points)


def start(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python with these words in a folder that is on its path, and wait for its end."""
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def python(folder: Path, *words: str) -> str:
    """What a process with the distribution prints, errors last.

    Raises:
        AssertionError: it failed.
    """
    done = start(folder, *words)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr
