"""A law of the user's is of the file that its scenario means, as that file is now."""

from __future__ import annotations

import importlib
import os
import pickle
import re
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.controllers.shared.own.source import inspected

LAW = """
import numpy as np
import ttwmr_mj as tt
{more}
class L(tt.Controller):
    speed = {speed}
    def start(self, task):
        self.nsim = task.nsim
    def command(self, k, estimate):
        return self.plain(np.full((self.nsim, 2), float(self.speed)))
"""
SCENARIO = """
name = "mine"
duration_s = 0.1
plant.kind = "analytic"
reference.kind = "none"
controller = {kind = "custom", target = "NAME:L"}
"""


def write(file: Path, speed: object, more: str = "") -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(LAW.format(speed=speed, more=more))


def made(folder: Path, module: str) -> Any:
    return CustomOptions(target=f"{module}:L").make(folder)


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    modules, path = {**sys.modules}, [*sys.path]
    yield
    assert sys.path == path
    for name in sys.modules.keys() - modules.keys():
        if not name.startswith("ttwmr_mj"):
            del sys.modules[name]


def test_laws_of_one_name_in_two_folders_are_run_each(tmp_path: Path) -> None:
    scenarios = []
    for folder, speed in (("one", 3.0), ("two", 2.0)):
        write(tmp_path / folder / "law_a.py", speed)
        (tmp_path / folder / "s.toml").write_text(SCENARIO.replace("NAME", "law_a"))
        scenarios.append(tt.load_scenario(tmp_path / folder / "s.toml"))
    for folder, speed in (("one", 3.0), ("two", 2.0), ("one", 3.0)):
        scenario = scenarios[folder == "two"]
        result = tt.simulate(scenario, scenario_folder=tmp_path / folder)
        assert (result.trajectory.wheel_command_rad_s == speed).all()
    placed = [
        scenario.model_copy(update={"controller": scenario.controller.placed(tmp_path / folder)})
        for scenario, folder in zip(scenarios, ("one", "two"), strict=True)
    ]
    for result, speed in zip(tt.run_batch(placed), (3.0, 2.0), strict=True):
        assert (result.trajectory.wheel_command_rad_s == speed).all()


@pytest.mark.parametrize(
    ("module", "law", "helper", "said"),
    [
        ("law_b", "law_b.py", "helpers_b.py", "from helpers_b import SPEED"),
        ("pack_b.law", "pack_b/law.py", "pack_b/gains.py", "from pack_b.gains import SPEED"),
        ("pack_c.law", "pack_c/law.py", "pack_c/__init__.py", "from pack_c import SPEED"),
        ("pack_d", "pack_d/__init__.py", "pack_d/gains.py", "from .gains import SPEED"),
    ],
)
def test_what_a_law_imports_is_from_its_folder_and_as_it_is_now(
    module: str, law: str, helper: str, said: str, tmp_path: Path
) -> None:
    """`pack_b` is a namespace: a folder without a file of its own."""
    for folder, speed in (("one", 3), ("two", 2)):
        write(tmp_path / folder / law, "SPEED", said)
        (tmp_path / folder / helper).write_text(f"SPEED = {speed}")
    first = made(tmp_path / "one", module)
    assert (first.speed, made(tmp_path / "two", module).speed) == (3, 2)
    (tmp_path / "two" / helper).write_text("SPEED = 5")
    assert made(tmp_path / "two", module).speed == 5
    assert first.speed == 3  # it runs on


def test_helpers_of_one_name_under_laws_of_two(tmp_path: Path) -> None:
    for folder, speed in (("one", 3), ("two", 2)):
        write(tmp_path / folder / f"law_{folder}.py", "helpers_e.SPEED", "import helpers_e")
        (tmp_path / folder / "helpers_e.py").write_text(f"SPEED = {speed}")
    assert made(tmp_path / "one", "law_one").speed == 3
    assert made(tmp_path / "two", "law_two").speed == 2
    with pytest.raises(tt.InputError, match="No module named 'law_one'"):
        made(tmp_path / "two", "law_one")


def test_a_law_that_another_folder_has_is_none_of_this(tmp_path: Path) -> None:
    write(tmp_path / "one" / "law_k.py", 3)
    made(tmp_path / "one", "law_k")
    with pytest.raises(tt.InputError, match="No module named 'law_k'"):
        made(tmp_path / "two", "law_k")
    write(tmp_path / "two" / "law_k.py", 2)
    assert made(tmp_path / "two", "law_k").speed == 2  # though there was no such folder
    assert inspected("law_k:L", {}, tmp_path / "one") == []


def test_a_law_that_was_edited_is_run_as_it_is_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "law_f.py"
    write(file, 3)
    assert made(tmp_path, "law_f").speed == 3
    for speed in (4, 5):  # of the same size and, for bytecode, of the same time
        before = file.stat()
        write(file, speed)
        os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns // 10**9 * 10**9 + speed))
        assert made(tmp_path, "law_f").speed == speed
    file.write_text("import nowhere_f")
    with pytest.raises(tt.InputError, match="importing law_f raised ModuleNotFoundError"):
        made(tmp_path, "law_f")
    write(file, 6)
    assert made(tmp_path, "law_f").speed == 6


def test_a_law_that_did_not_change_is_the_same_class(tmp_path: Path) -> None:
    write(tmp_path / "law_g.py", 3)
    law = made(tmp_path, "law_g")
    assert type(made(tmp_path, "law_g")) is type(law)
    assert type(pickle.loads(pickle.dumps(law))) is type(law)


def test_a_law_that_a_script_imported_is_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("one", "two"):
        write(tmp_path / folder / "law_h.py", 3)
    monkeypatch.syspath_prepend(str(tmp_path / "one"))
    import law_h  # type: ignore[import-not-found]

    monkeypatch.undo()
    assert type(made(tmp_path / "one", "law_h")) is law_h.L
    told = f"law_h is the name of {tmp_path}/one/law_h.py already, .*; give {tmp_path}/two/law_h.py"
    with pytest.raises(tt.InputError, match=told):
        made(tmp_path / "two", "law_h")
    assert sys.modules["law_h"] is law_h


@pytest.mark.parametrize(
    ("imported", "of_script", "of_law", "said"),
    [
        ("gains_m", ["gains_m.py"], "gains_m.py", "import gains_m"),
        ("gains_n", ["gains_n/__init__.py"], "gains_n.py", "import gains_n"),
        ("gains_o", ["gains_o/__init__.py"], "gains_o/__init__.py", "import gains_o"),
        ("gains_p.own", ["gains_p/own.py"], "gains_p/own.py", "import gains_p.own"),
        (
            "gains_q",
            ["gains_q/__init__.py", "gains_q/own.py"],
            "gains_q/own.py",
            "import gains_q.own",
        ),
        ("gains_r", ["gains_r/own.py"], "gains_r/__init__.py", "import gains_r.own"),
    ],
)
def test_a_helper_that_a_script_imported_from_elsewhere_is_not_the_laws(
    imported: str,
    of_script: list[str],
    of_law: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Packages without an `__init__.py` are folders whose parts may be anywhere."""
    law, script = tmp_path / "law", tmp_path / "script"
    write(law / "law_m.py", 3, said)
    for file in (law / of_law, *(script / name for name in of_script)):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("")
    monkeypatch.syspath_prepend(str(script))
    importlib.import_module(imported)
    told = f"is the name of {script}/gains_.* already, .*; give {law}/{of_law} another name"
    with pytest.raises(tt.InputError, match=told):
        made(law, "law_m")
    assert re.search(told, str(inspected("law_m:L", {}, law)[0]))


def test_a_helper_that_a_script_imported_too_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "law_s.py", "helper_s.SPEED", "import helper_s")
    (tmp_path / "helper_s.py").write_text("SPEED = 3")
    monkeypatch.syspath_prepend(str(tmp_path))
    its = importlib.import_module("helper_s")
    assert made(tmp_path, "law_s").speed == 3
    assert sys.modules["helper_s"] is its


def test_what_a_script_has_imported_has_the_scripts_helpers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "one" / "law_v.py", "helper_v.SPEED", "import helper_v")
    for folder, speed in (("one", 3), ("two", 2)):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "helper_v.py").write_text(f"SPEED = {speed}")
    monkeypatch.syspath_prepend(str(tmp_path / "one"))
    importlib.import_module("law_v")
    assert made(tmp_path / "two", "law_v").speed == 3
    assert inspected("law_v:L", {}, tmp_path / "two") == []


def test_files_that_a_law_does_not_import_take_no_name(tmp_path: Path) -> None:
    """Nor do folders of the names of what it imports, such as those of results."""
    more = "import queue\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import signal"
    write(tmp_path / "law_t.py", 3, more)
    for name in ("test", "statistics", "signal", "time", "rerun", "ttwmr_mj"):
        (tmp_path / f"{name}.py").write_text("raise ValueError")
    for name in ("numpy", "queue"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.py").write_text("raise ValueError")
    assert inspected("law_t:L", {}, tmp_path) == []
    assert made(tmp_path, "law_t").speed == 3


def test_a_law_that_is_not_found_is_told_where_scripts_say_it_is(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO.replace("NAME", "law_u"))
    scenario = tt.load_scenario(tmp_path / "s.toml")
    told = f"here in {re.escape(str(Path.cwd()))} .scripts say where with scenario_folder"
    with pytest.raises(tt.InputError, match=told):
        tt.simulate(scenario)


def test_a_law_defined_in_a_script(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    class Here(tt.Controller):
        def start(self, task: tt.Task) -> None:
            pass

        def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
            return self.plain(np.zeros((1, 2)))

    monkeypatch.setattr(sys.modules["__main__"], "L", Here, raising=False)
    for folder in ("one", "two"):
        assert isinstance(made(tmp_path / folder, "__main__"), Here)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("platform", "platform is the name of .*platform.py already, .*; give .*platform.py"),
        ("zipapp", "zipapp is the name of .*zipapp.py already"),  # which nobody imports
        ("rerun", "rerun is the name of .*rerun/__init__.py already"),  # drawing comes later
        ("time", "time is built into Python, .*; give .*time.py another name"),
    ],
)
@pytest.mark.parametrize("command", ["validate", "run"])
@pytest.mark.parametrize("helper", [False, True])
def test_a_name_of_pythons_own_is_refused(
    *,
    helper: bool,
    command: str,
    name: str,
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write(tmp_path / f"{name}.py", 3)
    write(tmp_path / "law_l.py", 3, "import helper_l")
    (tmp_path / "helper_l.py").write_text(f"def later():\n    import {name}")
    (tmp_path / "s.toml").write_text(SCENARIO.replace("NAME", "law_l" if helper else name))
    out = ["--out", str(tmp_path / "out")] if command == "run" else []
    assert main([command, str(tmp_path / "s.toml"), *out]) == 2
    assert re.search(told, capsys.readouterr().err)


def test_threads_load_laws_of_one_name_at_once(tmp_path: Path) -> None:
    folders = [tmp_path / str(speed) for speed in range(8)]
    for speed, folder in enumerate(folders):
        write(folder / "law_i.py", speed)
    with ThreadPoolExecutor(8) as pool:
        laws = list(pool.map(lambda folder: made(folder, "law_i"), folders * 4))
    assert [law.speed for law in laws] == [*range(8)] * 4
