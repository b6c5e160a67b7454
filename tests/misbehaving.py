"""Controllers that misbehave, named in scenarios of the tests."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.sensing import Estimate


class Runaway(Controller):
    """Drives straight, and after ten samples commands NaN."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        return self.plain(np.full((self._nsim, 2), 1.0 if k < 10 else np.nan))


class Broken(Controller):
    """Raises at the fifth sample."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        if k == 5:
            raise ZeroDivisionError("of its own making")
        return self.plain(np.ones((self._nsim, 2)))


class Endless(Controller):
    """Never answers the third sample."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        while k == 3:
            pass
        return self.plain(np.ones((self._nsim, 2)))
