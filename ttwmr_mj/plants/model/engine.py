"""MuJoCo, imported whatever the environment says.

With a MUJOCO_GL that names nothing, or whose libraries are missing, its import fails, in runs too
that draw nothing. What draws asks for its backend later, by name (`vision.camera.rendering.gl`).
The import starts a `python -c` that looks for GLFW, and would run what lies in the working
directory.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ttwmr_mj.files import variable

with variable("MUJOCO_GL", None), variable("PYTHONSAFEPATH", "1"):
    import mujoco
    from mujoco import batch

__all__ = ["batch", "mujoco", "warnings_kept"]

_reading = threading.RLock()


@contextmanager
def warnings_kept() -> Iterator[list[str]]:
    """What MuJoCo warns of meanwhile; else it prints that, and leaves a log where the user is."""
    warned: list[str] = []
    with _reading:
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(warned.append)
        try:
            yield warned
        finally:
            mujoco.set_mju_user_warning(before)
