"""MuJoCo, imported whatever the environment says.

With a MUJOCO_GL that names nothing, or whose libraries are missing, its import fails, in runs too
that draw nothing. What draws asks for its backend later, by name (`vision.camera.rendering.gl`).
The import starts a `python -c` that looks for GLFW, and would run what lies in the working
directory.
"""

import threading
import warnings
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
    """What MuJoCo warns of meanwhile, in C or in Python; the list is complete after the block.

    Else it prints that, and leaves a log where the user is.
    """
    warned: list[str] = []
    with _reading, warnings.catch_warnings(record=True) as in_python:
        warnings.simplefilter("always", UserWarning)
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(warned.append)
        try:
            yield warned
        finally:
            mujoco.set_mju_user_warning(before)
            # others are of what Python tidies up meanwhile
            warned += (str(w.message) for w in in_python if issubclass(w.category, UserWarning))
