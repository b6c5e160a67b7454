"""The source distribution makes the same wheel, which an empty environment can install and use."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from email import message_from_bytes
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


def build(folder: Path, kind: str, out: Path) -> Path:
    line = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(out)]
    subprocess.run(line, cwd=folder, check=True, capture_output=True)
    (made,) = out.glob("*.whl" if kind == "wheel" else "*.tar.gz")
    return made


def addresses(wheel: Path) -> dict[str, str]:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        fields = message_from_bytes(archive.read(name))
    return dict(text.split(", ", 1) for text in fields.get_all("Project-URL", []))


@pytest.mark.parametrize(
    "remote",
    [
        "https://forge.example/team/robot.git",
        "https://somebody:secret@forge.example/team/robot",
        "ssh://git@forge.example:2222/team/robot.git/",
        "git@forge.example:team/robot.git\n",
    ],
)
def test_the_addresses_are_those_of_the_repository_cloned(remote: str) -> None:
    spec = spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    hook = module_from_spec(spec)
    spec.loader.exec_module(hook)
    assert hook.project_urls(remote) == {
        "Repository": "https://forge.example/team/robot",
        "Documentation": "https://forge.example/team/robot/tree/HEAD/docs",
        "Changelog": "https://forge.example/team/robot/blob/HEAD/CHANGELOG.md",
        "Issues": "https://forge.example/team/robot/issues",
    }
    for nowhere in ("", "/home/somebody/robot", "../robot", "file:///robot", "C:/robot"):
        assert hook.project_urls(nowhere) == {}


@pytest.mark.slow
def test_wheels_of_a_clone_and_of_its_source_distribution_name_it(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(clone)], check=True)
    assert addresses(build(clone, "wheel", tmp_path / "nowhere")) == {}
    public = ["config", "remote.origin.url", "https://forge.example/team/robot.git"]
    subprocess.run(["git", "-C", str(clone), *public], check=True)
    direct = addresses(build(clone, "wheel", tmp_path / "direct"))
    assert direct["Repository"] == "https://forge.example/team/robot"
    assert len(direct) == 4
    sdist = build(clone, "sdist", tmp_path / "sdist")
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    assert addresses(build(source, "wheel", tmp_path / "wheel")) == direct


@pytest.mark.slow
def test_from_source_to_an_empty_environment(tmp_path: Path) -> None:
    sdist = build(ROOT, "sdist", tmp_path / "sdist")
    with tarfile.open(sdist) as archive:
        names = archive.getnames()
        parts = [name.split("/") for name in names]
        assert not [x for x in parts if x[1:2] == ["results"] or x[-1].endswith(".rrd")]
        archive.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    from_source = build(source, "wheel", tmp_path / "wheel")
    direct = build(ROOT, "wheel", tmp_path / "direct")
    contents = [set(zipfile.ZipFile(wheel).namelist()) for wheel in (from_source, direct)]
    assert contents[0] == contents[1]
    assert addresses(from_source) == addresses(direct)

    place = tmp_path / "empty"
    venv.create(place, with_pip=True)
    python = place / "bin" / "python"
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}

    def run(*line: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(python), *line],
            cwd=tmp_path,
            env=clean,
            capture_output=True,
            text=True,
            check=False,
        )

    installed = run("-m", "pip", "install", "-q", "--no-deps", str(from_source))
    assert installed.returncode == 0, installed.stderr
    help_text = run("-P", "-m", "ttwmr_mj", "--help")  # what needs no library works without any
    assert (help_text.returncode, help_text.stderr) == (0, "")
    # the libraries of this environment, and nothing of its checkout
    libraries = Path(pytest.__file__).parents[1]
    (lib,) = (place / "lib").glob("python*/site-packages")
    (lib / "libraries.pth").write_text(f"{libraries}\n")
    where = run("-P", "-c", "import ttwmr_mj; print(ttwmr_mj.__file__)")
    assert Path(where.stdout.strip()).is_relative_to(place), where.stderr
    command = place / "bin" / "ttwmr"
    done = subprocess.run(
        [str(command), "run", "lab_circle", "--quiet", "--out=out", "--set=duration_s=0.2"],
        cwd=tmp_path,
        env=clean,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "out" / "metrics.json").is_file()
