#!/usr/bin/env python3
"""Set everything up on a bare Debian and do one of the two main things.

    python3 bootstrap.py run    set up, then run the laboratory circle in contact physics
    python3 bootstrap.py test   set up, then check style, types and imports and run the quick tests

Needs Python 3.11 or newer, and git to have got here. Everything goes into .venv beside this file;
Debian packages (Python's venv, software OpenGL for camera frames) are installed where that is
allowed, and named where it is not. Standard library only.
"""

from __future__ import annotations

import ctypes.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
VENV = HERE / ".venv"
BIN = VENV / "bin"
MIN_PYTHON = (3, 11)
# Debian package -> a library it brings; rendering needs all of them, recording needs none
OPENGL = {"libegl1": "EGL", "libgl1": "GL"}
OPENGL_DRIVER = "libgl1-mesa-dri"
BROWSER = "chromium"  # only for tests: what a person sees of a run that is looked at

RUN = [[str(BIN / "ttwmr"), "run", "lab_circle"]]
TEST = [
    [str(BIN / "ruff"), "check", "."],
    [str(BIN / "ruff"), "format", "--check", "."],
    [str(BIN / "mypy")],
    [str(BIN / "lint-imports")],
    [str(BIN / "pytest"), "-n", "2", "--dist", "loadfile", "-m", "not slow"],
]


def say(message: str) -> None:
    """Tell the user what is going on."""
    print(f"bootstrap: {message}", flush=True)


def run(*command: str | Path) -> bool:
    """Run a command here; whether it succeeded."""
    return subprocess.run([str(word) for word in command], cwd=HERE, check=False).returncode == 0


def install_debian(*packages: str) -> bool:
    """Install Debian packages where this user may; whether they are there now."""
    if shutil.which("apt-get") is None:
        return False
    prefix: list[str] = []
    if os.geteuid() != 0:
        if shutil.which("sudo") is None or not run("sudo", "-n", "true"):
            return False
        prefix = ["sudo", "-n"]
    say(f"installing Debian packages: {' '.join(packages)}")
    run(*prefix, "apt-get", "update", "-qq")
    install = ["apt-get", "install", "-y", "-qq", "--no-install-recommends"]
    return run(*prefix, "env", "DEBIAN_FRONTEND=noninteractive", *install, *packages)


def make_environment() -> None:
    """A virtual environment in .venv, or leave with what is missing."""
    if (BIN / "python").exists() and run(BIN / "python", "-c", "import pip"):
        return
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for attempt in range(2):
        shutil.rmtree(VENV, ignore_errors=True)
        if run(sys.executable, "-m", "venv", VENV):
            return
        if attempt == 0 and not install_debian(f"{version}-venv"):
            break
    sys.exit(f"bootstrap: cannot make {VENV}; install it: apt-get install {version}-venv")


def install_package(extra: str) -> None:
    """This checkout, editable, with its requirements."""
    say("installing ttwmr-mj and what it needs into .venv, which takes 2 to 10 minutes")
    if not run(BIN / "python", "-m", "pip", "install", "-q", "-e", f".[{extra}]"):
        sys.exit("bootstrap: pip could not install the requirements; its message is above")


def install_opengl() -> None:
    """Software OpenGL for camera frames; without it everything else still works."""
    missing = [name for name, library in OPENGL.items() if not ctypes.util.find_library(library)]
    drivers = list(Path("/usr/lib").glob("*/dri/swrast_dri.so"))
    wanted = [*missing, *([] if drivers else [OPENGL_DRIVER])]
    if wanted and not install_debian(*wanted):
        say(f"no OpenGL here: camera frames need apt-get install {' '.join(wanted)}; going on")


def install_browser() -> None:
    """A browser for the tests of live pages; without it they are skipped."""
    if not shutil.which(BROWSER) and not install_debian(BROWSER):
        say(f"no browser here: tests of live pages need apt-get install {BROWSER}; going on")


def main() -> int:
    """Do the job named on the command line; returns the exit code."""
    if sys.version_info < MIN_PYTHON:
        sys.exit(f"bootstrap: Python {sys.version.split()[0]} is too old; 3.11 or newer is needed")
    jobs = {"run": (RUN, "reproduce,planning,video"), "test": (TEST, "dev")}
    if len(sys.argv) != 2 or sys.argv[1] not in jobs:
        print(__doc__)
        return 2
    commands, extra = jobs[sys.argv[1]]
    make_environment()
    install_package(extra)
    install_opengl()
    if sys.argv[1] == "test":
        install_browser()
    for command in commands:
        say(" ".join(Path(word).name if word.startswith("/") else word for word in command))
        if not run(*command):
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
