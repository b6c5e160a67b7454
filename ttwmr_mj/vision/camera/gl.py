"""An OpenGL context to render into, whatever MUJOCO_GL said when MuJoCo was imported.

MuJoCo reads MUJOCO_GL when it is imported, and with a value whose libraries are missing the import
itself fails. So backends are tried in processes of their own, nothing here sets the variable for
this process, and runs without a camera never need it.
"""

import importlib
import os
import subprocess
import sys
import warnings
from dataclasses import dataclass
from functools import cache
from typing import Any

from ttwmr_mj.errors import MachineError

BACKENDS = ("egl", "osmesa", "glfw")
ANY = ("", "enable", "enabled", "on", "true", "1", "glx", "wgl", "cgl")  # of MUJOCO_GL
DEBIAN_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri")
_TRY = """
import mujoco
context = mujoco.GLContext(64, 64)
context.make_current()
from OpenGL import GL
print(GL.glGetString(GL.GL_RENDERER).decode())
context.free()
"""


@dataclass(frozen=True, slots=True)
class Probe:
    """One backend's test."""

    backend: str  # value for MUJOCO_GL
    renderer: str | None  # what draws, as OpenGL names it; None when the backend does not work
    fault: str  # the last line of the failure; empty when it works


def asked_backend() -> str:
    """What MUJOCO_GL says."""
    return os.environ.get("MUJOCO_GL", "").strip().lower()


@cache
def probe(backend: str) -> Probe:
    """Make an offscreen context with one backend, in a fresh process."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _TRY],
            env={**os.environ, "MUJOCO_GL": backend, "PYTHONSAFEPATH": "1"},  # no files lying about
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Probe(backend, None, "timed out after 60 s")
    if done.returncode == 0:
        return Probe(backend, done.stdout.strip(), "")
    last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    return Probe(backend, None, last)


@cache
def chosen_backend() -> str:
    """The backend of this process: MUJOCO_GL where it names one, else the first that works.

    Raises:
        MachineError: none works, or MUJOCO_GL asks for something else.
    """
    asked = asked_backend()
    if asked in BACKENDS:
        return asked
    if asked not in ANY:
        raise MachineError(
            f"MUJOCO_GL={asked} names no OpenGL to render camera frames with; allowed: "
            f"{', '.join(BACKENDS)}; or unset it"
        )
    for name in BACKENDS:
        if probe(name).renderer is not None:
            return name
    tried = "; ".join(f"{name}: {probe(name).fault}" for name in BACKENDS)
    raise MachineError(
        f"no OpenGL to render camera frames with ({tried}). Install the software renderer: "
        f"apt-get install {' '.join(DEBIAN_PACKAGES)}; runs with truth sensing need none"
    )


def make_context() -> Any:
    """A new offscreen context, current in the calling thread.

    MuJoCo binds `mujoco.GLContext` to one backend when it is imported; the backends' own classes
    work later as well.

    Raises:
        MachineError: no backend works, or the chosen one fails.
    """
    backend = chosen_backend()
    # Mesa's software renderer draws in the calling thread: handing a small picture to threads of
    # its own takes longer than drawing it. Read when the first context is made; drivers of
    # graphics cards do not look at it
    os.environ.setdefault("LP_NUM_THREADS", "0")
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            context = importlib.import_module(f"mujoco.{backend}").GLContext(16, 16)
            context.make_current()
        for warning in warned:  # GLFW only warns of having no display, and goes on
            if isinstance(warning.message, Exception) and "GLFW" in warning.category.__name__:
                raise warning.message
    except Exception as error:  # each backend has its own exceptions, none has a common base
        raise MachineError(
            f"OpenGL backend {backend} fails: {error}. Set MUJOCO_GL to one of "
            f"{', '.join(BACKENDS)}, or apt-get install {' '.join(DEBIAN_PACKAGES)}"
        ) from error
    return context
