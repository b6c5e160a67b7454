"""The page on sweeps: its files are complete, its commands parse, its code runs."""

from __future__ import annotations

import importlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sweeps import SMALL, here, plan_of
from ttwmr_mj.cli.command_line import parse
from ttwmr_mj.studies.sweep.execute import fill
from ttwmr_mj.studies.sweep.folder.plan_file import write_plan
from ttwmr_mj.studies.sweep.plan.build import build_plan
from ttwmr_mj.studies.sweep.plan.checks import check_plan
from ttwmr_mj.studies.sweep.plan.file import SweepFile, load_sweep, shipped_sweeps

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "howto" / "sweeps.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, flags=re.M | re.S)


def commands() -> list[list[str]]:
    """Of all blocks for a shell, continued lines joined."""
    text = "\n".join([*blocks("sh"), *blocks("bash")]).replace("\\\n", " ")
    text = re.sub(r"\$\w+", "1", text).replace('"', "")
    lines = (line.split("#")[0].removeprefix("srun ").split() for line in text.splitlines())
    return [words[1:] for words in lines if words[:1] == ["ttwmr"]]


@pytest.mark.parametrize("index", range(len(blocks("toml"))))
def test_its_sweeps_can_be_run(index: int, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(blocks("toml")[index])
    request = load_sweep(str(tmp_path / "mine.toml"))
    assert check_plan(build_plan(request), request.source)


def test_its_commands_are_commands() -> None:
    assert len(commands()) >= 8
    for words in commands():
        parse(words)
        sweep = words[1]
        assert sweep.startswith("--") or sweep in shipped_sweeps()


def test_its_scripts_are_scripts(tmp_path: Path) -> None:
    for script in blocks("bash"):
        assert script.startswith("#!/bin/bash\n#SBATCH")
        (tmp_path / "script").write_text(script)
        subprocess.run([shutil.which("bash") or "bash", "-n", tmp_path / "script"], check=True)


def test_its_manifests_are_manifests() -> None:
    yaml = pytest.importorskip("yaml")
    documents = [doc for block in blocks("yaml") for doc in yaml.safe_load_all(block)]
    assert [doc["kind"] for doc in documents] == [
        "Job",
        "Service",
        "Deployment",
        "Deployment",
        "Job",
    ]
    for doc in documents[2:4]:
        spec = doc["spec"]
        assert spec["selector"]["matchLabels"] == spec["template"]["metadata"]["labels"]
    assert documents[1]["spec"]["selector"] == documents[2]["spec"]["selector"]["matchLabels"]
    for doc in (documents[0], documents[4]):
        (container,) = doc["spec"]["template"]["spec"]["containers"]
        shell = container["command"] == ["sh", "-c"]
        words = container["args"][0].split("ttwmr ")[1].split() if shell else container["args"]
        parse(words if shell else [*container["command"][1:], *words])


@pytest.mark.parametrize("library", ["pandas", "polars", "duckdb"])
def test_its_lines_read_a_table(library: str, tmp_path: Path) -> None:
    if importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is not installed")
    plan = plan_of(
        tmp_path, SMALL.replace("reference.radius_m", "robot.hitch.coulomb_friction_n_m")
    )
    write_plan(tmp_path / "out", plan)
    assert fill(plan, tmp_path / "out", here)
    (code,) = (block for block in blocks("python") if f"import {library}" in block)
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path / "out",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= (1 if library == "duckdb" else 4)


def test_every_key_of_the_file_is_told() -> None:
    for key in SweepFile.model_fields:
        assert re.search(rf"^\| .*[`\[]{key}[`\].]", PAGE, flags=re.M), key
