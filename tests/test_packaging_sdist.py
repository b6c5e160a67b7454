"""The source distribution makes the same wheel, which an empty environment can install and use."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


def build(folder: Path, kind: str, out: Path) -> Path:
    line = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(out)]
    subprocess.run(line, cwd=folder, check=True, capture_output=True)
    (made,) = out.glob("*.whl" if kind == "wheel" else "*.tar.gz")
    return made


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
