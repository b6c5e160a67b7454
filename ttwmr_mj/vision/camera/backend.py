"""Which OpenGL backend works here: found by trying, each in a process of its own.

MuJoCo reads MUJOCO_GL when it is imported, and with a value whose libraries are missing the import
itself fails. So nothing here sets it for this process, and runs without a camera never need it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache

BACKENDS = ("egl", "osmesa", "glfw")
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
    """One backend's test.

    Attributes:
        backend: value for MUJOCO_GL.
        renderer: what draws, as OpenGL names it; None when the backend does not work.
        fault: the last line of the failure; empty when it works.
    """

    backend: str
    renderer: str | None
    fault: str


@cache
def probe(backend: str) -> Probe:
    """Make an offscreen context with one backend, in a fresh process."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _TRY],
            env={**os.environ, "MUJOCO_GL": backend},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Probe(backend, None, "no answer within 60 s")
    if done.returncode == 0:
        return Probe(backend, done.stdout.strip(), "")
    last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    return Probe(backend, None, last)


@cache
def find_backend() -> str | None:
    """The first backend that works, or None."""
    return next((name for name in BACKENDS if probe(name).renderer is not None), None)
