"""The tutorial, typed as it stands: each page in a folder of its own, block by block."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).resolve().parent.parent / "docs" / "tutorial"
WATCHED = ("bootstrap.py", "ttwmr view", "--live", "ttwmr bench")  # set-up, and what needs a person
VERDICTS = {  # how each run of a page ends
    "first_run": ["followed", "tractor follows, trailer lost"],
    "your_path": ["followed"],
    "your_law": ["followed"] * 4,
    "your_robot": ["followed", "followed"],
    "with_the_camera": ["followed"] + ["tractor follows, trailer lost"] * 2,
}


def test_every_page_that_runs_something_is_typed() -> None:
    runs = {page.stem for page in TUTORIAL.glob("*.md") if "ttwmr run" in page.read_text("utf-8")}
    assert runs == set(VERDICTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", VERDICTS)
def test_a_page_does_what_it_says(name: str, tmp_path: Path) -> None:
    text = (TUTORIAL / f"{name}.md").read_text(encoding="utf-8")
    if name in ("your_law", "your_robot"):  # which go on with the files of that page
        plan = (TUTORIAL / "your_path.md").read_text(encoding="utf-8")
        assert typed(plan.split("```sh\n")[1].split("```")[0], tmp_path).returncode == 0
    told = ""
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", text, flags=re.M | re.S):
        if language == "toml":
            (tmp_path / f"{tomllib.loads(block)['name']}.toml").write_text(block)
            done = typed(f"ttwmr validate {tomllib.loads(block)['name']}.toml", tmp_path)
        elif language == "python":
            done = run([sys.executable, "-c", block], tmp_path)
        elif any(word in block for word in WATCHED):
            continue
        else:
            done = typed(block, tmp_path)
        assert done.returncode == 0, f"{block}\n{done.stdout}\n{done.stderr}"
        told += done.stdout
    found = re.findall(r"^(followed|tractor follows, trailer lost|lost|blind)\b", told, re.M)
    assert found == VERDICTS[name]
    for file in re.findall(r"`(results/\S+\.png|my_\w+\.\w+)`", text):
        assert (tmp_path / file).is_file(), file


def typed(block: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return run(["bash", "-eu", "-c", block], folder)


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        command,
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
