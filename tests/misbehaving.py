"""Controllers that misbehave, named in scenarios of the tests."""

from __future__ import annotations

import time

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


class Stubborn(Controller):
    """Never answers the third sample, whatever is raised in it."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim
        self._tries = 0

    def command(self, k: int, estimate: Estimate) -> Command:
        while k == 3 and self._tries < 3:
            try:
                while True:
                    pass
            except:  # noqa: E722  # the worst habit there is
                self._tries += 1
        while k == 3:
            pass
        return self.plain(np.ones((self._nsim, 2)))


class Sleeper(Controller):
    """Sleeps a minute over the third sample."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        if k == 3:
            time.sleep(60.0)
        return self.plain(np.ones((self._nsim, 2)))


class Slow(Controller):
    """Takes 0.3 s of CPU time for the third sample."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        until = time.thread_time() + 0.3
        while k == 3 and time.thread_time() < until:
            pass
        return self.plain(np.ones((self._nsim, 2)))


class Stillborn(Controller):
    """Leaves at its start."""

    def start(self, task: Task) -> None:
        raise SystemExit("never")

    def command(self, k: int, estimate: Estimate) -> Command:
        raise AssertionError


class Stuck(Controller):
    """Never gets over its start."""

    def start(self, task: Task) -> None:
        time.sleep(3600.0)

    def command(self, k: int, estimate: Estimate) -> Command:
        raise AssertionError


class Away(Controller):
    """Drives straight ahead, wherever it should go."""

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        return self.plain(np.full((self._nsim, 2), 30.0))
