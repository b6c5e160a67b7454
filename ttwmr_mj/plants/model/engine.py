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

import numpy as np

from ttwmr_mj.files import variable
from ttwmr_mj.state import BoolArray

with variable("MUJOCO_GL", None), variable("PYTHONSAFEPATH", "1"):
    import mujoco
    from mujoco import batch

__all__ = ["Faults", "batch", "mujoco", "warnings_kept"]

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


class Faults:
    """What failed in a batch's simulations: MuJoCo warned of it, or raised an error."""

    def __init__(self, simulations: batch.Batch) -> None:
        self._batch = simulations
        self._counts = simulations.warning[:, :, 1]  # a live view
        self._raised: dict[int, str] = {}  # of simulations, in MuJoCo's words

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Errors that MuJoCo raises meanwhile end the block and are kept, the first of each.

        Those simulations stay as they were before the call, and the others are finished.
        """
        try:
            yield
        except batch.SimulationError as error:
            for i in map(int, error.ids):
                self._raised.setdefault(i, " ".join(self._batch.error(i).split()))

    def forget(self) -> None:
        """Forget the errors, as a reset of the batch does the warnings."""
        self._raised.clear()

    def any(self) -> bool:
        """Whether something failed in any simulation."""
        return bool(self._raised) or bool(self._counts.any())

    def failed(self) -> BoolArray:
        """(nsim,) simulations in which something did, such as states that are not finite."""
        failed = self._counts.any(axis=1)
        failed[list(self._raised)] = True
        return np.asarray(failed)

    def of(self, index: int) -> str:
        """All that did in one simulation, in MuJoCo's words; empty: nothing."""
        counters = self._batch.warning[index]
        warned = np.flatnonzero(counters[:, 1])
        told = [mujoco.mju_warningText(int(i), int(counters[i, 0])) for i in warned]
        raised = self._raised.get(index)
        return " ".join([*told, raised] if raised else told)
