"""Scripts and the notebook of examples/ run as they stand, and say what their pages say."""

from __future__ import annotations

import contextlib
import io
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
SAID = {  # what shows that a script does what its page says
    "by_camera": r"followed: .*\nlabels found per image: [34]\.",
    "free_trailer": r"(from .* energy within \d\.\de-(0[89]|1\d)\n){3}",
    "hitch_damping": r"0\.0 .* by 1\d\.\d+°(.*\n)+ *3\.0 .* by 0\.\d+°",
    "own_law": r"gain 0\.5: 0\.2\d\d mm .*\ngain 1\.0: 0\.000",
    "own_robot": r"told the truth: followed: .*0\.000° off at the end\ntold Table I's trailer: ",
    "three_laws": r"flatness  P 0\.\d+ mm.*\ntvlqr     P 0\.000\d mm.*\nmpc       P 0\.000\d mm",
    "trailer_inside": r"law \(32\): tractor follows, trailer lost: .*\n.*LQR: followed: ",
}


def test_every_script_is_expected_to_say_something() -> None:
    assert [script.stem for script in SCRIPTS] == sorted(SAID)


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(script, marks=pytest.mark.slow if script.stem == "three_laws" else [])
        for script in SCRIPTS
    ],
    ids=lambda script: script.stem,
)
def test_a_script_runs_and_says_what_its_page_says(
    script: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plt, "show", lambda: None)
    told = io.StringIO()
    with mpl.rc_context({"backend": "agg"}), contextlib.redirect_stdout(told):
        try:
            runpy.run_path(str(script))
            (figure,) = map(plt.figure, plt.get_fignums())
            assert all(axes.has_data() for axes in figure.axes)
        finally:
            plt.close("all")
    assert re.search(SAID[script.stem], told.getvalue()), told.getvalue()


@pytest.mark.slow
def test_a_script_runs_by_itself(tmp_path: Path) -> None:
    command = [sys.executable, "-W", "ignore", str(EXAMPLES / "free_trailer.py")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_notebook_runs_and_its_outputs_are_not_kept(tmp_path: Path) -> None:
    nbclient = pytest.importorskip("nbclient")
    import nbformat

    notebook = nbformat.read(EXAMPLES / "first_steps.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    done = nbclient.NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    told = json.dumps([cell.get("outputs") for cell in done.cells])
    assert "followed: " in told
    assert "(182, 1, 4)" in told
    assert "image/png" in told
