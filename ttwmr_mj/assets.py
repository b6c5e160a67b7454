"""Where models and scenarios are: beside the package in a checkout, inside it in a wheel."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    installed = _PACKAGE / "_data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def models_folder() -> Path:
    """Folder of ttwmr.xml and scene.xml."""
    return _folder("models")


def scenarios_folder() -> Path:
    """Folder of the shipped scenario files."""
    return _folder("scenarios")


def sweeps_folder() -> Path:
    """Folder of the shipped suites."""
    return _folder("sweeps")


def shipped_scenarios() -> dict[str, Path]:
    """Name of every shipped scenario and its file, sorted by name."""
    return {path.stem: path for path in sorted(scenarios_folder().glob("*.toml"))}
