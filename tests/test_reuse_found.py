"""Code of laws that a result is made of, wherever Python's import system finds it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import types
import zipfile
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import spec_from_file_location
from pathlib import Path

import pytest
from packaged import start

from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.pool.ingredients import made_of_run

LAWS = """
import numpy
import helpers.sums
from . import gains
from .far import Factor
from gamma import data
"""
SCENARIO = """
name = "factored"
duration_s = 0.2
plant.kind = "analytic"
reference = {kind = "circle", radius_m = 0.43, angular_rate_rad_s = 0.125, theta2 = "outward"}
controller.kind = "gamma"
"""
LAW = """
from typing import Literal
import numpy as np
from ttwmr_mj.controllers.base import ControllerOptions, Law

FACTOR = 0.5

class Gamma(Law):
    def start(self, task):
        self.task = task

    def command(self, k, estimate):
        return self.plain(np.full((self.task.nsim, 2), FACTOR))

class Options(ControllerOptions):
    "Goes on."
    law = Gamma
    kind: Literal["gamma"] = "gamma"
"""
SITE = """
import sys
from importlib.util import spec_from_file_location

class Finder:
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name == "gamma":
            return spec_from_file_location(name, {file!r})

sys.meta_path.append(Finder)
"""


class Editable:
    """Finds packages where an editable installation says that they are."""

    def __init__(self, places: dict[str, Path]) -> None:
        self.places = places

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: object = None
    ) -> ModuleSpec | None:
        above, _, _ = name.rpartition(".")
        if name in self.places:
            return spec_from_file_location(name, self.places[name] / "__init__.py")
        if above in self.places:  # as setuptools does
            return PathFinder.find_spec(name, [str(self.places[above])])
        return None


def write(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("X = 1\n")


def gamma(folder: Path) -> Path:
    """A package with a law, in a folder of another name."""
    write(folder, "__init__.py", "gains.py", "far/__init__.py", "far/unused.py", "data/table.txt")
    (folder / "laws.py").write_text(LAWS)
    return folder


def code(folder: Path, law: str = "gamma.laws") -> dict[str, str]:
    """What counts of others' modules."""
    scenario = load_scenario("lab_circle", [f'controller={{kind="custom", target="{law}:Mine"}}'])
    found = made_of_run(scenario, folder)["code"].items()
    return {name: digest for name, digest in found if not name.startswith("ttwmr_mj")}


def test_a_package_that_only_a_finder_knows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = {"gamma": gamma(tmp_path / "source"), "helpers": tmp_path / "more"}
    write(tmp_path / "more", "__init__.py", "sums.py")
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, Editable(places)])
    before = code(tmp_path)
    ours = {"gamma", "gamma.laws", "gamma.gains", "gamma.far"}
    assert set(before) == {*ours, "helpers", "helpers.sums"}  # both are edited
    for name, path in (("gamma.laws", "source/laws.py"), ("helpers.sums", "more/sums.py")):
        (tmp_path / path).write_text((tmp_path / path).read_text() + "FACTOR = 0.9\n")
        after = code(tmp_path)
        assert {key for key in after if after[key] != before[key]} == {name}
        before = after
    assert not {"gamma", "helpers"} & sys.modules.keys()  # none of it has run


def test_parts_of_a_namespace_in_several_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "one/lab/inner/laws.py", "two/lab/inner/gains.py", "three/other.py")
    (tmp_path / "one/lab/inner/laws.py").write_text("from lab.inner import gains\nimport other\n")
    for place in ("one", "two", "three"):
        monkeypatch.syspath_prepend(str(tmp_path / place))
    assert set(code(tmp_path, "lab.inner.laws")) == {"lab.inner.laws", "lab.inner.gains", "other"}


def zipped(folder: Path) -> Path:
    """A package in an archive."""
    gamma(folder / "source" / "gamma")
    shutil.make_archive(str(folder / "laws"), "zip", folder / "source")
    return folder / "laws.zip"


def built(folder: Path) -> Path:
    """A package whose law was built, in whatever language."""
    law = gamma(folder / "gamma") / "laws.py"
    law.unlink()
    law = law.with_suffix(".so")
    law.write_bytes(b"\x7fELF\x00")
    return law


@pytest.mark.parametrize("made", [zipped, built])
def test_without_source_the_file_counts_and_all_of_the_package(
    made: Callable[[Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = made(tmp_path)
    monkeypatch.syspath_prepend(str(file if file.suffix == ".zip" else tmp_path))
    before = code(tmp_path)
    assert {"gamma", "gamma.laws", "gamma.gains", "gamma.far", "gamma.far.unused"} <= set(before)
    if file.suffix == ".zip":
        with zipfile.ZipFile(file, "a") as archive:
            archive.writestr("more.txt", "more")
    else:
        file.write_bytes(b"\x7fELF\x01")
    assert code(tmp_path)["gamma.laws"] != before["gamma.laws"]


def test_code_that_is_in_no_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "gamma", types.ModuleType("gamma"))
    with pytest.raises(InputError, match="code of gamma is in no file, and nobody could tell when"):
        code(tmp_path, "gamma")
    assert code(tmp_path, "nobody.has_it") == {}  # the run says so


@pytest.mark.slow
def test_an_edited_law_of_an_editable_package_is_made_again(tmp_path: Path) -> None:
    """The same commands after an edit: `sweep` refuses the folder, `bench` runs again."""
    law = tmp_path / "source" / "laws.py"
    write(tmp_path / "source", "__init__.py")
    law.write_text(LAW)
    (tmp_path / "sitecustomize.py").write_text(SITE.format(file=str(law.parent / "__init__.py")))
    info = tmp_path / "gamma-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: gamma\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[ttwmr_mj.controllers]\ngamma = gamma.laws:Options\n")
    (tmp_path / "factored.toml").write_text(SCENARIO)
    (tmp_path / "s.toml").write_text('name = "s"\nscenario = "factored.toml"\n')
    suite = 'name = "b"\ntask.factored.scenario = "factored.toml"\n'
    (tmp_path / "b.toml").write_text(f"{suite}controller.gamma.overrides = []\n")

    def ttwmr(command: str) -> subprocess.CompletedProcess[str]:
        return start(tmp_path, "-m", "ttwmr_mj", command, f"{command[0]}.toml", "--out", command)

    for command in ("sweep", "bench"):
        done = ttwmr(command)
        assert done.returncode == 0, done.stderr
    parquet = next((tmp_path / "bench").rglob("trajectory.parquet"))
    before = parquet.read_bytes()
    law.write_text(LAW.replace("FACTOR = 0.5", "FACTOR = 0.9"))
    refused = ttwmr("sweep")
    assert refused.returncode == 2
    (told,) = [line for line in refused.stderr.splitlines() if "made_of" in line]
    assert re.search(r'made_of.code.gamma.laws: was "\w{16}", is "\w{16}"$', told)
    assert ttwmr("bench").returncode == 0
    assert parquet.read_bytes() != before
