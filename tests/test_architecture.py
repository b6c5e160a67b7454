"""What the import contracts of pyproject.toml cannot say: what is really loaded, and randomness."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import ttwmr_mj

PACKAGE = Path(ttwmr_mj.__file__).parent
HEAVY = {"mujoco", "cv2", "rerun", "matplotlib", "OpenGL", "sympy", "jinja2"}


def loaded_by(code: str) -> set[str]:
    """Heavy libraries that are there after the code."""
    code = f"import sys; {code}; print(*({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize(
    "module", ["dynamics.hybrid", "controllers.lyapunov", "results.metrics", "scenario.file"]
)
def test_importing_numerics_and_scenarios_loads_nothing_heavy(module: str) -> None:
    assert loaded_by(f"import ttwmr_mj.{module}") == set()


def test_the_root_loads_what_is_asked_for_only() -> None:
    code = "import ttwmr_mj as tt; found = [m for m in sys.modules if m.startswith('ttwmr_mj.')]"
    assert loaded_by(f"{code}; assert found == [], found; tt.load_scenario; tt.score") == set()
    assert loaded_by(f"{code}; tt.simulate(tt.load_scenario('straight_line', ['duration_s=0.1']))")


def test_the_public_api_is_what_it_says() -> None:
    """Every name is there, under the type checker as at run time, and documented."""
    import ast

    tree = ast.parse(Path(ttwmr_mj.__file__).read_text(encoding="utf-8"))
    checked = next(node for node in tree.body if isinstance(node, ast.If))
    for_mypy = {alias.name for node in checked.body for alias in node.names}  # type: ignore[attr-defined]
    assert set(ttwmr_mj.__all__) == for_mypy
    for name in ttwmr_mj.__all__:
        assert getattr(ttwmr_mj, name).__doc__, name
    assert {*ttwmr_mj.__all__, "__version__"} == set(dir(ttwmr_mj))
    with pytest.raises(AttributeError, match="has no attribute 'simulat'"):
        _ = ttwmr_mj.simulat


def test_no_module_uses_global_random_numbers() -> None:
    for path in PACKAGE.rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        assert "np.random.seed" not in source, path
        assert "import random" not in source, path
