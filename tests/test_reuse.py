"""When a finished run is used again: a copy of the package is edited, one input at a time."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.pool.ingredients import data_files, differences, made_of_run
from ttwmr_mj.studies.pool.task import run_task

CHECKOUT = Path(__file__).resolve().parent.parent
EVERY = {"contact", "custom", "planned", "camera", "study"}

DRIVER = """
import json, re, sys
from pathlib import Path
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.pool.ingredients import made_of_study
from ttwmr_mj.studies.pool.jobs import Job
from ttwmr_mj.studies.pool.task import Work, run_task

here = Path().resolve()
analytic = "plant.kind=analytic"
mine = 'controller={kind="custom", target="mine:Mine"}'
RUNS = {
    "contact": ("lab_circle", [f"plant.contact.model_path={here}/scene.xml"]),
    "custom": ("lab_circle", [analytic, mine]),
    "planned": ("rest_to_rest", [analytic, f"reference.plan={here}/plan.csv"]),
    "camera": ("lab_circle_camera", [f"sensing.calibration_path={here}/lab.yaml"]),
}

def tasks():
    for name, (base, overrides) in RUNS.items():
        yield run_task(name, load_scenario(base, overrides), Path("out") / name, [], Path())
    module = "ttwmr_mj.studies.reproduce.ideal.phase_plane"
    made_of = made_of_study(module, ("numpy",))
    yield Work(made_of, Path("out/study.json"), (), job=Job("study", print))

for task in tasks():
    assert task.changes() is None and not task.is_done
    task.mark_done()
    assert task.is_done
found = {}
for name, file, pattern, text in json.loads(sys.argv[1]):
    before = Path(file).read_text()
    after, count = re.subn(pattern, text, before, count=1)
    assert count == 1, name
    Path(file).write_text(after)
    found[name] = {task.job.name: task.changes() for task in tasks() if not task.is_done}
    Path(file).write_text(before)
assert all(task.is_done for task in tasks())
print(json.dumps(found))
"""

END, CODE = r"\Z", "\nEXTRA = 1\n"
# what is edited: (file, pattern, replacement), which runs are made again, and why
EDITS = {
    "default": (
        ("ttwmr_mj/robot/bodies.py", r"(float = (?:Field\(\s*default=)?)0\.", r"\g<1>9."),
        EVERY,
        "code.ttwmr_mj.robot.bodies",
    ),
    "docstring": (("ttwmr_mj/robot/bodies.py", '"""', '"""Other words. '), set(), ""),
    "comment": (("ttwmr_mj/robot/bodies.py", END, "\n# a comment\n"), set(), ""),
    "imported lazily": (
        ("ttwmr_mj/vision/tracking/kalman.py", END, CODE),
        {"camera"},
        "code.ttwmr_mj.vision.tracking.kalman",
    ),
    "a plant": (
        ("ttwmr_mj/plants/analytic.py", END, CODE),
        {"custom", "planned"},
        "code.ttwmr_mj.plants.analytic",
    ),
    "another law": (("ttwmr_mj/controllers/mpc.py", END, CODE), set(), ""),
    "a law that a user's builds on": (
        ("ttwmr_mj/controllers/open_loop.py", END, CODE),
        {"custom"},
        "code.ttwmr_mj.controllers.open_loop",
    ),
    "recording": (("ttwmr_mj/recording/scene/robot.py", END, CODE), set(), ""),
    "figures": (("ttwmr_mj/figures/run.py", END, CODE), set(), ""),
    "command line": (("ttwmr_mj/cli/main.py", END, CODE), set(), ""),
    "study": (
        ("ttwmr_mj/studies/reproduce/ideal/phase_plane.py", END, CODE),
        {"study"},
        "code.ttwmr_mj.studies.reproduce.ideal.phase_plane",
    ),
    "robot's model": (
        ("models/ttwmr.xml", END, "\n"),
        {"contact", "camera"},
        "data.models/ttwmr.xml",
    ),
    "own scene": (("scene.xml", END, "\n"), {"contact"}, "data.scene.xml"),
    "included part": (("part.xml", END, "\n"), {"contact"}, "data.part.xml"),
    "plan": (("plan.csv", END, "\n"), {"planned"}, "data.plan.csv"),
    "calibration": (("lab.yaml", END, "\n"), {"camera"}, "data.lab.yaml"),
    "custom controller": (("mine.py", END, CODE), {"custom"}, "code.mine"),
    "module beside it": (("helper.py", END, CODE), {"custom"}, "code.helper"),
    "module nobody imports": (("stranger.py", END, CODE), set(), ""),
}


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout's copy, with a scene, a plan, a calibration and a law of a user's in it."""
    folder = tmp_path_factory.mktemp("copy")
    for name in ("ttwmr_mj", "models", "scenarios", "sweeps"):
        unwanted = shutil.ignore_patterns("__pycache__")
        shutil.copytree(CHECKOUT / name, folder / name, ignore=unwanted)
    shutil.copy(folder / "ttwmr_mj/references/data/rest_to_rest.csv", folder / "plan.csv")
    shutil.copy(folder / "scenarios/calibration/lab_camera.yaml", folder / "lab.yaml")
    (folder / "scene.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    (folder / "part.xml").write_text('<mujoco><include file="models/ttwmr.xml"/></mujoco>')
    (folder / "mine.py").write_text(
        "import numpy\nimport helper\nfrom ttwmr_mj.controllers import open_loop\nclass Mine: ...\n"
    )
    for name in ("helper.py", "stranger.py"):
        (folder / name).write_text("X = 1\n")
    return folder


@pytest.mark.slow
def test_a_run_is_made_again_if_and_only_if_what_it_is_made_of_has_changed(copy: Path) -> None:
    edits = [(name, *edit) for name, (edit, _, _) in EDITS.items()]
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, json.dumps(edits)],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    for name, (_, again, why) in EDITS.items():
        assert set(found[name]) == again, name
        for changes in found[name].values():
            assert changes == [why], name


def test_a_changed_scenario_library_or_missing_file_is_told_apart(tmp_path: Path) -> None:
    scenario = load_scenario("lab_circle")
    task = run_task("a", scenario, tmp_path, [])
    task.mark_done()
    stored = json.loads(task.mark.read_text())
    assert set(stored) == {"scenario", "data", "code", "libraries", "files"}
    assert {"python", "mujoco", "numpy", "scipy", "opencv-python-headless"} == set(
        stored["libraries"]
    )
    other = run_task("a", load_scenario("lab_circle", ["seed=1", "duration_s=9.9"]), tmp_path, [])
    assert other.changes() == ["scenario.duration_s", "scenario.seed"]
    stored["libraries"]["numpy"] = "0.1"
    task.mark.write_text(json.dumps(stored))
    assert task.changes() == ["libraries.numpy"]
    task.mark.write_text("{")  # half a file
    assert task.changes() is None


def test_differences_are_found_at_every_depth() -> None:
    assert differences({"a": {"b": 1, "c": [1, 2]}}, {"a": {"b": 1, "c": [1, 2]}}) == []
    assert differences({"a": {"b": 1}, "d": 1}, {"a": {"b": 2, "c": 0}}) == ["a.b", "a.c", "d"]


def test_a_scene_brings_its_meshes_and_pictures(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for name in ("meshes/hull.stl", "floor.png"):
        (tmp_path / name).touch()
    (tmp_path / "scene.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh file="hull.stl"/>'
        '<texture file="floor.png"/><texture file="missing.png"/></asset></mujoco>'
    )
    scenario = load_scenario("lab_circle", [f"plant.contact.model_path={tmp_path}/scene.xml"])
    names = {path.relative_to(tmp_path).as_posix() for path in data_files(scenario)}
    assert names == {"scene.xml", "meshes/hull.stl", "floor.png"}


def test_of_an_installed_law_only_its_own_package_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site-packages"
    (site / "laws").mkdir(parents=True)
    (site / "other.py").touch()
    (site / "laws" / "__init__.py").touch()
    (site / "laws" / "mine.py").write_text("import other\nfrom . import gains\nfrom .. import laws")
    (site / "laws" / "gains.py").touch()
    (site / "laws" / "unused.py").touch()
    monkeypatch.syspath_prepend(str(site))
    law = 'controller={kind="custom", target="laws.mine:Mine"}'
    code = made_of_run(load_scenario("lab_circle", [law]), tmp_path)["code"]
    assert {name for name in code if not name.startswith("ttwmr_mj")} == {
        "laws",
        "laws.mine",
        "laws.gains",
    }
    assert "ttwmr_mj.controllers.custom" in code
