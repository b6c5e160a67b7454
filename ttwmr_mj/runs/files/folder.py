"""The files of a run: every one appears whole or not at all."""

import platform
import shutil
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.files import write_json, write_text
from ttwmr_mj.runs.pushes import Push
from ttwmr_mj.scenario.file import dump_scenario
from ttwmr_mj.scenario.schema import Scenario

SCHEMA_VERSION = 1
LIBRARIES = ("mujoco", "numpy", "rerun-sdk", "opencv-python-headless", "pydantic", "pyarrow")


def results_folder(name: str, suffix: str | int) -> Path:
    """A new default folder: results/<name>/<UTC time>-<suffix>."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3] + "Z"
    return Path("results") / name / f"{stamp}-{suffix}"


def write_resolved(folder: Path, scenario: Scenario, beside: Path) -> None:
    """scenario.resolved.toml: every value that was used; `beside` is where a law was looked for."""
    if isinstance(scenario.controller, CustomOptions):
        law = scenario.controller.placed(beside)
        scenario = scenario.model_copy(update={"controller": law})
    head = "# Every value that was used, defaults included. Runs as it is.\n\n"
    write_text(folder / "scenario.resolved.toml", head + dump_scenario(scenario))


def write_manifest(folder: Path, scenario: Scenario, command_line: list[str]) -> None:
    """manifest.json: what produced this folder, and on what."""
    manifest = {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "pushes": [push.told() for push in Push.of_scenario(scenario)],
        "plant": scenario.plant.kind,
        "command_line": command_line,
        "created_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "ttwmr_mj": version("ttwmr-mj"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "libraries": {name: library_version(name) for name in LIBRARIES},
        "gl_backend": _gl_backend(scenario),
        "git_commit": git_commit(),
    }
    write_json(folder / "manifest.json", manifest)


def _gl_backend(scenario: Scenario) -> str | None:
    """What renders this run's frames; None where none are rendered."""
    if scenario.sensing.kind != "camera":
        return None
    from ttwmr_mj.vision.camera.rendering.gl import chosen_backend

    return chosen_backend()


def library_version(name: str) -> str | None:
    """Installed version of a distribution, or None."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def git_commit() -> str | None:
    """Commit of the checkout this code runs from, "-dirty" if changed; None outside one."""
    git, checkout = shutil.which("git"), Path(__file__).resolve().parents[2]
    if git is None or not (checkout / ".git").exists():
        return None
    command = [git, "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=40"]
    command += ["--exclude=*"]  # no names of tags
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (subprocess.SubprocessError, OSError):
        return None
    return done.stdout.strip()
