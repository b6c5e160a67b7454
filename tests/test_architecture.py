"""Who may import what: numerics know no simulator, and heavy libraries have one door each."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "ttwmr_mj"
MODULES = sorted(PACKAGE.rglob("*.py"))
SIMULATORS = {"mujoco", "cv2", "rerun", "matplotlib"}
NUMERICS = ("dynamics", "references", "controllers", "results/metrics.py", "state.py")


def imports(path: Path) -> set[str]:
    """Top-level names of everything a module imports, also inside functions."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


def importers(library: str) -> set[str]:
    return {str(path.relative_to(PACKAGE)) for path in MODULES if library in imports(path)}


def test_numerics_import_no_simulator() -> None:
    for path in MODULES:
        if str(path.relative_to(PACKAGE)).startswith(NUMERICS):
            assert not imports(path) & SIMULATORS, path


def test_only_recordings_import_rerun() -> None:
    doors = {name for name in importers("rerun") if not name.startswith("recording/")}
    assert all(name.endswith("/recording.py") for name in doors)


def test_only_figure_modules_import_matplotlib() -> None:
    doors = {name for name in importers("matplotlib") if not name.startswith("figures/")}
    assert all(name.endswith(("/figures.py", "/drawings.py")) for name in doors)


def test_nothing_imports_the_command_line() -> None:
    users = [p for p in MODULES if "from ttwmr_mj.cli" in p.read_text()]
    outside = [p for p in users if PACKAGE / "cli" not in p.parents and p.name != "__main__.py"]
    assert outside == []


@pytest.mark.parametrize("module", ["dynamics.hybrid", "controllers.lyapunov", "results.metrics"])
def test_importing_numerics_loads_no_simulator(module: str) -> None:
    code = f"import sys, ttwmr_mj.{module}; print(sorted({SIMULATORS!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_module_uses_global_random_numbers() -> None:
    for path in MODULES:
        source = path.read_text(encoding="utf-8")
        assert "np.random.seed" not in source, path
        assert "import random" not in source, path
