"""An OpenGL context to render into, whatever MUJOCO_GL said when MuJoCo was imported.

MuJoCo reads MUJOCO_GL when it is imported, and with a value whose libraries are missing the import
itself fails. So backends are tried in processes of their own, nothing here sets the variable for
this process, and runs without a camera never need it. EGL, the first, is asked directly whether it
starts, which takes a tenth of the time.
"""

import ctypes
import importlib
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

from ttwmr_mj.deadline import step
from ttwmr_mj.errors import MachineError
from ttwmr_mj.files import variable

BACKENDS = ("egl", "osmesa", "glfw")
ANY = ("", "enable", "enabled", "on", "true", "1", "glx", "wgl", "cgl")  # of MUJOCO_GL
DEBIAN_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri")
EGL_PLATFORM_DEVICE, MOST_DEVICES = 0x313F, 32
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
    step()
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


def _egl_starts() -> bool:
    """Whether EGL finds a device, as MuJoCo will look for one, that it can start."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        ctypes.CDLL("libGL.so.1")
    except OSError:
        return False
    address = egl.eglGetProcAddress
    address.restype = pointer = ctypes.c_void_p
    found = address(b"eglQueryDevicesEXT"), address(b"eglGetPlatformDisplayEXT")
    if not all(found):
        return False
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, pointer, pointer)(found[0])
    display_of = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(found[1])
    devices, count = (pointer * MOST_DEVICES)(), ctypes.c_int()
    query(MOST_DEVICES, ctypes.addressof(devices), ctypes.addressof(count))
    egl.eglInitialize.argtypes = [pointer] * 3
    displays = (display_of(EGL_PLATFORM_DEVICE, device, None) for device in devices[: count.value])
    return any(display and egl.eglInitialize(display, None, None) for display in displays)


@contextmanager
def _mesa_told() -> Iterator[None]:
    """Tell Mesa, while it starts, unless somebody did; drivers of graphics cards do not look.

    Handing a small picture to threads of its own takes longer than drawing it. And shaders are kept
    in a file that is mapped into memory, by which a full disk would end the process with SIGBUS.
    """
    wanted = {"LP_NUM_THREADS": "0", "MESA_SHADER_CACHE_DISABLE": "true"}
    with ExitStack() as told:
        for name, value in wanted.items():
            told.enter_context(variable(name, os.environ.get(name, value)))
        yield


@cache
@_mesa_told()
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
    if _egl_starts():
        return "egl"
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
    try:
        with _mesa_told(), warnings.catch_warnings(record=True) as warned:
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
