"""An OpenGL context to render into, whatever MUJOCO_GL said when MuJoCo was imported."""

from __future__ import annotations

import importlib
import os
from functools import cache
from typing import Any

from ttwmr_mj.errors import MachineError
from ttwmr_mj.vision.camera.backend import BACKENDS, DEBIAN_PACKAGES, find_backend, probe


@cache
def chosen_backend() -> str:
    """The backend of this process: MUJOCO_GL where it names one, else the first that works.

    Raises:
        MachineError: none works.
    """
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    backend = asked if asked in BACKENDS else find_backend()
    if backend is None:
        tried = "; ".join(f"{name}: {probe(name).fault}" for name in BACKENDS)
        raise MachineError(
            f"no OpenGL to render camera frames with ({tried}). Install the software renderer: "
            f"apt-get install {' '.join(DEBIAN_PACKAGES)}; runs with truth sensing need none"
        )
    return backend


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
        context = importlib.import_module(f"mujoco.{backend}").GLContext(16, 16)
        context.make_current()
    except Exception as error:  # each backend has its own exceptions, none has a common base
        raise MachineError(
            f"OpenGL backend {backend} fails: {error}. Try MUJOCO_GL= one of "
            f"{', '.join(BACKENDS)}, or apt-get install {' '.join(DEBIAN_PACKAGES)}"
        ) from error
    return context
