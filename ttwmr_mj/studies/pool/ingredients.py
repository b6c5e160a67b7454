"""What a result is made of; a finished one may be used again if and only if that is the same.

A run is made of its resolved scenario, the data files that names, the code that computes, and the
libraries. What a custom controller reads by itself is not known here.
"""

import hashlib
import platform
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from ttwmr_mj.assets import models_folder
from ttwmr_mj.controllers.base import CONTROLLERS
from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.files import resolved
from ttwmr_mj.plants.model.scene.files import scene_files
from ttwmr_mj.references.planned import Planned
from ttwmr_mj.references.shared.reference import REFERENCES
from ttwmr_mj.runs.files.folder import library_version
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.pool.code import NAME, PACKAGE, Follows, code_of, follow_all

Ingredients = dict[str, Any]  # "scenario", "data", "code", "libraries"
LIBRARIES = ("mujoco", "numpy", "scipy", "opencv-python-headless")
ENTRY = f"{NAME}.runs.execute"
PLANTS = ("contact", "analytic")  # each in a module of its name


def made_of_run(
    scenario: Scenario, folder: Path | None = None, entries: Sequence[str] = (ENTRY,)
) -> Ingredients:
    """What a run is made of, as plain data.

    Args:
        scenario: resolved.
        folder: where a custom controller is looked for first; None: here.
        entries: modules that run it.
    """
    return {
        "scenario": scenario.model_dump(mode="json"),
        "data": {shown_path(path): digest(path) for path in sorted(set(data_files(scenario)))},
        "code": _code_of_run(scenario, folder or Path(), entries),
        "libraries": _libraries(LIBRARIES),
    }


def made_of_study(module: str, libraries: tuple[str, ...]) -> Ingredients:
    """What a computation without a run is made of: its module and all that this imports."""
    return {"code": code_of([module]), "libraries": _libraries(libraries)}


def differences(stored: Any, now: Any, where: str = "") -> list[str]:
    """Where two of these differ: dotted keys, such as "code.ttwmr_mj.robot"."""
    if not (isinstance(stored, dict) and isinstance(now, dict)):
        return [] if stored == now else [where]
    keys = sorted(stored.keys() | now.keys())
    pairs = ((f"{where}.{key}" if where else key, stored.get(key), now.get(key)) for key in keys)
    return [found for inner, a, b in pairs for found in differences(a, b, inner)]


@cache
def _libraries(names: tuple[str, ...]) -> dict[str, str | None]:
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: library_version(name) for name in names}}


def digest(path: Path) -> str | None:
    """Of a file's bytes; None if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path.is_file() else None


def shown_path(path: Path) -> str:
    """A file's name wherever the package is installed, else its path."""
    for home in (PACKAGE / "_data", PACKAGE, PACKAGE.parent):
        if path.is_relative_to(home):
            return path.relative_to(home).as_posix()
    return str(path)


def data_files(scenario: Scenario) -> Iterator[Path]:
    """Every file that the scenario's numbers come from."""
    contact, sensing, reference = scenario.plant.contact, scenario.sensing, scenario.reference
    calibration = getattr(sensing, "calibration_path", None)
    if calibration is not None:
        yield resolved(Path(calibration))
    if isinstance(reference, Planned):
        shipped = PACKAGE / "references" / "data" / f"{reference.plan}.csv"
        yield resolved(Path(reference.plan)) if reference.plan.endswith(".csv") else shipped
    if scenario.plant.kind == "contact" or sensing.kind == "camera":
        yield from scene_files(Path(contact.model_path or models_folder() / "scene.xml"))


def _code_of_run(scenario: Scenario, folder: Path, runners: Sequence[str]) -> dict[str, str]:
    follows, law = _follows(scenario), scenario.controller
    code = code_of([*runners, *_chosen(scenario)], follows)
    if isinstance(law, CustomOptions):
        module = law.target.partition(":")[0]
        code |= code_of([module], follows, resolved(folder / (law.folder or "")))
    return dict(sorted(code.items()))


def _follows(scenario: Scenario) -> Follows:
    """Imports that lead to code of this run: no other law, reference or plant, no unused camera."""
    kinds = {cls.__module__ for registry in (CONTROLLERS, REFERENCES) for cls in registry.values()}
    kinds |= {_plant(kind) for kind in PLANTS}
    unused = kinds - set(_chosen(scenario))
    sees = scenario.sensing.kind == "camera"
    vision, options = f"{NAME}.vision.", f"{NAME}.vision.options"

    def follows(importer: str, imported: str) -> bool:
        if imported.startswith(f"{NAME}.studies") or not follow_all(importer, imported):
            return False
        if imported.startswith(vision) and not sees:
            return imported == options or importer.startswith(vision)
        # one law may be built on another, and a user's on any
        return imported not in unused or importer in kinds or not importer.startswith(f"{NAME}.")

    return follows


def _chosen(scenario: Scenario) -> list[str]:
    """Modules of the law, the reference and the plant that the scenario names."""
    options = scenario.controller, scenario.reference
    return [*(type(section).__module__ for section in options), _plant(scenario.plant.kind)]


def _plant(kind: str) -> str:
    return f"{NAME}.plants.{kind}"
